// Shadows of lights by depth maps, in the fragment shader of whatever receives them.
//
// Depth is compared on the receiver's own plane: at the place of each texel that is read, not at
// that of the fragment (Isidoro, "Shadow mapping: GPU-based tips and techniques", GDC 2006). So
// planes of any slope need no bias but for rounding; what is curved gets an offset along the
// normal of a part of a texel (Holbert, "Saying goodbye to shadow acne", GDC 2011).

//@declare
// Where VTK declares none, since it does not light the prop: what follows is not used then.
vec4 vertex@VC = vec4(0.0);

// How far what has no plane of its own, and faces every light, is lifted towards it.
float ibr_shadow_lift = 0.0;

vec3 ibr_shadow_flat(vec3 p)
{
  vec3 a = dFdx(p), b = dFdy(p);
  vec3 n = cross(a / max(length(a), 1e-30), b / max(length(b), 1e-30));
  return dot(n, n) > 0.0 ? normalize(n) : vec3(0.0, 0.0, 1.0);
}

// What is known where a comparison is made: place and depth in the view (0 to 1), depth per texture
// coordinate on the receiver's plane, allowance for rounding; the view's tile in the texture, its
// texels along a side, near, far, whether it is a perspective, and the light's size in parts of the
// view's sides, at a distance of 1: the tangent of half its angle, or its radius.
struct ibr_Shadow
{
  vec3 place;
  vec2 slope;
  float bias;
  vec4 tile;
  float side;
  float near;
  float far;
  bool perspective;
  vec2 size;
};

float ibr_shadow_linear(ibr_Shadow s, float d)
{
  d = min(d, 1.0);
  return s.perspective ? s.near * d / (s.far - d * (s.far - s.near)) : d;
}

//@disk
// The first of some places, spread out to the whole disk: Vogel's are the same but for that.
vec2 ibr_shadow_tap(int i, int n)
{
  return ibr_shadow_disk[i] * sqrt(float(TAPS) / float(n));
}

//@hard
float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  vec2 texel = floor(clamp(s.place.xy * s.side, vec2(0.0), vec2(s.side - 1.0)));
  float depth = texelFetch(map, ivec2(s.tile.xy * vec2(textureSize(map, 0)) + texel), 0).r;
  float plane = s.place.z + dot(s.slope, (texel + 0.5) / s.side - s.place.xy);
  return plane - s.bias > depth && depth < 1.0 ? 0.0 : 1.0;
}

//@window
// Percentage-closer filtering (Reeves et al., SIGGRAPH 1987): what is filtered is the comparison,
// here of every texel that a square around the receiver overlaps, each with the plane's depth.
float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  vec2 corner = s.place.xy * s.side - ibr_shadow_filter_radius;
  vec2 first = clamp(floor(corner), vec2(0.0), vec2(s.side - float(TAPS)));
  ivec2 origin = ivec2(s.tile.xy * vec2(textureSize(map, 0)) + 0.5) + ivec2(first);
  vec2 slope = s.slope / s.side;
  float row = s.place.z - s.bias + dot(s.slope, (first + 0.5) / s.side - s.place.xy);
  // How much of each texel the square covers, along either axis.
  vec2 begin = corner - first;
  vec2 end = begin + 2.0 * ibr_shadow_filter_radius;
  float hidden = 0.0;
  for (int j = 0; j < TAPS; ++j)
  {
    float high = clamp(min(float(j + 1) - begin.y, end.y - float(j)), 0.0, 1.0);
    float plane = row;
    for (int i = 0; i < TAPS; ++i)
    {
      float wide = clamp(min(float(i + 1) - begin.x, end.x - float(i)), 0.0, 1.0);
      float depth = texelFetch(map, origin + ivec2(i, j), 0).r;
      // What is behind all casters may be behind the far plane, too.
      hidden += plane > depth && depth < 1.0 ? high * wide : 0.0;
      plane += slope.x;
    }
    row += slope.y;
  }
  return 1.0 - hidden / (4.0 * ibr_shadow_filter_radius * ibr_shadow_filter_radius);
}

