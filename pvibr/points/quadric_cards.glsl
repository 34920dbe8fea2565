// Spheres, ellipsoids and cylinders, each ray-cast exactly on a tight card. spheres.glsl,
// ellipsoids.glsl and cylinders.glsl define for their shape:
//   vec3 ibr_offset(int i)                           vertex: its middle relative to its block's
//   bool ibr_place(int i, vec3 c, out IbrCard card)  vertex: its card; c its middle, eye space;
//     false if not drawn
//   void ibr_meet(vec3 from, vec3 ray, out vec2 t, out bvec2 hits, out vec3 enters, out vec3 leaves)
//     fragment: where a ray enters and leaves it, and the outward normals there
//   vec4 ibr_painted(vec3 place)                     fragment: its look at a point
// Intersections start from the foot of the perpendicular, which avoids cancellation (Haines et al.,
// "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019, chapter 7). Middles
// are relative to those of blocks, which come in eye space, subtracted in double precision.
// Defines: RESIDUALS, 1 if entries may have a second texel, computed in double precision for giants
// beside the eye: the residual of the equation at the eye, the heights of both ends, and whether to
// use them; the first texel then has the item's own middle. CORNERS, 4 or 1 for point sprites.
// DEPTH, 1 if each pixel has its own depth, which disables early depth tests; small items have the
// mean depth of their front. HIDES, 1 in the depth prepass, which covers no more pixels, and none
// nearer, than the item does.
// ibr_first, a draw's first slot, and ibr_end, the entry after its last, are custom uniforms of the
// actor, declared by VTK.

//@vertex.declare
uniform sampler2D ibr_items;      // TEXELS per item
uniform sampler2D ibr_looks;      // LOOKS per item; alpha as _OPAQUE in quadrics.py says
uniform sampler2D ibr_entries;    // middle of the block, eye space; its number
uniform int ibr_count;
uniform int ibr_unit;             // items per entry
uniform int ibr_parallel;
uniform vec2 ibr_size;            // of the target, pixels
uniform float ibr_margin;         // pixels: a half if multisampled
uniform float ibr_pixel;          // a pixel in world units, in perspective at a distance of 1
uniform float ibr_near;
uniform vec4 ibr_ndc_from_slope;  // factors and offsets of x / -z and y / -z, or of x and y
uniform float ibr_shear;          // x of the picture over y, of a camera with skew
uniform vec4 ibr_zw_from_z;       // factor and offset of clip z, of clip w
uniform mat3 ibr_eye_from_world;
flat out vec4 ibr_look;           // alpha negated if the item is drawn as a whole pixel
#if RESIDUALS == 1
uniform int ibr_stride;           // texels per entry
flat out vec4 ibr_residual;
#else
const int ibr_stride = 1;
#endif

const float ibr_none = 1e9;

struct IbrCard
{
  vec4 bounds;     // low and high along `way`, and across it; slopes, or x and y if parallel
  vec2 way;        // of length 1; (1, 0) for point sprites
  float front;     // z of all pixels if DEPTH is 0
  float back;      // the least z
  bool dot_sized;  // smaller than a pixel
};

vec4 ibr_fetched(sampler2D rows, int at)
{
  return texelFetch(rows, ivec2(at % 1024, at / 1024), 0);
}

// Half the size of a pixel at a depth: smaller items would flicker.
float ibr_half_pixel(float z)
{
  return 0.5 * ibr_pixel * (ibr_parallel == 1 ? 1.0 : max(-z, 0.0));
}

// The slopes of the two tangents from the eye to a circle, in a plane through the view's axis
// (Mara and McGuire, "2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere", 2013).
vec2 ibr_tangents(vec2 c, float r)
{
  float square = dot(c, c) - r * r;
  if (square <= 0.0) return vec2(-ibr_none, ibr_none);
  float s = sqrt(square);
  vec2 low = vec2(c.x * s + c.y * r, c.x * r - c.y * s);
  vec2 high = vec2(c.x * s - c.y * r, -c.x * r - c.y * s);
  return vec2(low.y > 0.0 ? low.x / low.y : -ibr_none,
    high.y > 0.0 ? high.x / high.y : ibr_none);
}

