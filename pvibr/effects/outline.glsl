// Outlines: two passes. The first finds boundaries between a pixel and those to its right and
// above it, by number, depth and normal, and pixels where luminance changes; the second draws what
// is within half a line's width of a boundary.
// Luminance: Sobel's operator with the weights of ITU-R BT.601. Depth: window depth is affine on
// every plane in either projection, so what its second difference leaves is no slope, however
// grazing, but a jump. Units: pixels; normals in view space.

//@edges
uniform sampler2D surface;   // normal and number, see pvibr/buffers.py
uniform vec2 corner;         // of the picture, in its texels
uniform sampler2D depth;     // of the surfaces
uniform sampler2D scene;     // of the scene
uniform sampler2D color;
uniform int surfaces;        // whether there are surfaces to look at
uniform int by_id;
uniform float jump;          // pixels; 0 for none
uniform float crease;        // cosine; below -1 for none
uniform float grazing;       // cosine
uniform float contrast;      // least step of luminance; 0 for none
uniform int dashed;
uniform vec3 pixel;          // world units per pixel: constant, per distance; 1 if parallel
uniform vec2 planes;
uniform vec4 lens;           // tangents of half the angles of view, and the middle's offset

// Distance along the view.
float away(float d)
{
  return pixel.z > 0.5 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
}

// World units that depth d is behind depth e, in pixels there.
float behind(float d, float e)
{
  float z = away(d);
  return (z - away(e)) / (pixel.x + pixel.y * z);
}

// Cosine between normal and line of sight, times its length at distance 1.
float steep(ivec2 p, vec3 n)
{
  vec2 ndc = 2.0 * (vec2(p) + 0.5) / vec2(textureSize(color, 0)) - 1.0;
  return max(n.z - dot(n.xy, (ndc + lens.zw) * lens.xy), 0.02);
}

// Normal, 0 for none, and number, 0 for nothing.
vec4 surfel(ivec2 p)
{
  vec4 t = texelFetch(surface, p + ivec2(corner), 0);
  if (t.a < 0.5) return vec4(0.0);
  float z = sqrt(max(1.0 - dot(t.xy, t.xy), 0.0));
  return vec4(t.x > 1.5 ? vec3(0.0) : vec3(t.xy, t.z < 0.0 ? -z : z), abs(t.z));
}

float bright(ivec2 p)
{
  return dot(texelFetch(color, p, 0).rgb, vec3(0.299, 0.587, 0.114));
}

// A boundary between p and p + s: 0 for none, 0.5 where it is hidden, 1.
float boundary(ivec2 p, ivec2 s, vec4 n, float d)
{
  ivec2 size = textureSize(color, 0);
  ivec2 q = p + s;
  if (q.x >= size.x || q.y >= size.y) return 0.0;
  vec4 m = surfel(q);
  bool nothing = n.a < 0.5, beyond = m.a < 0.5;
  if (nothing && beyond) return 0.0;
  float e = texelFetch(depth, q, 0).r;
  bool found = nothing != beyond ? by_id == 1 || jump > 0.0 : by_id == 1 && n.a != m.a;
  if (!found && !nothing && !beyond)
  {
    bool shaded = dot(n.xyz, n.xyz) > 0.5 && dot(m.xyz, m.xyz) > 0.5;
    if (shaded && min(abs(n.z), abs(m.z)) > grazing) found = dot(n.xyz, m.xyz) < crease;
    if (!found && jump > 0.0)
    {
      ivec2 before = max(p - s, ivec2(0)), after = min(q + s, size - 1);
      float b = texelFetch(depth, before, 0).r, a = texelFetch(depth, after, 0).r;
      float second = min(abs(e - 2.0 * d + b), abs(d - 2.0 * e + a));
      float farther = max(d, e);
      // A crease bends depth by the difference of slopes, pixels per pixel, and no more.
      float bend = abs(dot(vec2(s), n.xy / steep(p, n.xyz) - m.xy / steep(q, m.xyz)));
      float least = jump + (shaded ? min(bend, 40.0) : 0.0);
      found = behind(farther, farther - second) > least && second > 4e-7;
    }
  }
  if (!found) return 0.0;
  // The nearer one has the line; it is seen where the scene is not before it.
  bool mine = beyond || (!nothing && d <= e);
  float own = mine ? d : e, seen = texelFetch(scene, mine ? p : q, 0).r;
  float slope = 1.0 + 1.0 / max(abs(mine ? n.z : m.z), 0.05);
  if (behind(own, seen) <= slope || abs(own - seen) < 4e-7) return 1.0;
  return dashed == 1 ? 0.5 : 0.0;
}

