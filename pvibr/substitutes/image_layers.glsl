// Coherent layers: images of parts of the scene, shown again by other cameras.
// The card warps an image to the current view and writes the current depth of each pixel's surface
// point, so that layers occlude each other and the rest of the scene.
// Source: Lengyel and Snyder, "Rendering with Coherent Layers", SIGGRAPH 1997.
// Spaces: uv = the image, 0 to 1; clip = VTK's DC times w, of the current camera.

//@vertex.declare
uniform mat3 ibr_clip_from_uv;    // x, y and w
uniform mat4 ibr_depth_from_uv;   // rows z and w, from (u, v, depth, 1); the others are 0
uniform vec4 ibr_crop;            // part of the image that shows anything
out vec2 ibr_uv;
out vec2 ibr_zw;                  // clip z and w at depth 0
flat out vec2 ibr_zw_step;        // and their change per unit of depth
out vec3 ibr_at;                  // clip x, y and w

//@vertex.position
  {
    int corner = gl_VertexID % 4;
    vec2 q = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
    ibr_uv = mix(ibr_crop.xy, ibr_crop.zw, q);
    vec3 place = ibr_clip_from_uv * vec3(ibr_uv, 1.0);
    ibr_zw = (ibr_depth_from_uv * vec4(ibr_uv, 0.0, 1.0)).xy;
    ibr_zw_step = ibr_depth_from_uv[2].xy;
    ibr_at = place;
    gl_Position = vec4(place.xy, 0.0, place.z);
  }

//@fragment.declare
uniform sampler2D ibr_picture;    // colour times coverage, coverage
uniform sampler2D ibr_deep;       // depth of the image's own camera
uniform vec3 ibr_part;            // coverages from, to; opacity: below 0 the coverage
uniform vec4 ibr_eye_from_clip;   // eye x and y over clip x and y; eye z from clip z, w
uniform vec4 ibr_eye_shift;       // offsets of x and y; constants of eye z
uniform int ibr_is_parallel;
in vec2 ibr_uv;
in vec2 ibr_zw;
flat in vec2 ibr_zw_step;
in vec3 ibr_at;

//@fragment.sample
  vec4 ibr_color = texture(ibr_picture, ibr_uv);
  if (ibr_color.a < ibr_part.x || ibr_color.a >= ibr_part.y) { discard; }
  float ibr_d = texture(ibr_deep, ibr_uv).r;
  vec2 ibr_depth_zw = ibr_zw + ibr_d * ibr_zw_step;
  float ibr_z = ibr_depth_zw.x / ibr_depth_zw.y;
  // The compiler drops position and normal unless features or passes read them.
  float ibr_along = ibr_is_parallel == 1 ? ibr_z * ibr_eye_from_clip.z + ibr_eye_shift.z
    : ibr_eye_from_clip.w / (ibr_z + ibr_eye_shift.w);
  vec3 ibr_place = vec3((ibr_at.xy / ibr_at.z + ibr_eye_shift.xy) * ibr_eye_from_clip.xy
    * (ibr_is_parallel == 1 ? 1.0 : -ibr_along), ibr_along);
  vec4 vertexVC = vec4(ibr_place, 1.0);
#define IBR_PLACE ibr_place
#define IBR_NORMAL ibr_normal

//@fragment.normal
  vec3 ibr_normal = normalize(cross(dFdx(ibr_place), dFdy(ibr_place)));
  vec3 normalVCVSOutput = ibr_normal;

//@fragment.depth
  gl_FragDepth = clamp(ibr_z * 0.5 + 0.5, 0.0, 1.0);

//@fragment.light
  gl_FragData[0] = vec4(ibr_color.rgb / ibr_color.a, ibr_part.z < 0.0 ? ibr_color.a : ibr_part.z);

//@range
// Least and greatest depth of each block of an image, 2 and -1 if empty.
uniform sampler2D deep;
uniform int side;                 // texels along a side of a block
void main()
{
  ivec2 low = ivec2(gl_FragCoord.xy) * side;
  ivec2 high = min(low + side, textureSize(deep, 0));
  vec2 found = vec2(2.0, -1.0);
  for (int j = low.y; j < high.y; ++j)
    for (int i = low.x; i < high.x; ++i)
    {
      float d = texelFetch(deep, ivec2(i, j), 0).r;
      if (d < 1.0) { found = vec2(min(found.x, d), max(found.y, d)); }
    }
  gl_FragData[0] = vec4(found, 0.0, 1.0);
}

//@spread
// Depth for linear filters: extended by a texel beyond the covered ones, not 1 there.
uniform sampler2D deep;
void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy), end = textureSize(deep, 0) - 1;
  float own = texelFetch(deep, at, 0).r;
  vec2 found = vec2(0.0);
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i)
    {
      float d = texelFetch(deep, clamp(at + ivec2(i, j), ivec2(0), end), 0).r;
      found += d < 1.0 ? vec2(d, 1.0) : vec2(0.0);
    }
  gl_FragData[0] = vec4(own < 1.0 || found.y == 0.0 ? own : found.x / found.y);
}

//@soften
// A Gaussian along one axis of colour times coverage, and of depth times coverage. Its weights
// come from each other: Turkowski, "Incremental Computation of the Gaussian", GPU Gems 3, 2007.
uniform sampler2D picture;
uniform sampler2D deep;           // depth; in the second pass depth times coverage, and coverage
uniform vec2 axis;                // a texel
uniform float sigma;              // texels
uniform int last;                 // 1 in the second pass: divide by coverage
void main()
{
  vec4 sum = vec4(0.0);
  vec2 depth = vec2(0.0);
  float total = 0.0;
  float weight = 1.0, step = exp(-0.5 / (sigma * sigma)), faster = step * step;
  int reach = int(ceil(3.0 * sigma));
  for (int k = 0; k <= reach; ++k)
  {
    for (int side = k == 0 ? 1 : -1; side <= 1; side += 2)
    {
      vec2 at = uv + float(side * k) * axis;
      vec4 color = texture(picture, at);
      vec2 d = texture(deep, at).rg;
      sum += weight * color;
      depth += weight * (last == 1 ? d : vec2(d.r, 1.0) * color.a);
      total += weight;
    }
    weight *= step;
    step *= faster;
  }
  gl_FragData[0] = sum / total;
  gl_FragData[1] = vec4(last == 1 ? vec2(depth.r / max(depth.g, 1e-30)) : depth / total, 0.0, 1.0);
}
