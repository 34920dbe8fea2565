// A mesh textured by photographs: up to four per triangle, with weights and corrections at corners.
//
// Table: nine texels per photograph: three rows from clip space to the camera plane (x, y, depth),
// where the third component of clip space is the one that holds depth; the lens (two); plane to
// sheet texels (two), with the squared lens radius as last component of the first; the first and
// last sheet texel of the photograph; its gain.
//
// The coarse variant interpolates the colours of corners.
//
// PHOTOS_VIEWS is 1 to show photographs taken from near the eye before those of the triangles;
// their indices are uniforms, their shares at points a texture.
//
// PHOTOS_LENS is 1 if lens distortion between the corners of triangles is visible.

//@lens
// A point of the camera's plane in sheet texels, times its depth.
vec3 ibr_photos_at(sampler2D table, int row, vec3 q)
{
  vec4 a = texelFetch(table, ivec2(3, row), 0), b = texelFetch(table, ivec2(4, row), 0);
  vec4 u = texelFetch(table, ivec2(5, row), 0), v = texelFetch(table, ivec2(6, row), 0);
  vec2 xy = q.xy / q.z;
  float s = min(dot(xy, xy), u.w);
  xy = (1.0 + s * (a.x + s * (a.y + s * b.x))) / (1.0 + s * (b.y + s * (b.z + s * b.w))) * xy
    + 2.0 * dot(xy, a.wz) * xy + s * a.wz;
  return vec3(dot(u.xyz, vec3(xy, 1.0)), dot(v.xyz, vec3(xy, 1.0)), 1.0) * q.z;
}

//@coarse.vertex.declare
in vec4 ibr_photos_mean;
out vec4 ibr_photos_seen;

//@coarse.vertex.place
  ibr_photos_seen = ibr_photos_mean;

//@coarse.fragment.declare
in vec4 ibr_photos_seen;

//@coarse.fragment.find
  float ibr_photos_cover = ibr_photos_seen.a > 0.5 ? ibr_photos_opacity : 0.0;
  vec3 ibr_photos_color = ibr_photos_seen.rgb * ibr_photos_gain;

//@vertex.declare
in vec4 ibr_photos_number;
in vec4 ibr_photos_weight;
in vec3 ibr_photos_change0;
in vec3 ibr_photos_change1;
in vec3 ibr_photos_change2;
in vec3 ibr_photos_change3;
flat out vec4 ibr_photos_of;
out vec4 ibr_photos_share;
out vec3 ibr_photos_change[4];
out vec3 ibr_photos_plane[4];
#if PHOTOS_VIEWS
in float ibr_photos_point;
out vec4 ibr_photos_near;
out vec3 ibr_photos_spot[4];
flat out vec4 ibr_photos_views;
#endif

vec3 ibr_photos_place(int row, vec4 clip)
{
  vec3 q;
  for (int axis = 0; axis < 3; ++axis)
    q[axis] = dot(texelFetch(ibr_photos_table, ivec2(axis, row), 0), clip);
  return PHOTOS_LENS == 1 ? q : ibr_photos_at(ibr_photos_table, row, q);
}

//@vertex.place
  ibr_photos_of = ibr_photos_number;
  ibr_photos_share = ibr_photos_weight;
  ibr_photos_change[0] = ibr_photos_change0;
  ibr_photos_change[1] = ibr_photos_change1;
  ibr_photos_change[2] = ibr_photos_change2;
  ibr_photos_change[3] = ibr_photos_change3;
  vec4 ibr_photos_clip =
    vec4(gl_Position.xy, ibr_photos_parallel == 1 ? gl_Position.z : gl_Position.w, 1.0);
  for (int k = 0; k < 4; ++k)
  {
    if (ibr_photos_number[k] < 0.0) break;
    ibr_photos_plane[k] = ibr_photos_place(int(ibr_photos_number[k]), ibr_photos_clip);
  }
#if PHOTOS_VIEWS
  ivec2 ibr_photos_texel = ivec2(int(ibr_photos_point) % 2048, int(ibr_photos_point) / 2048);
  ibr_photos_near = texelFetch(ibr_photos_shares, ibr_photos_texel, 0);
  ibr_photos_views = ibr_photos_shown;
  for (int k = 0; k < 4; ++k)
  {
    if (ibr_photos_shown[k] < 0.0) break;
    ibr_photos_spot[k] = ibr_photos_place(int(ibr_photos_shown[k]), ibr_photos_clip);
  }
#endif

//@fragment.declare
flat in vec4 ibr_photos_of;
in vec4 ibr_photos_share;
in vec3 ibr_photos_change[4];
in vec3 ibr_photos_plane[4];
#if PHOTOS_VIEWS
in vec4 ibr_photos_near;
in vec3 ibr_photos_spot[4];
flat in vec4 ibr_photos_views;
#endif

