// Impostors: one quad for each image in a pool of tiles, with depth.
// The vertex shader places the card where its image was rendered from; the fragment shader finds
// the texel that shows the surface point under the pixel, hands its colour, normal and material to
// VTK's lighting and writes its depth, so that cards intersect as their meshes do.
// Sources: Schaufler, "Dynamically Generated Impostors", GI Workshop 1995; "Nailboards: A
// Rendering Primitive for Image Caching in Dynamic Scenes", EGWR 1997.
// Spaces: eye = VTK's VC. A card has 5 texels of ibr_cards, a layer 6, see Images.card_rows.
// Defines: MATERIALS, 1 if there are several; TINTED, 1 if any edges have another colour than black;
// CLEAR, 1 for layers of translucent surfaces.

//@vertex.declare
uniform sampler2D ibr_cards;
uniform int ibr_count;
uniform mat4 ibr_clip_from_eye;
flat out vec4 ibr_rect;      // corner in the pool, sides, texels
flat out vec4 ibr_image_eye;      // eye of the image, or view direction; w 1 if parallel
flat out vec3 ibr_planes;    // distances of near plane, far plane and card from that eye
#if CLEAR
flat out vec2 ibr_layer;     // opacity, and texels above the first layer of the same faces
#endif
flat out vec2 ibr_foot;      // of that eye on the card, texels from the corner
flat out vec3 ibr_eye;       // foot of this frame's eye and its height, or the same of its direction
out vec2 ibr_uv;             // texels from the corner
out vec4 vertexVCVSOutput;

//@vertex.position
  {
    int card = gl_VertexID / 4;
    int corner = gl_VertexID % 4;
    bool live = card < ibr_count;
    ivec2 at = live ? ivec2(card % 128 * (5 + CLEAR), card / 128) : ivec2(0);
    vec4 origin = texelFetch(ibr_cards, at, 0);
    vec4 right = texelFetch(ibr_cards, at + ivec2(1, 0), 0);
    vec4 up = texelFetch(ibr_cards, at + ivec2(2, 0), 0);
    ibr_image_eye = texelFetch(ibr_cards, at + ivec2(3, 0), 0);
    ibr_rect = texelFetch(ibr_cards, at + ivec2(4, 0), 0);
    ibr_planes = vec3(right.w, up.w, origin.w);
#if CLEAR
    ibr_layer = texelFetch(ibr_cards, at + ivec2(5, 0), 0).xy;
#endif
    vec2 q = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
    ibr_uv = q * ibr_rect.zw;
    mat3 axes = mat3(ibr_rect.z * right.xyz / dot(right.xyz, right.xyz),
      ibr_rect.w * up.xyz / dot(up.xyz, up.xyz), normalize(cross(right.xyz, up.xyz)));
    bool is_parallel = ibr_image_eye.w > 0.5;
    ibr_foot = ((ibr_image_eye.xyz - origin.xyz) * axes).xy;
    ibr_eye = (is_parallel ? vec3(0.0, 0.0, 1.0) : -origin.xyz) * axes;
    vertexVCVSOutput = vec4(origin.xyz + q.x * right.xyz + q.y * up.xyz, 1.0);
    gl_Position = ibr_clip_from_eye * vertexVCVSOutput;
    // A card may extend beyond its contents, and beyond the clipping planes.
    gl_Position.z = clamp(gl_Position.z, -0.9999 * gl_Position.w, 0.9999 * gl_Position.w);
    if (!live) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); }
  }

//@fragment.declare
uniform sampler2D ibr_albedo;    // colour times coverage, coverage
uniform sampler2D ibr_shape;     // normal in world space times coverage, material
uniform sampler2D ibr_depth;
#if TINTED
uniform sampler2D ibr_tint;      // unlit colour of edges
#endif
uniform sampler2D ibr_materials;
uniform mat3 ibr_eye_from_world;
uniform vec4 ibr_clip_depth;     // rows z and w of clip from eye, z columns: zz, zw, wz, ww
flat in vec4 ibr_rect;
flat in vec4 ibr_image_eye;
flat in vec3 ibr_planes;
#if CLEAR
flat in vec2 ibr_layer;
#endif
flat in vec2 ibr_foot;
flat in vec3 ibr_eye;
in vec2 ibr_uv;
in vec4 vertexVCVSOutput;