//@pcf
// The same by the driver's own comparison and linear filter, at places on a disk.
float ibr_shadow_test(sampler2DShadow map, ibr_Shadow s)
{
  float angle = 6.2831853 * IBR_DITHER;
  mat2 turn = TAPS > 4 ? mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) : mat2(1.0);
  // A tap compares the four texels around it with the depth at their middle.
  float reach = s.bias + 0.75 * (abs(s.slope.x) + abs(s.slope.y)) / s.side;
  float lit = 0.0;
  for (int i = 0; i < ibr_shadow_taps; ++i)
  {
    vec2 d = turn * ibr_shadow_tap(i, ibr_shadow_taps) * ibr_shadow_filter_radius / s.side;
    vec2 uv = clamp(s.place.xy + d, 1.0 / s.side, 1.0 - 1.0 / s.side);
    float plane = s.place.z + dot(s.slope, uv - s.place.xy) - reach;
    lit += texture(map, vec3(s.tile.xy + uv * s.tile.zw, min(plane, 1.0)));
  }
  return lit / float(ibr_shadow_taps);
}

//@pcss
// Percentage-closer soft shadows (Fernando, SIGGRAPH 2005 sketches): what hides the light within
// the cone from the receiver to the light is looked for, and its distance sets the filter.
// The depth that hides the receiver's plane at a place, or 2.
float ibr_shadow_hider(sampler2D map, ibr_Shadow s, vec2 d)
{
  vec2 texel = floor(clamp((s.place.xy + d) * s.side, vec2(0.0), vec2(s.side - 1.0)));
  float depth = texelFetch(map, ivec2(s.tile.xy * vec2(textureSize(map, 0)) + texel), 0).r;
  float plane = s.place.z + dot(s.slope, (texel + 0.5) / s.side - s.place.xy);
  return plane - s.bias > depth && depth < 1.0 ? depth : 2.0;
}

float ibr_shadow_distance(ibr_Shadow s, float d)
{
  return s.near + ibr_shadow_linear(s, d) * (s.far - s.near);
}

// Radius in the view of the cone to the light, at some distance from the light.
vec2 ibr_shadow_cone(ibr_Shadow s, float from, float to)
{
  return s.size * (s.perspective ? (to - from) / (to * from) : to - from);
}

// The least depth within a square around the receiver, or a little beside it.
float ibr_shadow_nearest(sampler2D near, ibr_Shadow s, vec2 r)
{
  vec2 tile = vec2(textureSize(near, 0)) * s.tile.zw;
  float level = max(ceil(log2(2.0 * max(r.x, r.y) * s.side / STEP)), 0.0);
  float n = floor(tile.y * exp2(-level) + 0.5);
  vec2 origin = vec2(textureSize(near, 0)) * s.tile.xy;
  origin += level > 0.0 ? vec2(tile.y, tile.y - 2.0 * n) : vec2(0.0);
  vec2 first = floor((s.place.xy - r) * s.side * exp2(-level) / STEP);
  float least = 1.0;
  for (int k = 0; k < 4; ++k)
  {
    vec2 cell = clamp(first + vec2(k & 1, k >> 1), vec2(0.0), vec2(n - 1.0));
    least = min(least, texelFetch(near, ivec2(origin + cell + 0.5), 0).r);
  }
  return least;
}

// No more taps than some for each texel.
int ibr_shadow_enough(ibr_Shadow s, vec2 r)
{
  return min(ibr_shadow_taps, int(min(4.0 + 8.0 * r.x * r.y * s.side * s.side, 64.0)));
}