float luminance(ivec2 p)
{
  ivec2 last = textureSize(color, 0) - 1;
  float s[9];
  for (int k = 0; k < 9; ++k) s[k] = bright(clamp(p + ivec2(k % 3, k / 3) - 1, ivec2(0), last));
  vec2 gradient = vec2(s[2] + 2.0 * s[5] + s[8] - s[0] - 2.0 * s[3] - s[6],
                       s[6] + 2.0 * s[7] + s[8] - s[0] - 2.0 * s[1] - s[2]);
  return length(gradient) / 4.0 > contrast ? 1.0 : 0.0;
}

void main()
{
  ivec2 p = ivec2(uv * vec2(textureSize(color, 0)));
  vec3 found = vec3(0.0);
  if (surfaces == 1)
  {
    vec4 n = surfel(p);
    float d = texelFetch(depth, p, 0).r;
    found.xy = vec2(boundary(p, ivec2(1, 0), n, d), boundary(p, ivec2(0, 1), n, d));
  }
  if (contrast > 0.0) found.z = luminance(p);
  gl_FragData[0] = vec4(found, 1.0);
}

//@tiles
// Whether there is anything in each square of SIDE pixels.
uniform sampler2D edges;
uniform vec2 tiles;
void main()
{
  ivec2 first = ivec2(uv * tiles) * SIDE, last = textureSize(edges, 0) - 1;
  vec3 found = vec3(0.0);
  for (int j = 0; j < SIDE; ++j)
    for (int i = 0; i < SIDE; ++i)
      found = max(found, texelFetch(edges, min(first + ivec2(i, j), last), 0).rgb);
  gl_FragData[0] = vec4(found, 1.0);
}

//@lines
uniform sampler2D edges;
uniform sampler2D squares;   // of SIDE pixels: whether there is anything in them
uniform sampler2D color;
uniform float width;
uniform float dash;
uniform vec4 ink;

// How much a line of that width covers of a pixel whose middle is so far off.
float covered(float d)
{
  return clamp(0.5 * width + 0.5 - d, 0.0, 1.0);
}

void main()
{
  ivec2 p = ivec2(uv * vec2(textureSize(edges, 0))), last = textureSize(edges, 0) - 1;
  bool drawn = fract((gl_FragCoord.x + gl_FragCoord.y) / (2.0 * dash)) < 0.5;
  float least = drawn ? 0.25 : 0.75;
  float near = 1e6;
  // As far as a line reaches there are no more than two squares along an axis.
  ivec2 low = max(p - REACH, ivec2(0)) / SIDE, high = min(p + REACH, last) / SIDE;
  vec3 any = texelFetch(squares, low, 0).rgb + texelFetch(squares, high, 0).rgb
    + texelFetch(squares, ivec2(low.x, high.y), 0).rgb
    + texelFetch(squares, ivec2(high.x, low.y), 0).rgb;
  if (any != vec3(0.0))
  for (int j = -REACH; j <= REACH; ++j)
    for (int i = -REACH; i <= REACH; ++i)
    {
      ivec2 q = p + ivec2(i, j);
      if (q != clamp(q, ivec2(0), last)) continue;
      vec3 found = texelFetch(edges, q, 0).rgb;
      if (found == vec3(0.0)) continue;
      // To the middles of the boundary's steps: on lines aslant their corners are off the line.
      vec2 o = vec2(i, j);
      if (found.r > least) near = min(near, length(o + vec2(0.5, 0.0)));
      if (found.g > least) near = min(near, length(o + vec2(0.0, 0.5)));
      if (found.b > least) near = min(near, 0.5 + length(o));
    }
  vec4 c = texelFetch(color, p, 0);
  float cover = ink.a * covered(near);
  // Where a line covers all, whatever is below does not matter, not even NaN.
  if (cover >= 1.0) c = vec4(ink.rgb, 1.0);
  else if (cover > 0.0) c = vec4(mix(c.rgb, ink.rgb, cover), cover + c.a * (1.0 - cover));
  gl_FragData[0] = c;
}
