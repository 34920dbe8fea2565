// Spheres, each on a card that holds it tightly; rays from the eye are met with it exactly.
// The vertex shader fetches a sphere and bounds its picture: by the tangents from the eye in
// x and in y (Mara and McGuire, "2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D
// Sphere", 2013). The fragment shader finds where the ray through the pixel's centre enters: from
// the foot of the perpendicular, not from the difference of two large squares (Haines et al.,
// "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019, chapter 7).
// Centres are relative to those of blocks, which come in eye space, subtracted in double precision.
// CORNERS is 4, or 1 for point sprites. DEPTH is 1 where each pixel has its own: then drivers light
// also what is hidden. The others, a few pixels large, are as deep as the mean of their front.
// ibr_first, the first slot of a draw, and ibr_end, the entry after its last, are an actor's custom
// uniforms: VTK declares them.

//@vertex.declare
uniform sampler2D ibr_items;      // centre less that of its block, world axes; radius
uniform sampler2D ibr_looks;      // rgb; 0 hidden, 0.5 the material's colour, 1 its own
uniform sampler2D ibr_blocks;     // of each entry: its centre, eye space; its number
uniform int ibr_count;
uniform int ibr_parallel;
uniform vec2 ibr_size;            // of the picture, pixels
uniform float ibr_pixel;          // a pixel in world units, in perspective at a distance of 1
uniform float ibr_near;
uniform vec4 ibr_ndc_from_slope;  // factors and offsets of x / -z and y / -z, or of x and y
uniform vec4 ibr_zw_from_z;       // factor and offset of clip z, of clip w
uniform mat3 ibr_eye_from_world;
flat out vec4 ibr_item;           // centre, eye space; radius, below 0 where it fills its pixel
flat out vec4 ibr_look;

// The slopes of the two tangents from the eye to a circle, in a plane through the view's axis.
vec2 ibr_tangents(vec2 c, float r)
{
  const float none = 1e9;
  float square = dot(c, c) - r * r;
  if (square <= 0.0) return vec2(-none, none);
  float s = sqrt(square);
  vec2 low = vec2(c.x * s + c.y * r, c.x * r - c.y * s);
  vec2 high = vec2(c.x * s - c.y * r, -c.x * r - c.y * s);
  return vec2(low.y > 0.0 ? low.x / low.y : -none, high.y > 0.0 ? high.x / high.y : none);
}

//@vertex.position
  {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside: an empty slot
#if CORNERS == 1
    gl_PointSize = 1.0;
#endif
    ibr_item = vec4(0.0);
    ibr_look = vec4(0.0);
    int slot = ibr_first + gl_VertexID / CORNERS;
    int entry = slot / BLOCK;
    bool live = entry < ibr_end;
    vec4 block = texelFetch(ibr_blocks, live ? ivec2(entry % 1024, entry / 1024) : ivec2(0), 0);
    int i = int(block.w) * BLOCK + slot % BLOCK;
    live = live && i < ibr_count;
    ivec2 at = live ? ivec2(i % 1024, i / 1024) : ivec2(0);
    vec4 item = texelFetch(ibr_items, at, 0);
    ibr_look = texelFetch(ibr_looks, at, 0);
    vec3 c = block.xyz + ibr_eye_from_world * item.xyz;
    live = live && item.w > 0.0 && ibr_look.a > 0.0 && c.z - item.w < -ibr_near;
    if (live)
    {
      // At least a pixel large: what is smaller would come and go as the eye moves.
      float r = max(item.w, 0.5 * ibr_pixel * (ibr_parallel == 1 ? 1.0 : max(-c.z, 0.0)));
      bool dot_sized = item.w < r;
      ibr_item = vec4(c, dot_sized ? -r : r);
      vec4 bounds = ibr_parallel == 1 ? c.xxyy + vec4(-r, r, -r, r)
        : vec4(ibr_tangents(c.xz, r), ibr_tangents(c.yz, r));
      bounds = bounds * ibr_ndc_from_slope.xxyy + ibr_ndc_from_slope.zzww;
      if (dot_sized)
      {
        vec2 pixel = floor((0.25 * (bounds.xz + bounds.yw) + 0.5) * ibr_size);
        bounds = vec4(pixel, pixel + 1.0).xzyw / ibr_size.xxyy * 2.0 - 1.0;
      }
#if CORNERS == 1
      vec2 zw = ibr_zw_from_z.xz * (c.z + 0.667 * item.w) + ibr_zw_from_z.yw;
      gl_Position = vec4(0.5 * (bounds.xz + bounds.yw), DEPTH == 1 ? 0.0 : zw.x / zw.y, 1.0);
      vec2 side = (bounds.yw - bounds.xz) * ibr_size * 0.5;
      gl_PointSize = dot_sized ? 1.0 : max(side.x, side.y) + 0.1;
#else
      if (!dot_sized) bounds += vec4(-0.1, 0.1, -0.1, 0.1) / ibr_size.xxyy;
      bounds = clamp(bounds, -1.1, 1.1);
      int corner = gl_VertexID % 4;
      vec2 unit = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
      gl_Position = vec4(mix(bounds.xz, bounds.yw, unit), 0.0, 1.0);
#endif
    }
  }