float ibr_shadow_test(sampler2D map, sampler2D near, ibr_Shadow s)
{
  float angle = 6.2831853 * IBR_DITHER;
  mat2 turn = mat2(cos(angle), sin(angle), -sin(angle), cos(angle));
  float to = ibr_shadow_distance(s, s.place.z);
  float least = 0.7 / s.side;
  // What hides the light lies within its own cone; what is nearest to the light bounds all cones.
  vec2 reach = clamp(ibr_shadow_cone(s, s.near, to), vec2(least), vec2(0.25));
  for (int k = 0; k < 10; ++k)
  {
    float from = ibr_shadow_distance(s, ibr_shadow_nearest(near, s, reach));
    vec2 less = clamp(ibr_shadow_cone(s, from, to), vec2(least), reach);
    bool settled = less.x > 0.8 * reach.x;
    reach = less;
    if (settled) break;
  }
  float sum = 0.0;
  float found = 0.0;
  int count = ibr_shadow_enough(s, reach);
  for (int i = 0; i < count; ++i)
  {
    vec2 d = turn * ibr_shadow_tap(i, count) * reach;
    float depth = ibr_shadow_hider(map, s, d);
    if (depth < 2.0)
    {
      float from = ibr_shadow_distance(s, depth);
      // What lies within the search but beside the cone counts where there is nothing else.
      float w = length(d / (ibr_shadow_cone(s, from, to) + least)) <= 1.0 ? 1.0 : 0.02;
      sum += w * from;
      found += w;
    }
  }
  // Where nothing hides the light there is no second look.
  if (found == 0.0) return 1.0;
  vec2 radius = clamp(ibr_shadow_cone(s, sum / found, to), vec2(least), reach);
  float hidden = 0.0;
  count = ibr_shadow_enough(s, radius);
  for (int i = 0; i < count; ++i)
  {
    // Low bumps within the filter are far beside the cone to the light: 3 times, as measured.
    vec2 d = turn * ibr_shadow_tap(i, count) * radius;
    float depth = ibr_shadow_hider(map, s, d);
    vec2 cone = ibr_shadow_cone(s, ibr_shadow_distance(s, min(depth, 1.0)), to);
    hidden += depth < 2.0 && length(d / (cone + least)) <= 3.0 ? 1.0 : 0.0;
  }
  return 1.0 - hidden / float(count);
}

//@moments
// Where a moment map is read: away from its neighbours in the texture.
vec4 ibr_shadow_moments(sampler2D map, ibr_Shadow s)
{
  vec2 uv = clamp(s.place.xy, 1.0 / s.side, 1.0 - 1.0 / s.side);
  return texture(map, s.tile.xy + uv * s.tile.zw);
}

// The variance that the receiver's own plane has within the filter.
float ibr_shadow_spread(ibr_Shadow s)
{
  float d = 0.5 * length(s.slope) * max(ibr_shadow_filter_radius, 1.0) / s.side;
  float step = ibr_shadow_linear(s, s.place.z) - ibr_shadow_linear(s, s.place.z - d);
  return step * step + 1e-7;
}

// The most that can be lit by what the two moments tell (Chebyshev), dark tails cut off.
float ibr_shadow_most(vec2 m, float t, float least)
{
  float variance = max(m.y - m.x * m.x, least);
  float d = t - m.x;
  float most = d <= 0.0 ? 1.0 : variance / (variance + d * d);
  return clamp((most - 0.2) / 0.8, 0.0, 1.0);
}

//@vsm
float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  vec4 m = ibr_shadow_moments(map, s);
  float t = ibr_shadow_linear(s, s.place.z - s.bias);
  return ibr_shadow_most(m.xy, t, ibr_shadow_spread(s));
}

//@evsm
float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  vec4 m = ibr_shadow_moments(map, s);
  float t = 2.0 * ibr_shadow_linear(s, s.place.z - s.bias) - 1.0;
  float least = 4.0 * ibr_shadow_spread(s);
  float a = exp(WARP * t);
  float b = -exp(-WARP * t);
  float lit = ibr_shadow_most(m.xy, a, least * WARP * WARP * a * a);
  return min(lit, ibr_shadow_most(m.zw, b, least * WARP * WARP * b * b));
}