// Extent of a projected sphere along a direction.
vec2 ibr_span(vec3 c, float r, vec2 way)
{
  float x = dot(c.xy, way);
  return ibr_parallel == 1 ? vec2(x - r, x + r) : ibr_tangents(vec2(x, c.z), r);
}

vec2 ibr_ndc(vec2 p, vec2 way)
{
  vec2 slope = p.x * way + p.y * vec2(-way.y, way.x);
  slope.x += ibr_shear * slope.y;
  return slope * ibr_ndc_from_slope.xy + ibr_ndc_from_slope.zw;
}

//@vertex.position
  {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside the clip volume: an empty slot
#if CORNERS == 1
    gl_PointSize = 1.0;
#endif
    int slot = ibr_first + gl_VertexID / CORNERS;
    int entry = slot / ibr_unit;
    bool live = entry < ibr_end;
    entry = (live ? entry : 0) * ibr_stride;
    vec4 block = ibr_fetched(ibr_entries, entry);
#if RESIDUALS == 1
    ibr_residual = ibr_stride == 2 ? ibr_fetched(ibr_entries, entry + 1) : vec4(0.0);
#endif
    int i = int(block.w) * ibr_unit + slot % ibr_unit;
    live = live && i < ibr_count;
    i = live ? i : 0;
    ibr_look = ibr_fetched(ibr_looks, i * LOOKS);
    IbrCard card;
    vec3 c = block.xyz + (ibr_stride == 2 ? vec3(0.0) : ibr_eye_from_world * ibr_offset(i));
    if (ibr_place(i, c, card) && live && ibr_look.a > 0.0)
    {
      if (card.dot_sized) ibr_look.a = -ibr_look.a;
#if RESIDUALS == 1
      if (ibr_residual.w > 0.0) card.bounds = vec4(-ibr_none, ibr_none, -ibr_none, ibr_none);
#endif
      vec2 middle = ibr_ndc(0.5 * (card.bounds.xz + card.bounds.yw), card.way);
      vec2 pixel = floor((0.5 * middle + 0.5) * ibr_size);
      vec2 zw = ibr_zw_from_z.xz * (HIDES == 1 ? card.back : card.front) + ibr_zw_from_z.yw;
      float z = DEPTH == 1 ? 0.0 : zw.x / zw.y;
#if CORNERS == 1
      if (card.dot_sized) middle = (pixel + 0.5) / ibr_size * 2.0 - 1.0;
      gl_Position = vec4(middle, z, 1.0);
      vec2 side = (card.bounds.yw - card.bounds.xz) * ibr_ndc_from_slope.xy * ibr_size * 0.5;
      gl_PointSize = card.dot_sized ? 1.0 : max(side.x, side.y) + (HIDES == 1 ? -0.9 : 0.1 + 2.0 * ibr_margin);
#else
      int corner = gl_VertexID % 4;
      vec2 unit = vec2(corner == 1 || corner == 2 ? 1.0 : 0.0, corner >= 2 ? 1.0 : 0.0);
      // With a margin, and clamped to a little beyond the screen.
      vec2 scale = 1.0 / ibr_ndc_from_slope.xy, across = vec2(-card.way.y, card.way.x);
      float wide = HIDES == 1 ? -0.9 : 0.1 + 2.0 * ibr_margin * (abs(card.way.x) + abs(card.way.y));
      vec2 margin = vec2(-wide, wide) * max(scale.x / ibr_size.x, scale.y / ibr_size.y);
      vec2 centre = -ibr_ndc_from_slope.zw * scale;
      centre.x -= ibr_shear * centre.y;
      scale.x += abs(ibr_shear) * scale.y;
      vec2 reach = 1.1 * vec2(dot(abs(card.way), scale), dot(abs(across), scale));
      centre = vec2(dot(centre, card.way), dot(centre, across));
      vec4 bounds = clamp(card.bounds + margin.xyxy,
        (centre - reach).xxyy, (centre + reach).xxyy);
      vec2 at = ibr_ndc(mix(bounds.xz, bounds.yw, unit), card.way);
      if (card.dot_sized) at = (pixel + unit) / ibr_size * 2.0 - 1.0;
      gl_Position = vec4(at, z, 1.0);
#endif
    }
  }