//@fragment.declare
uniform int ibr_parallel;
uniform float ibr_near;
uniform vec4 ibr_slope_from_pixel; // factors and offsets of gl_FragCoord.xy
uniform vec4 ibr_zw_from_z;
flat in vec4 ibr_item;
flat in vec4 ibr_look;

//@fragment.meet
  vec2 ibr_slope = gl_FragCoord.xy * ibr_slope_from_pixel.xy + ibr_slope_from_pixel.zw;
  vec3 ibr_from = ibr_parallel == 1 ? vec3(ibr_slope, 0.0) : vec3(0.0);
  vec3 ibr_ray = ibr_parallel == 1 ? vec3(0.0, 0.0, -1.0) : vec3(ibr_slope, -1.0);
  vec3 ibr_away = ibr_item.xyz - ibr_from;
  float ibr_inverse = 1.0 / dot(ibr_ray, ibr_ray);
  float ibr_along = dot(ibr_away, ibr_ray) * ibr_inverse;
  vec3 ibr_off = ibr_along * ibr_ray - ibr_away; // from the centre to the foot
  float ibr_square = ibr_item.w * ibr_item.w - dot(ibr_off, ibr_off);
  float ibr_half = sqrt(max(ibr_square * ibr_inverse, 0.0));
  vec3 ibr_normal = normalize(ibr_off - ibr_half * ibr_ray);
#if CORNERS == 1
  ibr_along -= ibr_half; // no plane cuts point sprites
#else
  // What the near plane cut open shows its inside.
  bool ibr_cut = ibr_along - ibr_half < ibr_near;
  if (ibr_cut) ibr_normal = -normalize(ibr_off + ibr_half * ibr_ray);
  ibr_along += ibr_cut ? ibr_half : -ibr_half;
#endif
  vec4 vertexVC = vec4(ibr_from + ibr_along * ibr_ray, 1.0);
  // For features that ask where the surface is.
#define IBR_PLACE vertexVC.xyz
#define IBR_NORMAL ibr_normal

//@fragment.cut
  if (ibr_square < 0.0 && ibr_item.w > 0.0) discard;

//@fragment.depth
  {
    vec2 zw = ibr_zw_from_z.xz * vertexVC.z + ibr_zw_from_z.yw;
    float depth = zw.x / zw.y * 0.5 + 0.5;
#if CORNERS == 4
    if (ibr_along < ibr_near || depth > 1.0) discard;
#endif
    gl_FragDepth = depth;
  }

//@fragment.color
  if (ibr_look.a > 0.75)
  {
    diffuseColor = diffuseIntensity * ibr_look.rgb;
    ambientColor = ambientIntensity * ibr_look.rgb;
  }