//@msm
// The least that is hidden by what four moments tell: the Hamburger problem, solved by the
// Cholesky factors of its matrix (Peters and Klein, I3D 2015, algorithm 1).
float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  float z = ibr_shadow_linear(s, s.place.z - s.bias) - sqrt(ibr_shadow_spread(s));
  vec4 m = mix(ibr_shadow_moments(map, s), vec4(0.0, 0.63, 0.0, 0.63), 6e-6);
  float d2 = m.y - m.x * m.x;
  float l = (m.z - m.x * m.y) / d2;
  float d3 = m.w - m.y * m.y - l * l * d2;
  float c1 = z - m.x;
  float c2 = (z * z - m.y - l * c1) / d3;
  c1 = c1 / d2 - l * c2;
  float c0 = 1.0 - c1 * m.x - c2 * m.y;
  float p = c1 / c2;
  float r = sqrt(max(0.25 * p * p - c0 / c2, 0.0));
  float low = -0.5 * p - r;
  float high = -0.5 * p + r;
  float hidden = 0.0;
  if (high < z)
    hidden = 1.0 + (low * high - m.x * (low + high) + m.y) / ((high - z) * (z - low));
  else if (low < z)
    hidden = (z * high - m.x * (z + high) + m.y) / ((high - low) * (z - low));
  return 1.0 - clamp(hidden, 0.0, 1.0);
}

//@light
vec3 ibr_shadow_map_lit_NUMBER(vec3 p, vec3 n)
{
  int view = FIRST;
#if WHOLE == 6
  // Of views all around, the one whose axis is nearest.
  float most = -1.0;
  for (int k = FIRST; k < FIRST + WHOLE; ++k)
  {
    mat4 m = ibr_shadow_from_view[k];
    float w = dot(vec4(m[0].w, m[1].w, m[2].w, m[3].w), vec4(p, 1.0));
    view = w > most ? k : view;
    most = max(w, most);
  }
#endif
  // Of views around the eye, the narrowest.
  float least = 1e30;
  for (int k = FIRST + WHOLE; k < FIRST + WHOLE + REFINED; ++k)
  {
    vec4 c = ibr_shadow_from_view[k] * vec4(p, 1.0);
    vec2 aside = abs(c.xy - 0.5 * c.w);
    bool narrower = ibr_shadow_texel[2 * k] < least;
    if (narrower && max(aside.x, aside.y) < 0.49 * c.w && c.z < c.w)
    {
      view = k;
      least = ibr_shadow_texel[2 * k];
    }
  }
  mat4 m = ibr_shadow_from_view[view];
  vec4 q = m * vec4(p, 1.0);
  vec3 s = q.xyz / q.w;
  if (q.w <= 0.0 || max(abs(s.x - 0.5), abs(s.y - 0.5)) > 0.5) return vec3(1.0);
  float side = ibr_shadow_size_NUMBER;
  vec2 slope = ibr_slope(m, q, n);
  // The side of a texel along which the receiver falls away from the light.
  vec2 texel = vec2(ibr_shadow_texel[2 * view], ibr_shadow_texel[2 * view + 1]);
  vec2 way = abs(slope) * (texel.x + texel.y) / texel + 1e-6;
  float across = dot(way, texel) / length(way) * (POSITIONAL ? q.w : 1.0);
  // The receiver's plane is moved along its normal; its place in the map stays.
  vec3 moved = ibr_along(m, q, n) * (across * ibr_shadow_normal_bias);
  s.z += moved.z - dot(slope, moved.xy);
  // Rounding: of depth, and of vertices to parts of a texel when the map was drawn.
  float bias = 4e-7 + (abs(slope.x) + abs(slope.y)) / side / 128.0;
  if (ibr_shadow_polygon.x >= 0.0)
  {
    // As glPolygonOffset has it: the slope along the steeper axis, and units of resolution.
    bias = ibr_shadow_polygon.x * max(abs(slope.x), abs(slope.y)) / side;
    bias += ibr_shadow_polygon.y / 16777216.0;
    slope = vec2(0.0);
  }
  ivec2 cell = ivec2((view - FIRST) % COLUMNS, (view - FIRST) / COLUMNS);
  ibr_Shadow found;
  found.place = s;
  found.slope = slope;
  found.bias = bias;
  found.tile = vec4(vec2(cell) / vec2(COLUMNS, ROWS), 1.0 / vec2(COLUMNS, ROWS));
  found.side = side;
  found.near = ibr_shadow_range[4 * view];
  found.far = ibr_shadow_range[4 * view + 1];
  found.size = vec2(ibr_shadow_range[4 * view + 2], ibr_shadow_range[4 * view + 3]);
  found.perspective = POSITIONAL;
#if NEAREST
  vec3 lit = vec3(ibr_shadow_test(ibr_shadow_map_NUMBER, ibr_shadow_near_NUMBER, found));
#else
  vec3 lit = vec3(ibr_shadow_test(ibr_shadow_map_NUMBER, found));
#endif
#if VEILED
  // Translucent casters between the light and what is opaque; before the nearest there is none.
  vec2 uv = found.tile.xy + clamp(s.xy, 0.5 / side, 1.0 - 0.5 / side) * found.tile.zw;
  float reach = bias + 2.0 * (abs(slope.x) + abs(slope.y)) / side;
  if (s.z - reach > texture(ibr_shadow_veil_NUMBER, uv).r)
    lit *= texture(ibr_shadow_tint_NUMBER, uv).rgb;
#endif
  return lit;
}

