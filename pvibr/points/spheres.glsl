// Spheres for quadric_cards.glsl. One texel each: centre relative to its block's, world axes; radius.

//@vertex.declare
flat out vec4 ibr_item; // centre, eye space; radius

vec3 ibr_offset(int i)
{
  return ibr_fetched(ibr_items, i).xyz;
}

bool ibr_place(int i, vec3 c, out IbrCard card)
{
  vec4 item = ibr_fetched(ibr_items, i);
  float r = max(item.w, ibr_half_pixel(c.z));
  ibr_item = vec4(c, r);
  card.way = vec2(1.0, 0.0);
  card.bounds = vec4(ibr_span(c, r, card.way), ibr_span(c, r, card.way.yx));
  card.front = c.z + 0.667 * item.w;
  card.back = c.z - r;
  card.dot_sized = item.w < r;
  return item.w > 0.0 && c.z - item.w < -ibr_near;
}

//@fragment.declare
flat in vec4 ibr_item;

void ibr_meet(vec3 from, vec3 ray, out vec2 t, out bvec2 hits, out vec3 enters, out vec3 leaves)
{
  vec3 away = ibr_item.xyz - from;
  float inverse = 1.0 / dot(ray, ray);
  float along = dot(away, ray) * inverse;
  vec3 off = along * ray - away; // from the centre to the foot
  float square = ibr_item.w * ibr_item.w - dot(off, off);
  float half_chord = sqrt(max(square * inverse, 0.0));
  t = along + vec2(-half_chord, half_chord);
  if (ibr_residual.w > 0.0)
  {
    float residual = ibr_residual.x + dot(from, from - 2.0 * ibr_item.xyz);
    vec3 roots = ibr_roots(dot(ray, ray), dot(away, ray), residual);
    t = roots.xy;
    square = roots.z;
  }
  hits = bvec2(square >= 0.0);
  enters = normalize(off - half_chord * ray);
  leaves = normalize(off + half_chord * ray);
}

vec4 ibr_painted(vec3 place)
{
  return ibr_look;
}
