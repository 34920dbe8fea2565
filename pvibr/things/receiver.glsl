// What receives light or a picture from elsewhere: a fragment's position and normal, and whether a
// depth view sees it.
//
// Depth is compared on the receiver's own plane, at the position of each texel read rather than of
// the fragment (Isidoro, "Shadow mapping: GPU-based tips and techniques", GDC 2006). Curved surfaces
// are offset along the normal by a fraction of a texel (Holbert, "Saying goodbye to shadow acne",
// GDC 2011). Twin: pvibr.visibility.depth_test.

// Positions are interpolated twice. Some of a pixel's samples may lie in a triangle whose edges its
// middle is beyond: there the middle's position is behind the surfaces next to it, or beside what
// shades it. What is looked up at a position takes one that is covered; differences between pixels
// take those of middles, since covered positions lie anywhere in their pixels.

//@vertex.declare
#ifndef IBR_RECEIVER
#define IBR_RECEIVER
out vec3 ibr_middleVSOutput;
centroid out vec4 ibr_coveredVSOutput;
#endif

//@vertex.position
  // In view space; in perspective z is derived from w, whatever the near plane.
  ibr_coveredVSOutput =
    ibr_view_from_clip[0] * vec4(gl_Position.xy, dot(ibr_ahead, gl_Position.zw), 1.0);
  ibr_middleVSOutput = ibr_coveredVSOutput.xyz;

//@geometry.declare
// VTK's own, of edges and tubes; it renames what fragments read.
#ifndef IBR_RECEIVER
#define IBR_RECEIVER
in vec3 ibr_middleVSOutput[];
centroid in vec4 ibr_coveredVSOutput[];
out vec3 ibr_middleGSOutput;
centroid out vec4 ibr_coveredGSOutput;
#endif

//@geometry.position
    ibr_middleGSOutput = ibr_middleVSOutput[i];
    ibr_coveredGSOutput = ibr_coveredVSOutput[i];

//@fragment.declare
#ifndef IBR_RECEIVER
#define IBR_RECEIVER
in vec3 ibr_middleVSOutput;
centroid in vec4 ibr_coveredVSOutput;

// Direction from a position to the eye, not normalized.
vec3 ibr_to_eye(vec3 p)
{
  return ibr_ahead.y > 0.0 ? -p : vec3(0.0, 0.0, 1.0);
}

// Normal of the flat surface, toward the eye.
vec3 ibr_flat(vec3 p)
{
  vec3 a = dFdx(p), b = dFdy(p);
  vec3 n = cross(a / max(length(a), 1e-30), b / max(length(b), 1e-30));
  n = dot(n, n) > 0.0 ? normalize(n) : normalize(ibr_to_eye(p));
  return dot(n, ibr_to_eye(p)) < 0.0 ? -n : n;
}

// A position that is covered, by that of the pixel's middle; and from it to where the eye sees the
// surface: half a pixel's width toward the eye.
#ifdef IBR_MULTISAMPLED
// Divided by what should be 1: llvmpipe corrects for the perspective of the middle.
#define IBR_COVERED(middle) (ibr_coveredVSOutput.xyz / ibr_coveredVSOutput.w)
#define IBR_EYEWARD(p, middle) \
  (0.5 * normalize(ibr_to_eye(p)) * (length(dFdx(middle)) + length(dFdy(middle))))
#else
#define IBR_COVERED(middle) middle
#define IBR_EYEWARD(p, middle) vec3(0.0)
#endif

// Whether the surface in a texel hides the receiver: it must be nearer than the receiver's plane
// there, and its own plane nearer than the receiver. In a valley each slope is above the other's
// plane without hiding it; and the middle of a pixel may be behind a surface whose other side its
// samples see, so what is eyeward must be hidden, too. Both are texture coordinates and depth, the
// bias taken off; steepest is the depth of four texels' width.
bool ibr_hides(sampler2D map, vec2 tile, float side, float steepest, vec3 place, vec3 eyeward,
  vec2 texel, float plane, float depth)
{
  if (plane <= depth) return false;
  vec2 here = place.xy * side - texel - 0.5, there = eyeward.xy * side - texel - 0.5;
  vec2 most = min(max(abs(here), abs(there)), 4.0);
  if (min(min(place.z, eyeward.z), plane) > depth + steepest * (most.x + most.y)) return true;
  vec2 away = step(here, vec2(0.0)) * 2.0 - 1.0;
  vec2 beside = clamp(texel + away, vec2(0.0), vec2(side - 1.0));
  vec2 next = vec2(texelFetch(map, ivec2(tile + vec2(beside.x, texel.y) + 0.5), 0).r,
    texelFetch(map, ivec2(tile + vec2(texel.x, beside.y) + 0.5), 0).r);
  vec2 slope = clamp(next - depth, -steepest, steepest) * away;
  vec2 rise = max(slope * clamp(here, -4.0, 4.0), 0.0);
  vec2 eyeward_rise = max(slope * clamp(there, -4.0, 4.0), 0.0);
  return min(place.z, plane) > depth + rise.x + rise.y
    && eyeward.z > depth + eyeward_rise.x + eyeward_rise.y;
}
#endif

