// Shadows from depth maps, in the fragment shaders of receivers.
//
// Depth is compared on the receiver's plane at the position of each texel, not of the fragment
// (Isidoro, "Shadow mapping: GPU-based tips and techniques", GDC 2006), so planes of any slope need
// no bias but for rounding; curved surfaces are offset along the normal by a part of a texel
// (Holbert, "Saying goodbye to shadow acne", GDC 2011).

//@declare
// VTK declares none for unlit props, which do not use what follows.
vec4 vertex@VC = vec4(0.0);

// Offset of a receiver towards each light; whether it has no plane, and faces all lights.
float ibr_shadow_lift = 0.0;
bool ibr_shadow_thin = false;
// From the receiver to where the eye certainly sees it.
vec3 ibr_shadow_eyeward = vec3(0.0);
// Whether a texel nearer than the receiver's plane may belong to a surface next to the receiver.
bool ibr_shadow_unsure = false;

// A receiver in a light's view: position and depth (0 to 1), the same eyeward of it, depth per
// texture coordinate on its plane, and the allowance for rounding; of the view, its tile in the
// texture, texels along a side, depth of four texels' width, near, far, whether it is a perspective,
// and the light's size as a fraction of the view's sides at a distance of 1: the tangent of half its
// angle, or its radius. What is nearer than sure hides the receiver whatever its own plane, which only
// the careful look at.
struct ibr_Shadow
{
  vec3 place;
  vec3 eyeward;
  vec2 slope;
  float bias;
  vec4 tile;
  float side;
  float steepest;
  float near;
  float far;
  bool perspective;
  vec2 size;
  float sure;
  bool careful;
};

float ibr_shadow_linear(ibr_Shadow s, float d)
{
  d = min(d, 1.0);
  return s.perspective ? s.near * d / (s.far - d * (s.far - s.near)) : d;
}

//@blocker
// Begin a filter that is not careful. Looking at a blocker's own plane takes three times as long, and
// few fragments need it: a filter reads all of its texels without, and once more if any was unsure.
// Careful texels are read in loops, which llvmpipe ends early; of conditions it evaluates both
// branches.
void ibr_shadow_careless(inout ibr_Shadow s, float texels)
{
  vec2 reach = min(abs(s.eyeward.xy - s.place.xy) * s.side + texels + 0.5, 4.0);
  s.sure = min(s.place.z, s.eyeward.z) - s.bias - s.steepest * (reach.x + reach.y);
  s.careful = false;
  ibr_shadow_unsure = false;
}

// Whether the surface in a texel hides the receiver, whose plane there has a depth, too. Receivers
// behind all casters may be beyond the far plane.
bool ibr_shadow_hides(sampler2D map, ibr_Shadow s, vec2 texel, float plane, float depth)
{
  bool nearer = depth < min(plane, 1.0);
  if (!s.careful)
  {
    ibr_shadow_unsure = ibr_shadow_unsure || (nearer && depth >= s.sure);
    return nearer;
  }
  vec3 bias = vec3(0.0, 0.0, s.bias);
  vec2 tile = s.tile.xy * vec2(textureSize(map, 0));
  return nearer && ibr_hides(map, tile, s.side, s.steepest, s.place - bias, s.eyeward - bias, texel,
    plane, depth);
}

//@disk
// The i-th of n points on a disk: the first n of Vogel's, scaled to the whole disk.
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
  s.careful = true;
  return ibr_shadow_hides(map, s, texel, plane - s.bias, depth) ? 0.0 : 1.0;
}

//@window
// Percentage-closer filtering (Reeves et al., SIGGRAPH 1987) of comparisons, here with all texels that
// a square around the receiver overlaps, each at the plane's depth.

// The hidden area of the square, in texels; begin is its corner, from the first texel's.
float ibr_shadow_hidden(sampler2D map, ibr_Shadow s, vec2 first, vec2 begin, int count)
{
  vec2 origin = s.tile.xy * vec2(textureSize(map, 0)) + first + 0.5;
  vec2 end = begin + 2.0 * ibr_shadow_filter_radius;
  float hidden = 0.0;
  for (int k = 0; k < count; ++k)
  {
    vec2 texel = vec2(k % TAPS, k / TAPS);
    vec2 covered = clamp(min(texel + 1.0 - begin, end - texel), 0.0, 1.0);
    float depth = texelFetch(map, ivec2(origin + texel), 0).r;
    vec2 d = (first + texel + 0.5) / s.side - s.place.xy;
    float plane = s.place.z - s.bias + dot(s.slope, d);
    bool hides = ibr_shadow_hides(map, s, first + texel, plane, depth);
    hidden += hides ? covered.x * covered.y : 0.0;
  }
  return hidden;
}