// Distance from the image's eye of a depth, along its view.
float ibr_distance(float depth)
{
  return ibr_image_eye.w > 0.5 ? mix(ibr_planes.x, ibr_planes.y, depth) : ibr_planes.x
    * ibr_planes.y / (ibr_planes.y - depth * (ibr_planes.y - ibr_planes.x));
}
#ifdef GL_ARB_sample_shading
// Places of 4 samples and of 8 in a pixel, 16ths from its middle.
const ivec2 IBR_SAMPLES[12] = ivec2[12](
  ivec2(-2, -6), ivec2(6, -2), ivec2(-6, 2), ivec2(2, 6),
  ivec2(1, -3), ivec2(-1, 3), ivec2(5, 1), ivec2(-3, -5),
  ivec2(-5, 5), ivec2(-7, -1), ivec2(3, 7), ivec2(7, -7));
#endif

//@fragment.sample
  vec2 ibr_across = dFdx(ibr_uv) / 16.0;
  vec2 ibr_upward = dFdy(ibr_uv) / 16.0;
  // The image shows a point that lies before or behind the card where its own eye saw it. Outside
  // of an outline, the depth is that of the part beside it.
  float ibr_met = 1.0;
  for (int k = 0; k < 5; ++k)
  {
    vec2 ibr_beside = k == 0 ? vec2(0.0) : 32.0 * vec2(float(k & 1), float(k >> 1 & 1)) - 16.0;
    vec2 ibr_to = ibr_uv + ibr_beside.x * ibr_across + ibr_beside.y * ibr_upward;
    ibr_to = ibr_rect.xy + clamp(ibr_to, vec2(0.5), ibr_rect.zw - 0.5);
    ibr_met = texelFetch(ibr_depth, ivec2(ibr_to), 0).r;
    if (ibr_met < 1.0 && ibr_met > 0.0) { break; }
  }
  float ibr_reach = ibr_distance(ibr_met);
  float ibr_height = ibr_planes.z - ibr_reach;
  vec2 ibr_seen = ibr_image_eye.w > 0.5 ? ibr_uv + ibr_eye.xy * ibr_height / ibr_eye.z : ibr_foot
    + (mix(ibr_uv, ibr_eye.xy, ibr_height / ibr_eye.z) - ibr_foot) * ibr_planes.z / ibr_reach;
  ibr_seen = ibr_met < 1.0 && ibr_met > 0.0 ? ibr_seen : ibr_uv;
  vec2 ibr_at = clamp(ibr_seen, vec2(0.5), ibr_rect.zw - 0.5);
  float ibr_least = 0.5;
#ifdef GL_ARB_sample_shading
  // As of a mesh, only the samples inside the outline are drawn, shaded at their centroid.
  gl_SampleMask[0] = -1;
  if (gl_NumSamples > 1)
  {
    ivec2 ibr_sum = ivec2(0);
    int ibr_inside = 0;
    int ibr_mask = 0;
    int ibr_samples = min(gl_NumSamples, 8);
    for (int i = 0; i < ibr_samples; ++i)
    {
      ivec2 ibr_offset = IBR_SAMPLES[i + (ibr_samples > 4 ? 4 : 0)];
      vec2 ibr_to = ibr_seen + float(ibr_offset.x) * ibr_across + float(ibr_offset.y) * ibr_upward;
      ibr_to = ibr_rect.xy + clamp(ibr_to, vec2(0.5), ibr_rect.zw - 0.5);
      if (texture(ibr_albedo, ibr_to / vec2(textureSize(ibr_albedo, 0))).a >= 0.5)
      {
        ibr_mask |= 257 << i;
        ibr_sum += ibr_offset;
        ++ibr_inside;
      }
    }
    gl_SampleMask[0] = ibr_mask;
    vec2 ibr_centroid = vec2(ibr_sum) / float(max(ibr_inside, 1));
    ibr_at = ibr_seen + ibr_centroid.x * ibr_across + ibr_centroid.y * ibr_upward;
    ibr_at = clamp(ibr_at, vec2(0.5), ibr_rect.zw - 0.5);
    ibr_least = ibr_inside > 0 ? 0.02 : 2.0;
  }
