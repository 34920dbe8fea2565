// Shadows of lights by depth maps, in the fragment shader of whatever receives them.
//
// Depth is compared on the receiver's own plane: at the place of each texel that is read, not at
// that of the fragment (Isidoro, "Shadow mapping: GPU-based tips and techniques", GDC 2006). So
// planes of any slope need no bias but for rounding; what is curved gets an offset along the
// normal of a part of a texel (Holbert, "Saying goodbye to shadow acne", GDC 2011).

//@declare
// Where VTK declares none, since it does not light the prop: what follows is not used then.
vec4 vertexVC = vec4(0.0);

vec3 ibr_shadow_flat(vec3 p)
{
  vec3 a = dFdx(p), b = dFdy(p);
  vec3 n = cross(a / max(length(a), 1e-30), b / max(length(b), 1e-30));
  return dot(n, n) > 0.0 ? normalize(n) : vec3(0.0, 0.0, 1.0);
}

// Derivative of texture space along a direction in the plane of the receiver.
vec3 ibr_shadow_along(mat4 m, vec4 q, vec3 t)
{
  vec4 d = m * vec4(t, 0.0);
  return (d.xyz - q.xyz / q.w * d.w) / q.w;
}

// Depth per texture coordinate on the receiver's plane.
vec2 ibr_shadow_slope(mat4 m, vec4 q, vec3 n)
{
  vec3 t = normalize(abs(n.x) < 0.7 ? vec3(0.0, n.z, -n.y) : vec3(-n.z, 0.0, n.x));
  vec3 a = ibr_shadow_along(m, q, t);
  vec3 b = ibr_shadow_along(m, q, cross(n, t));
  float det = a.x * b.y - a.y * b.x;
  float least = 1e-3 * (dot(a.xy, a.xy) + dot(b.xy, b.xy));
  det = abs(det) < least ? (det < 0.0 ? -least : least) : det;
  return vec2(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / det;
}

//@hard
float ibr_shadow_test(
  sampler2D map, vec4 tile, vec3 q, vec2 slope, float bias, float side, vec2 spread)
{
  vec2 texel = floor(clamp(q.xy * side, vec2(0.0), vec2(side - 1.0)));
  float depth = texelFetch(map, ivec2(tile.xy * vec2(textureSize(map, 0)) + texel), 0).r;
  float plane = q.z + dot(slope, (texel + 0.5) / side - q.xy);
  return plane - bias > depth ? 0.0 : 1.0;
}

//@pcf
// Percentage-closer filtering (Reeves et al. 1987): what is filtered is the comparison.
float ibr_shadow_test(
  sampler2DShadow map, vec4 tile, vec3 q, vec2 slope, float bias, float side, vec2 spread)
{
  float angle = 6.2831853 * IBR_DITHER;
  mat2 turn = TAPS > 4 ? mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) : mat2(1.0);
  // A tap compares the four texels around it with the depth at their middle.
  float reach = bias + 0.75 * (abs(slope.x) + abs(slope.y)) / side;
  float lit = 0.0;
  for (int i = 0; i < TAPS; ++i)
  {
    vec2 d = turn * ibr_shadow_disk[i] * spread;
    vec2 uv = clamp(q.xy + d, 1.0 / side, 1.0 - 1.0 / side);
    float plane = q.z + dot(slope, uv - q.xy) - reach;
    lit += texture(map, vec3(tile.xy + uv * tile.zw, min(plane, 1.0)));
  }
  return lit / float(TAPS);
}

//@light
float ibr_shadow_NUMBER(vec3 p, vec3 n)
{
  vec3 toward = POSITIONAL ? normalize(ibr_shadow_place_NUMBER - p) : ibr_shadow_place_NUMBER;
  float facing = dot(n, toward);
  if (facing <= 0.0) return 0.0;
  int view = FIRST;
#if COUNT == 6
  // Of views all around, the one whose axis is nearest.
  float most = -1.0;
  for (int k = FIRST; k < FIRST + COUNT; ++k)
  {
    mat4 m = ibr_shadow_from_view[k];
    float w = dot(vec4(m[0].w, m[1].w, m[2].w, m[3].w), vec4(p, 1.0));
    view = w > most ? k : view;
    most = max(w, most);
  }
#elif COUNT > 1
  // Of views within each other, the narrowest.
  for (int k = FIRST + 1; k < FIRST + COUNT; ++k)
  {
    vec2 c = abs((ibr_shadow_from_view[k] * vec4(p, 1.0)).xy - 0.5);
    view = max(c.x, c.y) < 0.49 ? k : view;
  }
#endif
  mat4 m = ibr_shadow_from_view[view];
  vec4 q = m * vec4(p, 1.0);
  vec3 s = q.xyz / q.w;
  if (q.w <= 0.0 || max(abs(s.x - 0.5), abs(s.y - 0.5)) > 0.5) return 1.0;
  float side = ibr_shadow_size_NUMBER;
  vec2 slope = ibr_shadow_slope(m, q, n);
  float texel = ibr_shadow_texel[view] * (POSITIONAL ? q.w : 1.0);
  vec4 off = m * vec4(p + n * texel * ibr_shadow_offset, 1.0);
  // The receiver's plane is moved along its normal; its place in the map stays.
  vec3 moved = off.xyz / off.w;
  s.z += moved.z - s.z - dot(slope, moved.xy - s.xy);
  // Rounding: of depth, and of vertices to parts of a texel when the map was drawn.
  float bias = 4e-7 + (abs(slope.x) + abs(slope.y)) / side / 128.0;
  ivec2 place = ivec2((view - FIRST) % COLUMNS, (view - FIRST) / COLUMNS);
  vec4 tile = vec4(vec2(place) / vec2(COLUMNS, ROWS), 1.0 / vec2(COLUMNS, ROWS));
  return ibr_shadow_test(
    ibr_shadow_map_NUMBER, tile, s, slope, bias, side, vec2(ibr_shadow_spread / side));
}

//@apply
  vec3 ibr_shadow_p = PLACE;
  vec3 ibr_shadow_n = NORMAL;
  if (dot(ibr_shadow_n, cameraParallel == 1 ? vec3(0.0, 0.0, -1.0) : ibr_shadow_p) > 0.0)
    ibr_shadow_n = -ibr_shadow_n;
