// Impostors: one quad for each image in a pool of tiles, with depth.
// The vertex shader places the card where its image was rendered from; the fragment shader
// reconstructs the surface point that the texel shows, hands its colour, normal and material to
// VTK's lighting and writes its depth, so that cards intersect as their meshes do.
// Sources: Schaufler, "Dynamically Generated Impostors", GI Workshop 1995; "Nailboards: A
// Rendering Primitive for Image Caching in Dynamic Scenes", EGWR 1997.
// Spaces: eye = VTK's VC. A card has 5 texels of ibr_cards, see Images.card_rows.
// Defines: MATERIALS, 1 if there are several.

//@vertex.declare
uniform sampler2D ibr_cards;
uniform int ibr_count;
uniform mat4 ibr_clip_from_eye;
flat out vec4 ibr_rect;      // corner in the pool, sides, texels
flat out vec4 ibr_image_eye;      // eye of the image, or view direction; w 1 if parallel
flat out vec3 ibr_planes;    // distances of near plane, far plane and card from that eye
out vec2 ibr_uv;             // texels from the corner
out vec4 vertexVCVSOutput;

//@vertex.position
  {
    int card = gl_VertexID / 4;
    int corner = gl_VertexID % 4;
    bool live = card < ibr_count;
    ivec2 at = live ? ivec2(card % 128 * 5, card / 128) : ivec2(0);
    vec4 origin = texelFetch(ibr_cards, at, 0);
    vec4 right = texelFetch(ibr_cards, at + ivec2(1, 0), 0);
    vec4 up = texelFetch(ibr_cards, at + ivec2(2, 0), 0);
    ibr_image_eye = texelFetch(ibr_cards, at + ivec2(3, 0), 0);
    ibr_rect = texelFetch(ibr_cards, at + ivec2(4, 0), 0);
    ibr_planes = vec3(right.w, up.w, origin.w);
    vec2 q = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
    ibr_uv = q * ibr_rect.zw;
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
uniform sampler2D ibr_materials;
uniform mat3 ibr_eye_from_world;
uniform vec4 ibr_clip_depth;     // rows z and w of clip from eye, z columns: zz, zw, wz, ww
flat in vec4 ibr_rect;
flat in vec4 ibr_image_eye;
flat in vec3 ibr_planes;
in vec2 ibr_uv;
in vec4 vertexVCVSOutput;

//@fragment.sample
  vec2 ibr_at = clamp(ibr_uv, vec2(0.5), ibr_rect.zw - 0.5);
  vec2 ibr_t = (ibr_rect.xy + ibr_at) / vec2(textureSize(ibr_albedo, 0));
  vec4 ibr_color = texture(ibr_albedo, ibr_t);
  if (ibr_color.a < 0.5) { discard; }
  // Depth 1 is background: interpolate over covered texels only.
  ivec2 ibr_low = ivec2(ibr_rect.xy + ibr_at - 0.5);
  vec2 ibr_f = ibr_rect.xy + ibr_at - 0.5 - vec2(ibr_low);
  vec4 ibr_ds = vec4(texelFetch(ibr_depth, ibr_low, 0).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(1, 0)).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(0, 1)).r,
    texelFetchOffset(ibr_depth, ibr_low, 0, ivec2(1, 1)).r);
  vec4 ibr_w = vec4(1.0 - ibr_f.x, ibr_f.x, 1.0 - ibr_f.x, ibr_f.x)
    * vec4(1.0 - ibr_f.y, 1.0 - ibr_f.y, ibr_f.y, ibr_f.y) * (1.0 - step(1.0, ibr_ds));
#if MATERIALS
  float ibr_largest = max(max(ibr_w.x, ibr_w.y), max(ibr_w.z, ibr_w.w));
  ivec2 ibr_covered = ibr_low + (ibr_w.x == ibr_largest ? ivec2(0)
    : ibr_w.y == ibr_largest ? ivec2(1, 0) : ibr_w.z == ibr_largest ? ivec2(0, 1) : ivec2(1));
#endif
  float ibr_d = dot(ibr_w, ibr_ds) / dot(ibr_w, vec4(1.0));
  vec4 ibr_s = texture(ibr_shape, ibr_t);
  vec3 ibr_normal = 2.0 * ibr_s.xyz - ibr_color.a;
  vec3 ibr_base_color = ibr_color.rgb / ibr_color.a;
  float ibr_near = ibr_planes.x;
  float ibr_far = ibr_planes.y;
  vec3 ibr_point = vertexVCVSOutput.xyz;
  if (ibr_image_eye.w > 0.5)
  {
    ibr_point += ibr_image_eye.xyz * (mix(ibr_near, ibr_far, ibr_d) - ibr_planes.z);
  }
  else
  {
    float ibr_along = ibr_near * ibr_far / (ibr_far - ibr_d * (ibr_far - ibr_near));
    ibr_point = ibr_image_eye.xyz + (ibr_point - ibr_image_eye.xyz) * (ibr_along / ibr_planes.z);
  }
  // The near plane cuts images as it cuts meshes.
  vec2 ibr_zw = vec2(ibr_clip_depth.x * ibr_point.z + ibr_clip_depth.y,
    ibr_clip_depth.z * ibr_point.z + ibr_clip_depth.w);
  if (ibr_zw.x > ibr_zw.y) { discard; }
  vec4 vertexVC = vec4(ibr_point, 1.0);
  bool ibr_is_lit = dot(ibr_normal, ibr_normal) > 0.04 * ibr_color.a * ibr_color.a;
  ibr_normal = ibr_eye_from_world * normalize(ibr_is_lit ? ibr_normal : vec3(0.0, 0.0, 1.0));
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
  ambientColor = ibr_matter.x * ibr_base_color;
  diffuseColor = ibr_matter.y * ibr_base_color;
  vec3 ibr_specular = ibr_matter.z * ibr_shine;
