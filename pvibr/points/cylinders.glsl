// Cylinders for quadric_cards.glsl. Two texels each: middle relative to its block's, world axes, and radius;
// unit axis and half its length. Two looks: of the first half and of the second.
// Defines: CAPS, 0 open, 1 flat, 2 round; BLEND, 1 if both looks are mixed along the axis.
// The card is a rectangle along the projected axis that contains the spheres about both ends.

//@vertex.declare
flat out vec4 ibr_middle; // eye space; radius
flat out vec4 ibr_axis;   // unit, eye space; half the length
flat out vec4 ibr_second; // the other end's look

vec3 ibr_offset(int i)
{
  return ibr_fetched(ibr_items, 2 * i).xyz;
}

bool ibr_place(int i, vec3 c, out IbrCard card)
{
  vec4 item = ibr_fetched(ibr_items, 2 * i);
  vec4 axis = ibr_fetched(ibr_items, 2 * i + 1);
  ibr_second = ibr_fetched(ibr_looks, 2 * i + 1);
  vec3 u = ibr_eye_from_world * axis.xyz;
  float least = ibr_half_pixel(c.z), r = max(item.w, least);
  ibr_middle = vec4(c, r);
  ibr_axis = vec4(u, axis.w);
  card.front = c.z + 0.667 * item.w;
  card.back = c.z - axis.w * abs(u.z) - r;
  card.dot_sized = item.w + axis.w < least;
  card.way = vec2(1.0, 0.0);
  if (item.w <= 0.0 || (CAPS != 2 && axis.w <= 0.0)) return false;
  if (card.back >= -ibr_near) return false;
  vec3 a = c - axis.w * u, b = c + axis.w * u;
#if CORNERS == 4
  vec2 run = b.xy - a.xy;
  if (ibr_parallel == 0)
  {
    // Clip at the near plane.
    float last = r - ibr_near;
    if (a.z > last) a = mix(b, a, (last - b.z) / (a.z - b.z));
    if (b.z > last) b = mix(a, b, (last - a.z) / (b.z - a.z));
    card.bounds = vec4(-ibr_none, ibr_none, -ibr_none, ibr_none);
    if (max(a.z, b.z) + r >= 0.0) return true; // around the eye
    run = a.xy / a.z - b.xy / b.z;
  }
  if (dot(run, run) > 0.0) card.way = normalize(run);
#endif
  vec2 across = vec2(-card.way.y, card.way.x);
  vec4 low = vec4(ibr_span(a, r, card.way), ibr_span(a, r, across));
  vec4 high = vec4(ibr_span(b, r, card.way), ibr_span(b, r, across));
  card.bounds = vec4(min(low.xz, high.xz), max(low.yw, high.yw)).xzyw;
  return true;
}

//@fragment.declare
flat in vec4 ibr_middle;
flat in vec4 ibr_axis;
flat in vec4 ibr_second;

// Discriminant, negative for a miss, and distance of a ray's hit on the sphere about an end.
vec2 ibr_ball(vec3 off, vec3 ray, float sign_of_t, float residual)
{
  if (ibr_residual.w > 0.0)
  {
    vec3 roots = ibr_roots(dot(ray, ray), -dot(off, ray), residual);
    return vec2(roots.z, sign_of_t < 0.0 ? roots.x : roots.y);
  }
  float inverse = 1.0 / dot(ray, ray);
  float along = -dot(off, ray) * inverse;
  vec3 near = off + along * ray;
  float square = ibr_middle.w * ibr_middle.w - dot(near, near);
  return vec2(square, along + sign_of_t * sqrt(max(square * inverse, 0.0)));
}

void ibr_meet(vec3 from, vec3 ray, out vec2 t, out bvec2 hits, out vec3 enters, out vec3 leaves)
{
  float r = ibr_middle.w, reach = ibr_axis.w;
  vec3 u = ibr_axis.xyz, away = ibr_middle.xyz - from;
  bool close = ibr_residual.w > 0.0; // then relative to the origin of the ray
  float foot = close ? 0.0 : dot(away, ray) / dot(ray, ray);
  vec3 off = foot * ray - away; // from the middle to the foot
  float up = dot(off, u), rise = dot(ray, u);
  vec3 start = off - up * u, way = ray - rise * u;
  float inverse = 1.0 / max(dot(way, way), 1e-14 * dot(ray, ray));
  float along = -dot(start, way) * inverse;
  vec3 near = start + along * way;
  float square = r * r - dot(near, near);
  float half_chord = sqrt(max(square, 0.0) * inverse);
  t = along + vec2(-half_chord, half_chord);
  vec2 ends_at = vec2(-reach, reach) - up; // heights of both ends
  float residual = 0.0;
  if (close)
  {
    vec3 across = from - dot(from, u) * u;
    residual = ibr_residual.x + dot(across, across - 2.0 * ibr_middle.xyz);
    vec3 roots = ibr_roots(dot(way, way), -dot(start, way), residual);
    t = roots.xy;
    square = roots.z;
    ends_at = ibr_residual.yz - dot(from, u);
  }
  hits = bvec2(square >= 0.0);
  enters = start + t.x * way;
  leaves = start + t.y * way;
#if CAPS == 1
  float steep = abs(rise) < 1e-12 ? 1e-12 : rise;
  vec2 ends = (steep < 0.0 ? ends_at.yx : ends_at) / steep;
  if (ends.x > t.x) enters = -sign(steep) * u;
  if (ends.y < t.y) leaves = sign(steep) * u;
  t = vec2(max(t.x, ends.x), min(t.y, ends.y));
  hits = bvec2(hits.x && t.x <= t.y);
#else
  vec2 heights = t * rise;
  bvec2 below = lessThan(heights, ends_at.xx), above = greaterThan(heights, ends_at.yy);
#if CAPS == 0
  hits = bvec2(hits.x && !below.x && !above.x, hits.y && !below.y && !above.y);
#else
  if (below.x || above.x)
  {
    float height = below.x ? ends_at.x : ends_at.y;
    vec3 end = off + (below.x ? reach : -reach) * u;
    vec2 ball = ibr_ball(end, ray, -1.0, residual + height * height);
    hits.x = hits.x && ball.x >= 0.0;
    t.x = ball.y;
    enters = end + t.x * ray;
  }
  if (below.y || above.y)
  {
    float height = below.y ? ends_at.x : ends_at.y;
    vec3 end = off + (below.y ? reach : -reach) * u;
    vec2 ball = ibr_ball(end, ray, 1.0, residual + height * height);
    hits.y = hits.y && ball.x >= 0.0;
    t.y = ball.y;
    leaves = end + t.y * ray;
  }
#endif
#endif
  t += foot;
  enters = normalize(enters);
  leaves = normalize(leaves);
}

vec4 ibr_painted(vec3 place)
{
  float side = dot(place - ibr_middle.xyz, ibr_axis.xyz);
#if BLEND == 1
  float share = ibr_axis.w > 0.0 ? clamp(0.5 + 0.5 * side / ibr_axis.w, 0.0, 1.0) : 0.5;
  return vec4(mix(ibr_look.rgb, ibr_second.rgb, share), ibr_look.a);
#else
  return side < 0.0 ? ibr_look : ibr_second;
#endif
}