// The mean of the sheet over a fragment's footprint: samples half as wide as its shorter side, or
// a single one while the view moves.
vec4 ibr_photos_area(vec2 at, vec2 across, vec2 along)
{
  vec2 size = vec2(textureSize(ibr_photos_sheet, 0));
  float a = length(across), b = length(along);
  vec2 longer = a > b ? across : along, shorter = a > b ? along : across;
  float wide = max(max(a, b), 1.0), thin = max(min(a, b), max(wide / 4.0, 1.0));
  float rows = thin > 1.0 && ibr_photos_fine == 1 ? 2.0 : 1.0;
  float looks = ibr_photos_fine == 1 ? ceil(rows * wide / thin - 0.25) : 1.0;
  float level = floor(log2(max(ibr_photos_fine == 1 ? thin / rows : sqrt(wide * thin), 1.0)) + 0.4);
  // A sample is as wide as a texel: together they have the variance of the footprint.
  vec2 count = vec2(looks, rows), sides = vec2(wide, thin);
  vec2 spread = max(sides * sides - exp2(2.0 * level), 0.0) / max(count * count - 1.0, 1.0);
  spread = min(sqrt(spread) * count / sides, 1.0);
  vec4 sum = vec4(0.0);
  for (float i = 0.5; i < rows; i += 1.0)
    for (float k = 0.5; k < looks; k += 1.0)
      sum += textureLod(ibr_photos_sheet, (at + spread.x * (k / looks - 0.5) * longer
        + spread.y * (i / rows - 0.5) * shorter) / size, level);
  return sum / (rows * looks);
}

// The colour of a photograph at a point of its plane, times its share.
vec4 ibr_photos_one(int row, vec3 q, float share, vec3 change)
{
#if PHOTOS_LENS
  q = ibr_photos_at(ibr_photos_looks, row, q);
#endif
  vec2 at = q.xy / q.z;
  vec2 across = dFdx(at), along = dFdy(at);
  if (share <= 0.0) return vec4(0.0);
  vec4 rect = texelFetch(ibr_photos_looks, ivec2(7, row), 0);
  float inset = 0.5 * max(max(length(across), length(along)), 1.0);
  vec2 middle = 0.5 * (rect.xy + rect.zw);
  at = clamp(at, min(rect.xy + inset, middle), max(rect.zw - inset, middle));
  vec4 color = ibr_photos_area(at, across, along);
  color.rgb = color.rgb * texelFetch(ibr_photos_looks, ivec2(8, row), 0).rgb + change;
  color.a *= share;
  return vec4(clamp(color.rgb, 0.0, 1.0) * color.a, color.a);
}

//@fragment.find
  vec4 ibr_photos_sum = vec4(0.0);
  float ibr_photos_rest = 1.0;
#if PHOTOS_VIEWS
  ibr_photos_rest -= dot(ibr_photos_near, vec4(1.0));
  ibr_photos_rest = ibr_photos_rest > 1e-4 ? ibr_photos_rest : 0.0;
#endif
  for (int k = 0; k < (ibr_photos_fine == 1 ? 4 : 2); ++k)
  {
    if (ibr_photos_of[k] < 0.0) break;
    ibr_photos_sum += ibr_photos_one(int(ibr_photos_of[k]), ibr_photos_plane[k],
      ibr_photos_rest * ibr_photos_share[k], ibr_photos_change[k]);
  }
#if PHOTOS_VIEWS
  for (int k = 0; k < 4; ++k)
  {
    if (ibr_photos_views[k] < 0.0 || ibr_photos_of[0] < 0.0) break;
    ibr_photos_sum += ibr_photos_one(int(ibr_photos_views[k]), ibr_photos_spot[k],
      ibr_photos_near[k], vec3(0.0));
  }
#endif
  float ibr_photos_cover = ibr_photos_sum.a > 1e-4 ? ibr_photos_opacity : 0.0;
  vec3 ibr_photos_color = ibr_photos_sum.rgb / max(ibr_photos_sum.a, 1e-6) * ibr_photos_gain;

//@fragment.lit
  ambientColor = mix(ambientColor, ambientIntensity * ibr_photos_color, ibr_photos_cover);
  diffuseColor = mix(diffuseColor, diffuseIntensity * ibr_photos_color, ibr_photos_cover);

// PHOTOS_WHOLE is 1 if no triangle is bare, to skip lighting, which costs as much as two photographs.
//@fragment.over
#if PHOTOS_WHOLE
  gl_FragData[0] = vec4(mix(diffuseColor, ibr_photos_color, ibr_photos_cover), opacity);
#else
//VTK::Light::Impl
  gl_FragData[0].rgb = mix(gl_FragData[0].rgb, ibr_photos_color, ibr_photos_cover);
#endif