float ibr_shadow_test(sampler2D map, ibr_Shadow s)
{
  vec2 corner = s.place.xy * s.side - ibr_shadow_filter_radius;
  vec2 first = clamp(floor(corner), vec2(0.0), vec2(s.side - float(TAPS)));
  vec2 begin = corner - first;
  ibr_shadow_careless(s, ibr_shadow_filter_radius + 1.0);
#if TAPS == 2 && defined(IBR_GATHER)
  // All four at once: above left, above right, right, left.
  vec4 depth = textureGather(map, s.tile.xy + (first + 1.0) * s.tile.zw / s.side);
  vec2 slope = s.slope / s.side;
  float left = s.place.z - s.bias + dot(slope, first + 0.5 - s.place.xy * s.side);
  vec4 plane = left + vec4(slope.y, slope.x + slope.y, slope.x, 0.0);
  vec4 nearer = vec4(lessThan(depth, min(plane, vec4(1.0))));
  ibr_shadow_unsure = dot(nearer, vec4(greaterThanEqual(depth, vec4(s.sure)))) > 0.0;
  vec2 part = clamp(begin, 0.0, 1.0);
  vec2 across = mix(nearer.xw, nearer.yz, part.x);
  float hidden = mix(across.y, across.x, part.y);
#else
  float hidden = ibr_shadow_hidden(map, s, first, begin, TAPS * TAPS);
#endif
  // Not under a condition: compilers would know the count, and unroll the loop.
  s.careful = true;
  int count = ibr_shadow_unsure ? TAPS * TAPS : 0;
  float careful = ibr_shadow_hidden(map, s, first, begin, count);
  hidden = ibr_shadow_unsure ? careful : hidden;
  return 1.0 - hidden / (4.0 * ibr_shadow_filter_radius * ibr_shadow_filter_radius);
}

//@pcf
// The same with the driver's comparison and linear filter, at points on a disk.
float ibr_shadow_test(sampler2DShadow map, ibr_Shadow s)
{
  float angle = 6.2831853 * IBR_DITHER(ibr_shadow_dither);
  mat2 turn = TAPS > 4 ? mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) : mat2(1.0);
  // A tap compares the four texels around it with the depth at its centre.
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
// Percentage-closer soft shadows (Fernando, SIGGRAPH 2005 sketches): a search for blockers within the
// cone from the receiver to the light, whose mean distance sets the filter.
// The depth of a blocker of the receiver's plane at an offset, or 2.
float ibr_shadow_blocker(sampler2D map, ibr_Shadow s, vec2 d)
{
  vec2 texel = floor(clamp((s.place.xy + d) * s.side, vec2(0.0), vec2(s.side - 1.0)));
  float depth = texelFetch(map, ivec2(s.tile.xy * vec2(textureSize(map, 0)) + texel), 0).r;
  float plane = s.place.z + dot(s.slope, (texel + 0.5) / s.side - s.place.xy);
  return ibr_shadow_hides(map, s, texel, plane - s.bias, depth) ? depth : 2.0;
}

float ibr_shadow_distance(ibr_Shadow s, float d)
{
  return s.near + (s.perspective ? ibr_shadow_linear(s, d) : d) * (s.far - s.near);
}

// Radius, in the view, of the receiver's cone to the light at a distance from the light.
vec2 ibr_shadow_cone(ibr_Shadow s, float from, float to)
{
  return s.size * (s.perspective ? (to - from) / (to * from) : to - from);
}

// The nearest depth within a square around the receiver, or slightly outside.
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

// Taps for a radius: limited per texel.
int ibr_shadow_tap_count(ibr_Shadow s, vec2 r)
{
  return min(ibr_shadow_taps, int(min(4.0 + 8.0 * r.x * r.y * s.side * s.side, 64.0)));
}