//@plane
#ifndef IBR_PLANE
#define IBR_PLANE
// Derivative of texture coordinates along a direction in the receiver's plane.
vec3 ibr_along(mat4 m, vec4 q, vec3 t)
{
  vec4 d = m * vec4(t, 0.0);
  return (d.xyz - q.xyz / q.w * d.w) / q.w;
}

// Depth per texture coordinate on the receiver's plane.
vec2 ibr_slope(mat4 m, vec4 q, vec3 n)
{
  vec3 t = normalize(abs(n.x) < 0.7 ? vec3(0.0, n.z, -n.y) : vec3(-n.z, 0.0, n.x));
  vec3 a = ibr_along(m, q, t);
  vec3 b = ibr_along(m, q, cross(n, t));
  float det = a.x * b.y - a.y * b.x;
  float least = 1e-3 * (dot(a.xy, a.xy) + dot(b.xy, b.xy));
  det = abs(det) < least ? (det < 0.0 ? -least : least) : det;
  return vec2(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / det;
}
#endif

//@seen
#ifndef IBR_SEEN
#define IBR_SEEN
// Largest slope of a blocker away from a receiver, in depth per texel: four texels.
float ibr_steepest(mat4 m, vec4 q, float side)
{
  vec3 x = ibr_along(m, q, vec3(1.0, 0.0, 0.0));
  vec3 y = ibr_along(m, q, vec3(0.0, 1.0, 0.0));
  vec3 z = ibr_along(m, q, vec3(0.0, 0.0, 1.0));
  vec3 across = vec3(x.x, y.x, z.x), along = vec3(x.z, y.z, z.z);
  return 4.0 * length(along) / (side * length(across));
}

// Visibility of a position in a depth view, 0 to 1: four comparisons, each at its texel, weighted
// bilinearly. The matrix maps to texture space; off is the offset along the normal.
float ibr_seen(sampler2D map, mat4 m, vec3 p, vec3 eyeward, vec3 n, float off)
{
  vec4 q = m * vec4(p, 1.0);
  vec3 s = q.xyz / q.w;
  if (q.w <= 0.0 || s.z <= 0.0 || max(abs(s.x - 0.5), abs(s.y - 0.5)) > 0.5) return 1.0;
  vec2 slope = ibr_slope(m, q, n);
  vec4 moved = m * vec4(p + n * off, 1.0);
  vec3 shifted = moved.xyz / moved.w;
  float side = float(textureSize(map, 0).x);
  float bias = 4e-7 + (abs(slope.x) + abs(slope.y)) / side / 128.0;
  float plane = shifted.z - dot(slope, shifted.xy - s.xy) - bias;
  vec4 nearer = m * vec4(p + eyeward, 1.0);
  vec3 place = vec3(s.xy, plane), there = nearer.xyz / nearer.w + vec3(0.0, 0.0, plane - s.z);
  float steepest = ibr_steepest(m, q, side);
  vec2 base = floor(s.xy * side - 0.5);
  vec2 part = s.xy * side - 0.5 - base;
  float seen = 0.0;
  for (int k = 0; k < 4; ++k)
  {
    vec2 d = vec2(k & 1, k >> 1);
    vec2 texel = clamp(base + d, vec2(0.0), vec2(side - 1.0));
    vec2 share = mix(1.0 - part, part, d);
    float here = plane + dot(slope, (texel + 0.5) / side - s.xy);
    float depth = texelFetch(map, ivec2(texel), 0).r;
    bool hidden = ibr_hides(map, vec2(0.0), side, steepest, place, there, texel, here, depth);
    seen += hidden ? 0.0 : share.x * share.y;
  }
  return seen;
}
#endif