vec3 ibr_shadow_NUMBER(vec3 p, vec3 n)
{
  vec3 toward = POSITIONAL ? normalize(ibr_shadow_place_NUMBER - p) : ibr_shadow_place_NUMBER;
  if (ibr_shadow_lift > 0.0)
  {
    n = toward;
    p += toward * ibr_shadow_lift;
  }
  return dot(n, toward) > 0.0 ? ibr_shadow_map_lit_NUMBER(p, n) : vec3(0.0);
}

//@apply
#ifdef IBR_PLACE
  // What is drawn has another shape than its triangles: it tells its place and normal.
  vec3 ibr_shadow_n = normalize(IBR_NORMAL);
  vec3 ibr_shadow_p = IBR_PLACE;
#elif defined(IBR_BEND)
  // Facets that stand for a curved surface: light reaches that, with no steps where it turns away.
  vec3 ibr_shadow_n = normal@VCVSOutput;
  vec3 ibr_shadow_p = vertex@VC.xyz;
  float ibr_shadow_curve = max(
    length(dFdx(ibr_shadow_n)) / max(length(dFdx(ibr_shadow_p)), 1e-30),
    length(dFdy(ibr_shadow_n)) / max(length(dFdy(ibr_shadow_p)), 1e-30));
  if (IBR_BEND > 2e-6)
    ibr_shadow_p += ibr_shadow_n * min(IBR_BEND, 0.3) / max(ibr_shadow_curve, 1e-30);
#else
  vec3 ibr_shadow_p = vertex@VC.xyz;
  vec3 ibr_shadow_n = ibr_shadow_flat(ibr_shadow_p);
  if (dot(ibr_shadow_n, cameraParallel == 1 ? vec3(0.0, 0.0, -1.0) : ibr_shadow_p) > 0.0)
    ibr_shadow_n = -ibr_shadow_n;
#endif
#ifdef IBR_THIN
  ibr_shadow_lift = 2.0 * IBR_THIN;
#endif
#ifdef IBR_BLUR
  // As much as it may be away from what the light sees of it.
  ibr_shadow_p += ibr_shadow_n * IBR_BLUR;
#endif