// The blockers within the search: the sum of their distances, and of their weights.
vec2 ibr_shadow_search(sampler2D map, ibr_Shadow s, mat2 turn, vec2 reach, float to)
{
  float least = 0.7 / s.side;
  int count = ibr_shadow_tap_count(s, reach);
  vec2 blockers = vec2(0.0);
  for (int i = 0; i < count; ++i)
  {
    vec2 d = turn * ibr_shadow_tap(i, count) * reach;
    float depth = ibr_shadow_blocker(map, s, d);
    if (depth < 2.0)
    {
      float from = ibr_shadow_distance(s, depth);
      // Blockers within the search but outside of the cone count only where there are no others.
      float w = length(d / (ibr_shadow_cone(s, from, to) + least)) <= 1.0 ? 1.0 : 0.02;
      blockers += w * vec2(from, 1.0);
    }
  }
  return blockers;
}

// The share of a filter's taps that is hidden.
float ibr_shadow_hidden(sampler2D map, ibr_Shadow s, mat2 turn, vec2 radius, float to)
{
  float least = 0.7 / s.side;
  int count = ibr_shadow_tap_count(s, radius);
  float hidden = 0.0;
  for (int i = 0; i < count; ++i)
  {
    // Low bumps within the filter are far outside of the cone: measured, 3 times its radius.
    vec2 d = turn * ibr_shadow_tap(i, count) * radius;
    float depth = ibr_shadow_blocker(map, s, d);
    vec2 cone = ibr_shadow_cone(s, ibr_shadow_distance(s, min(depth, 1.0)), to);
    hidden += depth < 2.0 && length(d / (cone + least)) <= 3.0 ? 1.0 : 0.0;
  }
  return hidden / float(count);
}

float ibr_shadow_test(sampler2D map, sampler2D near, ibr_Shadow s)
{
  float angle = 6.2831853 * IBR_DITHER(ibr_shadow_dither);
  mat2 turn = mat2(cos(angle), sin(angle), -sin(angle), cos(angle));
  float to = ibr_shadow_distance(s, s.place.z);
  float least = 0.7 / s.side;
  // A blocker lies within its own cone; the blocker nearest to the light bounds all cones.
  vec2 reach = clamp(ibr_shadow_cone(s, s.near, to), vec2(least), vec2(0.25));
  for (int k = 0; k < 10; ++k)
  {
    float from = ibr_shadow_distance(s, ibr_shadow_nearest(near, s, reach));
    vec2 less = clamp(ibr_shadow_cone(s, from, to), vec2(least), reach);
    bool settled = less.x > 0.8 * reach.x;
    reach = less;
    if (settled) break;
  }
  ibr_shadow_careless(s, max(reach.x, reach.y) * s.side + 1.0);
  vec2 blockers = ibr_shadow_search(map, s, turn, reach, to);
  if (ibr_shadow_unsure)
  {
    s.careful = true;
    blockers = ibr_shadow_search(map, s, turn, reach, to);
    s.careful = false;
  }
  // No blocker, no filter.
  if (blockers.y == 0.0) return 1.0;
  vec2 radius = clamp(ibr_shadow_cone(s, blockers.x / blockers.y, to), vec2(least), reach);
  float hidden = ibr_shadow_hidden(map, s, turn, radius, to);
  if (ibr_shadow_unsure)
  {
    s.careful = true;
    hidden = ibr_shadow_hidden(map, s, turn, radius, to);
  }
  return 1.0 - hidden;
}

//@moments
// Moments at the receiver, clamped to its tile of the texture.
vec4 ibr_shadow_moments(sampler2D map, ibr_Shadow s)
{
  vec2 uv = clamp(s.place.xy, 1.0 / s.side, 1.0 - 1.0 / s.side);
  return texture(map, s.tile.xy + uv * s.tile.zw);
}

// Variance of the receiver's own plane within the filter.
float ibr_shadow_spread(ibr_Shadow s)
{
  float d = 0.5 * length(s.slope) * max(ibr_shadow_filter_radius, 1.0) / s.side;
  float step = ibr_shadow_linear(s, s.place.z) - ibr_shadow_linear(s, s.place.z - d);
  return step * step + 1e-7;
}