//@fragment.declare
uniform vec3 ibr_eye;              // origin of rays in VTK's eye space: not 0 in stereo
uniform int ibr_parallel;
uniform float ibr_near;
uniform float ibr_shear;
uniform vec4 ibr_slope_from_pixel; // factors and offsets of gl_FragCoord.xy
uniform vec4 ibr_zw_from_z;
flat in vec4 ibr_look;
#if RESIDUALS == 1
flat in vec4 ibr_residual;
#else
const vec4 ibr_residual = vec4(0.0);
#endif

// The roots of a t^2 - 2 b t + q in order, without cancellation (Press et al., "Numerical Recipes",
// 2007, section 5.6), and the discriminant, negative if there are none.
vec3 ibr_roots(float a, float b, float q)
{
  float square = b * b - a * q, root = sqrt(max(square, 0.0));
  float sum = b < 0.0 ? b - root : b + root;
  vec2 t = vec2(sum / a, sum == 0.0 ? 0.0 : q / sum);
  return vec3(min(t.x, t.y), max(t.x, t.y), square);
}

//@fragment.meet
  vec2 ibr_slope = gl_FragCoord.xy * ibr_slope_from_pixel.xy + ibr_slope_from_pixel.zw;
  ibr_slope.x -= ibr_shear * ibr_slope.y;
  vec3 ibr_from = ibr_parallel == 1 ? vec3(ibr_slope, 0.0) : vec3(0.0);
  vec3 ibr_ray = ibr_parallel == 1 ? vec3(0.0, 0.0, -1.0) : vec3(ibr_slope, -1.0);
  vec2 ibr_t;
  bvec2 ibr_hits;
  vec3 ibr_normal, ibr_leaves;
  ibr_meet(ibr_from, ibr_ray, ibr_t, ibr_hits, ibr_normal, ibr_leaves);
  float ibr_along = ibr_t.x;
  bool ibr_met = ibr_hits.x;
#if INSIDES == 1
  // Items cut open by the near plane or clipping planes, and open cylinders, show their inside.
  bool ibr_front = ibr_hits.x && ibr_t.x >= ibr_near;
#if CLIPS == 1
  ibr_front = ibr_front && ibr_kept(ibr_eye + ibr_from + ibr_t.x * ibr_ray);
#endif
  if (ibr_hits.y && !ibr_front)
  {
    ibr_along = ibr_t.y;
    ibr_normal = -ibr_leaves;
    ibr_met = true;
  }
#endif
  vec4 vertexVC = vec4(ibr_eye + ibr_from + ibr_along * ibr_ray, 1.0);
#if CLIPS == 1
  if (!ibr_kept(vertexVC.xyz)) discard;
#endif
  // For features that need the surface point.
#define IBR_PLACE vertexVC.xyz
#define IBR_NORMAL ibr_normal

//@fragment.cut
  if (!ibr_met && ibr_look.a > 0.0) discard;
#if HIDES == 1 && CORNERS == 4
  if (ibr_along < ibr_near) discard;
#endif

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
  {
    vec4 seen = ibr_painted(vertexVC.xyz);
    float code = abs(seen.a) * 255.0;
    bool own = code > 127.5;
    if (own)
    {
      diffuseColor = diffuseIntensity * seen.rgb;
      ambientColor = ambientIntensity * seen.rgb;
    }
    opacity = opacityUniform * (own ? code - 128.0 : code) / 127.0;
  }
