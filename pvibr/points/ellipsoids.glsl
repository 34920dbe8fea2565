// Ellipsoids for quadric_cards.glsl. Three texels each: semi-axes in world space, and in w the centre
// relative to its block's.
// The projection of an ellipsoid is an ellipse, whose tangents come from the dual quadric; the card
// is the rectangle about its axes (Sigg et al., "GPU-Based Ray-Casting of Quadratic Surfaces",
// Point-Based Graphics 2006, bound it along x and y).

//@vertex.declare
flat out vec3 ibr_centre; // eye space
flat out mat3 ibr_scaled; // semi-axes over their squared lengths, eye space

// Centre and half extents of the projection along a direction, the longer axis for cards, and across
// it; then half its least width, from the determinant, as a difference of squares loses half a
// float's digits.
void ibr_outline(vec3 c, mat3 m, vec3 radii, out vec2 middle, out vec3 extent, inout vec2 way)
{
  mat3 rows = transpose(m);
  vec3 x = rows[0], y = rows[1], z = rows[2];
  vec3 across = vec3(0.0);
  middle = c.xy;
  float share = 1.0, area = 0.0;
  if (ibr_parallel == 0)
  {
    // In units of the distance, so that squares stay within float range.
    x /= -c.z, y /= -c.z, z /= -c.z;
    middle /= -c.z;
    share = 1.0 - dot(z, z);
    vec3 from = (c * m) / (radii * radii), sides = radii / -c.z;
    area = sides.x * sides.y * sides.z * sqrt(max(dot(from, from) - 1.0, 0.0) / share) / share;
    vec3 wx = cross(x, z), wy = cross(y, z);
    across = vec3(dot(wx, wx), dot(wx, wy), dot(wy, wy));
    vec2 slopes = middle;
    middle = (slopes + vec2(dot(x, z), dot(y, z))) / share;
    x += slopes.x * z;
    y += slopes.y * z;
  }
  vec3 form = (vec3(dot(x, x), dot(x, y), dot(y, y)) - across) / (share * share);
  float size = max(form.x + form.z, 1e-30);
  form /= size;
  float scale = inversesqrt(size);
  area = ibr_parallel == 1 ? length(cross(x * scale, y * scale)) : area / size;
  float half_difference = 0.5 * (form.x - form.z);
  float root = length(vec2(half_difference, form.y));
#if CORNERS == 4
  vec2 axis = half_difference > 0.0 ? vec2(half_difference + root, form.y) : vec2(form.y, root - half_difference);
  if (root > 1e-3) way = normalize(axis);
#endif
  vec2 squares = way * way;
  float mixed = 2.0 * way.x * way.y * form.y;
  vec2 variances = vec2(dot(squares, form.xz) + mixed, dot(squares.yx, form.xz) - mixed);
  extent.xy = sqrt(size * max(variances, 0.0));
  extent.z = area * sqrt(size / (0.5 + root));
#if CORNERS == 4
  if (root > 1e-3) extent.y = extent.z;
#endif
}

vec3 ibr_offset(int i)
{
  return vec3(ibr_fetched(ibr_items, 3 * i).w, ibr_fetched(ibr_items, 3 * i + 1).w,
    ibr_fetched(ibr_items, 3 * i + 2).w);
}

bool ibr_place(int i, vec3 c, out IbrCard card)
{
  vec4 a = ibr_fetched(ibr_items, 3 * i);
  vec4 b = ibr_fetched(ibr_items, 3 * i + 1);
  vec4 d = ibr_fetched(ibr_items, 3 * i + 2);
  mat3 m = ibr_eye_from_world * mat3(a.xyz, b.xyz, d.xyz);
  vec3 radii = vec3(length(m[0]), length(m[1]), length(m[2]));
  float least = ibr_half_pixel(c.z), largest = max(max(radii.x, radii.y), radii.z);
  if (largest <= 0.0) return false;
  float reach = length(vec3(m[0].z, m[1].z, m[2].z));
  card.dot_sized = largest < least;
  card.way = vec2(1.0, 0.0);
  card.bounds = vec4(-ibr_none, ibr_none, -ibr_none, ibr_none);
  if (ibr_parallel == 1 || reach < -0.9999 * c.z)
  {
    vec2 middle;
    vec3 extent;
    ibr_outline(c, m, radii, middle, extent, card.way);
    if (extent.z < 0.5 * ibr_pixel)
    {
      // Half as much again, as the outline tapers.
      vec3 drawn = max(radii, 1.5 * least);
      for (int k = 0; k < 3; k++) m[k] *= drawn[k] / radii[k];
      radii = drawn;
      extent.xy += 0.75 * ibr_pixel;
    }
    middle = vec2(dot(middle, card.way), dot(middle, vec2(-card.way.y, card.way.x)));
    card.bounds = middle.xxyy + extent.xxyy * vec4(-1.0, 1.0, -1.0, 1.0);
  }
  for (int k = 0; k < 3; k++) ibr_scaled[k] = m[k] / (radii[k] * radii[k]);
  ibr_centre = c;
  card.front = c.z + 0.667 / length(vec3(ibr_scaled[0].z, ibr_scaled[1].z, ibr_scaled[2].z));
  card.back = c.z - max(reach, length(vec3(m[0].z, m[1].z, m[2].z)));
  return c.z - reach < -ibr_near;
}

//@fragment.declare
flat in vec3 ibr_centre;
flat in mat3 ibr_scaled;

void ibr_meet(vec3 from, vec3 ray, out vec2 t, out bvec2 hits, out vec3 enters, out vec3 leaves)
{
  vec3 away = ibr_centre - from;
  // In the space where it is the unit sphere, relative to the foot; computed twice, as the error of
  // the first step scales with the longest axis.
  vec3 way = ray * ibr_scaled;
  float inverse = 1.0 / dot(way, way);
  float along = dot(away, ray) / dot(ray, ray);
  along -= dot((along * ray - away) * ibr_scaled, way) * inverse;
  vec3 start = (along * ray - away) * ibr_scaled;
  float foot = -dot(start, way) * inverse;
  start += foot * way;
  float square = 1.0 - dot(start, start);
  float half_chord = sqrt(max(square * inverse, 0.0));
  t = along + foot + vec2(-half_chord, half_chord);
  if (ibr_residual.w > 0.0)
  {
    vec3 scaled = from * ibr_scaled, centre = ibr_centre * ibr_scaled;
    float residual = ibr_residual.x + dot(scaled, scaled - 2.0 * centre);
    vec3 roots = ibr_roots(dot(way, way), dot(centre - scaled, way), residual);
    t = roots.xy;
    square = roots.z;
  }
  hits = bvec2(square >= 0.0);
  enters = normalize(ibr_scaled * (start - half_chord * way));
  leaves = normalize(ibr_scaled * (start + half_chord * way));
}

vec4 ibr_painted(vec3 place)
{
  return ibr_look;
}