// Upper bound of the lit share by two moments (Chebyshev), with the dark tail cut off.
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
// Lower bound of the hidden share by four moments: the Hamburger problem, solved by Cholesky
// factors of its matrix (Peters and Klein, I3D 2015, algorithm 1).
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
// Texture coordinates of a position in a view, and for positional lights its distance along the view.
// Reads few uniforms: on llvmpipe each number takes as long as a division.
vec3 ibr_shadow_at_NUMBER(int view, vec3 p)
{
  mat4 v = ibr_shadow_view[view];
#if POSITIONAL
  float w = dot(v[2].xyz, p);
  return vec3(0.5 + vec2(dot(v[0].xyz, p), dot(v[1].xyz, p)) / w, w);
#else
  return vec3(p.xy * vec2(v[0].w, v[1].w) + v[2].xy, 1.0);
#endif
}

// toward: to the light; facing: dot product of normal and toward.
vec3 ibr_shadow_map_lit_NUMBER(vec3 toward, vec3 p, vec3 n, float facing)
{
  int view = FIRST;
  vec2 across = vec2(dot(n, ibr_shadow_view[FIRST][0].xyz), dot(n, ibr_shadow_view[FIRST][1].xyz));
#if POSITIONAL
  p = -toward;
#else
  // All views of a sun have the same axes.
  mat4 axes = ibr_shadow_view[FIRST];
  p = vec3(dot(p, axes[0].xyz), dot(p, axes[1].xyz), -dot(p, toward));
#endif
#if WHOLE == 6
  // Of six views all around, the one whose axis is nearest.
  float along = 0.0;
  for (int k = FIRST; k < FIRST + WHOLE; ++k)
  {
    float w = dot(ibr_shadow_view[k][2].xyz, p);
    view = w > along ? k : view;
    along = max(w, along);
  }
#endif
  vec3 q = ibr_shadow_at_NUMBER(view, p);
#if REFINED
  // Of the views around the eye, the narrowest.
  float most = 0.0;
  for (int k = FIRST + WHOLE; k < FIRST + WHOLE + REFINED; ++k)
  {
    vec3 c = ibr_shadow_at_NUMBER(k, p);
    vec2 aside = abs(c.xy - 0.5);
    bool narrower = ibr_shadow_view[k][0].w > most;
    // Views of a sun include all casters above; those of a lamp have a far plane.
    bool within = max(aside.x, aside.y) < 0.49;
#if POSITIONAL
    within = within && c.z > 0.0 && c.z < ibr_shadow_view[k][3].y;
#endif
    if (narrower && within)
    {
      view = k;
      q = c;
      most = ibr_shadow_view[k][0].w;
    }
  }
#endif
  if (q.z <= 0.0 || max(abs(q.x - 0.5), abs(q.y - 0.5)) > 0.5) return vec3(1.0);
  float side = ibr_shadow_size_NUMBER;
  mat4 v = ibr_shadow_view[view];
#if POSITIONAL
  vec2 wide = v[0].ww;
  float deep = -v[2].w;
  vec3 s = vec3(q.xy, v[1].w - deep / q.z);
#if WHOLE + REFINED > 1
  across = vec2(dot(n, v[0].xyz), dot(n, v[1].xyz));
#endif
  across *= deep / (wide * wide);
#else
  vec2 wide = vec2(v[0].w, v[1].w);
  float deep = v[2].z;
  vec3 s = vec3(q.xy, p.z * deep + v[2].w);
  across *= deep / wide;
#endif
  // Depth per texture coordinate on the receiver's plane.
  vec2 slope = across / facing;
#if POLYGON
  // As glPolygonOffset: the slope along the steeper axis, and units of depth resolution.
  float bias = ibr_shadow_polygon.x * max(abs(slope.x), abs(slope.y)) / side;
  bias += ibr_shadow_polygon.y / 16777216.0;
  slope = vec2(0.0);
#else
  // Move the receiver's plane along its normal by a part of a texel's side in the direction in which
  // it falls away from the light; its position in the map stays.
  vec2 fall = abs(slope) + 1e-6;
  float texel = (fall.x + fall.y) / (side * length(fall * wide));
  s.z -= texel * ibr_shadow_normal_bias * deep / facing;
  // Rounding of depth, and of vertices to subpixels when the map was drawn.
  float bias = 4e-7 + (abs(slope.x) + abs(slope.y)) / side / 128.0;
#endif
  ivec2 cell = ivec2((view - FIRST) % COLUMNS, (view - FIRST) / COLUMNS);
  ibr_Shadow receiver;
  receiver.place = receiver.eyeward = s;
#ifdef IBR_MULTISAMPLED
#if POSITIONAL
  vec3 e = ibr_shadow_at_NUMBER(view, p + ibr_shadow_eyeward);
  receiver.eyeward += vec3(e.xy - q.xy, deep / q.z - deep / max(e.z, 0.5 * q.z));
#else
  vec3 e = ibr_shadow_eyeward;
  e = vec3(dot(e, axes[0].xyz), dot(e, axes[1].xyz), -dot(e, toward));
  receiver.eyeward += e * vec3(wide, deep);
#endif
#endif
  receiver.slope = slope;
  receiver.bias = bias;
  receiver.tile = vec4(vec2(cell) / vec2(COLUMNS, ROWS), 1.0 / vec2(COLUMNS, ROWS));
  receiver.side = side;
  receiver.steepest = 4.0 * deep / (q.z * side * min(wide.x, wide.y));
  receiver.near = v[3].x;
  receiver.far = v[3].y;
  receiver.size = v[3].zw;
  receiver.perspective = bool(POSITIONAL);
#if NEAREST
  vec3 lit = vec3(ibr_shadow_test(ibr_shadow_map_NUMBER, ibr_shadow_near_NUMBER, receiver));
#else
  vec3 lit = vec3(ibr_shadow_test(ibr_shadow_map_NUMBER, receiver));
#endif
#if VEILED
  // Translucent casters between the light and opaque ones; none in front of the nearest.
  vec2 uv = receiver.tile.xy + clamp(s.xy, 0.5 / side, 1.0 - 0.5 / side) * receiver.tile.zw;
  float reach = bias + 2.0 * (abs(slope.x) + abs(slope.y)) / side;
  if (s.z - reach > texture(ibr_shadow_veil_NUMBER, uv).r)
    lit *= texture(ibr_shadow_tint_NUMBER, uv).rgb;
#endif
  return lit;
}

