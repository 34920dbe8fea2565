// What receives light or a picture from elsewhere: a fragment's position and normal, and whether a
// depth view sees it.
//
// Depth is compared on the receiver's own plane, at the position of each texel read rather than of
// the fragment (Isidoro, "Shadow mapping: GPU-based tips and techniques", GDC 2006). Curved surfaces
// are offset along the normal by a fraction of a texel (Holbert, "Saying goodbye to shadow acne",
// GDC 2011). Twin: pvibr.visibility.depth_test.

//@vertex.declare
#ifndef IBR_CLIP
#define IBR_CLIP
out vec4 ibr_clip;
#endif

//@fragment.clip
#ifndef IBR_CLIP
#define IBR_CLIP
in vec4 ibr_clip;
#endif

//@fragment.pixel
// A geometry shader in between passes no outputs of the vertex shader on.
#ifndef IBR_CLIP
#define IBR_CLIP
#define ibr_clip (vec4((gl_FragCoord.xy - ibr_viewport.xy) / ibr_viewport.zw, gl_FragCoord.z, \
  1.0) * vec4(2.0, 2.0, 2.0, 1.0) - vec4(1.0, 1.0, 1.0, 0.0)) / gl_FragCoord.w
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

//@declare
#ifndef IBR_RECEIVER
#define IBR_RECEIVER
// Position in view space; in perspective z is derived from w, whatever the near plane.
vec3 ibr_place(vec4 clip)
{
  return (ibr_view_from_clip[0] * vec4(clip.xy, dot(ibr_ahead, clip.zw), 1.0)).xyz;
}

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
float ibr_seen(sampler2D map, mat4 m, vec3 p, vec3 n, float off)
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
  vec2 base = floor(s.xy * side - 0.5);
  vec2 part = s.xy * side - 0.5 - base;
  float seen = 0.0;
  for (int k = 0; k < 4; ++k)
  {
    vec2 d = vec2(k & 1, k >> 1);
    vec2 texel = clamp(base + d, vec2(0.0), vec2(side - 1.0));
    vec2 share = mix(1.0 - part, part, d);
    float here = plane + dot(slope, (texel + 0.5) / side - s.xy);
    float there = texelFetch(map, ivec2(texel), 0).r;
    if (here > there)
    {
      // The blocker's own plane must hide the fragment, too: in a valley each slope is above the
      // other's plane without hiding it.
      ivec2 last = ivec2(int(side) - 1), at = ivec2(texel), out_ = 2 * ivec2(d) - 1;
      vec2 next = vec2(texelFetch(map, clamp(at + ivec2(out_.x, 0), ivec2(0), last), 0).r,
        texelFetch(map, clamp(at + ivec2(0, out_.y), ivec2(0), last), 0).r);
      there += dot(clamp(there - next, 0.0, ibr_steepest(m, q, side)), 1.0 - share);
    }
    seen += here > there && plane > there ? 0.0 : share.x * share.y;
  }
  return seen;
}
#endif