#endif
  vec2 ibr_t = (ibr_rect.xy + ibr_at) / vec2(textureSize(ibr_albedo, 0));
  vec4 ibr_color = texture(ibr_albedo, ibr_t);
  if (ibr_color.a < ibr_least) { discard; }
  // Depths 0 and 1 are background: interpolate over covered texels only.
  ivec2 ibr_low = ivec2(ibr_rect.xy + ibr_at - 0.5);
  vec2 ibr_f = ibr_rect.xy + ibr_at - 0.5 - vec2(ibr_low);
  vec4 ibr_ds = vec4(texelFetch(ibr_depth, ibr_low, 0).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(1, 0)).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(0, 1)).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(1, 1)).r);
  vec4 ibr_w = vec4(1.0 - ibr_f.x, ibr_f.x, 1.0 - ibr_f.x, ibr_f.x)
    * vec4(1.0 - ibr_f.y, 1.0 - ibr_f.y, ibr_f.y, ibr_f.y) * (1.0 - step(1.0, ibr_ds))
    * sign(ibr_ds);
#if MATERIALS || CLEAR
  float ibr_largest = max(max(ibr_w.x, ibr_w.y), max(ibr_w.z, ibr_w.w));
  ivec2 ibr_covered = ibr_low + (ibr_w.x == ibr_largest ? ivec2(0)
    : ibr_w.y == ibr_largest ? ivec2(1, 0) : ibr_w.z == ibr_largest ? ivec2(0, 1) : ivec2(1));
#endif
#if CLEAR
  // The first layer of the same faces shows it already.
  float ibr_first = texelFetch(ibr_depth, ibr_covered - ivec2(0, int(ibr_layer.y)), 0).r;
  float ibr_last = texelFetch(ibr_depth, ibr_covered, 0).r;
  if (ibr_layer.y > 0.0 && abs(ibr_first - ibr_last) < 1e-5) { discard; }
#endif
  float ibr_d = dot(ibr_w, ibr_ds) / dot(ibr_w, vec4(1.0));
  vec4 ibr_s = texture(ibr_shape, ibr_t);
  vec3 ibr_normal = 2.0 * ibr_s.xyz - ibr_color.a;
  vec3 ibr_base_color = ibr_color.rgb / ibr_color.a;
  // The point at that distance from the image's eye that this pixel's ray meets.
  float ibr_share = (ibr_planes.z - ibr_distance(ibr_d)) / ibr_eye.z;
  vec3 ibr_card = vertexVCVSOutput.xyz;
  vec3 ibr_point = ibr_image_eye.w > 0.5 ? ibr_card + vec3(0.0, 0.0, ibr_share)
    : ibr_card * (1.0 - ibr_share);
  // The near plane cuts images as it cuts meshes.
  vec2 ibr_zw = vec2(ibr_clip_depth.x * ibr_point.z + ibr_clip_depth.y,
    ibr_clip_depth.z * ibr_point.z + ibr_clip_depth.w);
  if (ibr_zw.x > ibr_zw.y) { discard; }
  vec4 vertexVC = vec4(ibr_point, 1.0);
  bool ibr_is_lit = dot(ibr_normal, ibr_normal) > 0.04 * ibr_color.a * ibr_color.a;
  // The mean of normals that differ is shorter, so that it is as bright as the mean of their faces.
  float ibr_length = length(ibr_normal) / ibr_color.a;
  ibr_normal = ibr_eye_from_world * normalize(ibr_is_lit ? ibr_normal : vec3(0.0, 0.0, 1.0));
  ibr_normal *= ibr_is_lit ? min(ibr_length / 0.97, 1.0) : 1.0;
#if MATERIALS
  int ibr_number = int(texelFetch(ibr_shape, ibr_covered, 0).a * 255.0 + 0.5);
#else
  int ibr_number = 0;
#endif
  vec4 ibr_matter = texelFetch(ibr_materials, ivec2(ibr_number, 0), 0);
  vec3 ibr_shine = texelFetch(ibr_materials, ivec2(ibr_number, 1), 0).rgb;
  if (!ibr_is_lit) { ibr_matter = vec4(1.0, 0.0, 0.0, 1.0); }
#define IBR_PLACE ibr_point
#define IBR_NORMAL ibr_normal

//@fragment.depth
  gl_FragDepth = clamp(ibr_zw.x / ibr_zw.y * 0.5 + 0.5, 0.0, 1.0);

//@fragment.color
#if CLEAR
  opacity = ibr_layer.x;
#endif
  ambientColor = ibr_matter.x * ibr_base_color;
#if TINTED
  ambientColor += texture(ibr_tint, ibr_t).rgb / ibr_color.a;
#endif
  diffuseColor = ibr_matter.y * ibr_base_color;
  vec3 ibr_specular = ibr_matter.z * ibr_shine;