vec3 ibr_shadow_NUMBER(vec3 p, vec3 n)
{
  vec3 toward = ibr_shadow_place_NUMBER - (POSITIONAL == 1 ? p : vec3(0.0));
  if (ibr_shadow_thin) n = normalize(toward);
  if (ibr_shadow_lift > 0.0)
  {
    // At most half way, so that a nearby lamp stays in front.
    float share = ibr_shadow_lift / length(toward);
    vec3 lift = toward * (POSITIONAL == 1 ? min(share, 0.5) : share);
    p += lift;
    toward -= POSITIONAL == 1 ? lift : vec3(0.0);
  }
  float facing = dot(n, toward);
  // At grazing light, planes are too steep for the resolution of depth.
  facing = max(facing, 1e-3 * (POSITIONAL == 1 ? length(toward) : 1.0));
  return dot(n, toward) > 0.0 ? ibr_shadow_map_lit_NUMBER(toward, p, n, facing) : vec3(0.0);
}

//@apply
#ifdef IBR_PLACE
  // The shape is not that of the triangles: its shader gives position and normal.
  vec3 ibr_shadow_n = normalize(IBR_NORMAL);
  vec3 ibr_shadow_p = IBR_PLACE;
#else
  vec3 ibr_shadow_p = IBR_COVERED(vertex@VC.xyz);
  ibr_shadow_eyeward = IBR_EYEWARD(ibr_shadow_p, vertex@VC.xyz);
#ifdef IBR_BEND
  // Facets of a curved surface: shade the surface, without steps at the terminator.
  vec3 ibr_shadow_n = normal@VCVSOutput;
  float ibr_shadow_curve = max(
    length(dFdx(ibr_shadow_n)) / max(length(dFdx(vertex@VC.xyz)), 1e-30),
    length(dFdy(ibr_shadow_n)) / max(length(dFdy(vertex@VC.xyz)), 1e-30));
  if (IBR_BEND > 2e-6)
    ibr_shadow_p += ibr_shadow_n * min(IBR_BEND, 0.3) / max(ibr_shadow_curve, 1e-30);
#else
  vec3 ibr_shadow_n = ibr_flat(vertex@VC.xyz);
#endif
#endif
#ifdef IBR_THIN
  ibr_shadow_lift = 2.0 * IBR_THIN;
  ibr_shadow_thin = true;
#endif
#ifdef IBR_PLACE_ERROR
  // As far as the drawn shape may be off its shape in the map.
  ibr_shadow_lift = IBR_PLACE_ERROR;
#endif
