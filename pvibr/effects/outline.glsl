// Outlines: two passes at half size and one over the picture. `candidates` marks blocks of 2 x 2
// pixels that may have a boundary, by number, depth or normal, and pixels where luminance changes;
// `edges` finds the boundaries in marked blocks, between a pixel and those to its right and above;
// `lines` draws whatever is within half a line's width of a boundary.
// Luminance: Sobel's operator with the weights of ITU-R BT.601. Depth: window depth is affine on
// every plane in either projection, so its second difference is zero on slopes, however grazing,
// and not at jumps. Units: pixels; normals in view space.

//@surfaces
// Shared by the two programs that read surfaces.
uniform sampler2D surface;   // normal and number, see pvibr/things/buffers.py
uniform vec2 corner;         // of the picture in `surface`, texels
uniform sampler2D depth;     // of the surfaces
uniform sampler2D scene;     // depth of the whole scene
uniform sampler2D color;
uniform sampler2D chosen;    // by number: whether it has lines
uniform int only_chosen;     // whether only chosen objects have lines
uniform int by_id;
uniform float jump;          // pixels; 0 for none
uniform float crease;        // cosine; below -1 for none
uniform float grazing;       // cosine
uniform float contrast;      // least step of luminance; 0 for none
uniform int dashed;
uniform vec3 pixel;          // world units per pixel: constant, per distance; 1 if parallel
uniform vec2 planes;
uniform vec4 lens;           // tangents of half the angles of view, and the middle's offset

ivec2 last;                  // pixel of the picture

// View distance of a depth.
float away(float d)
{
  return pixel.z > 0.5 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
}

// How far depth d is behind depth e, in sizes of a pixel there.
float behind(float d, float e)
{
  float z = away(d);
  return (z - away(e)) / (pixel.x + pixel.y * z);
}

// Cosine between normal and line of sight, times the latter's length at distance 1.
float steep(ivec2 p, vec3 n)
{
  vec2 ndc = 2.0 * (vec2(p) + 0.5) / vec2(last + 1) - 1.0;
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

float depth_at(ivec2 p)
{
  return texelFetch(depth, p, 0).r;
}

bool has_lines(float number)
{
  int k = int(number), wide = textureSize(chosen, 0).x;
  return texelFetch(chosen, ivec2(k % wide, k / wide), 0).r > 0.5;
}


//@candidates
// Marks what `edges` examines. SURFACES, LUMINANCE: the kinds of edges.
// Whether there may be a boundary within 2 x 2 pixels, or to those right of and above them.
bool candidate(ivec2 p)
{
  vec3 n[8];
  float number[8];
  bool same = true, any = false;
  for (int k = 0; k < 8; ++k)
  {
    vec4 t = texelFetch(surface, min(p + ivec2(k % 3, k / 3), last) + ivec2(corner), 0);
    n[k] = vec3(t.xy, sign(t.z) * sqrt(max(1.0 - dot(t.xy, t.xy), 0.0)));
    number[k] = t.a > 0.5 ? abs(t.z) : 0.0;
    any = any || number[k] > 0.5;
    same = same && number[k] == number[0];
  }
  if (!any) return false;
  if (!same) return true;
  // 0 to 2 are the lowest row, 6 and 7 are in the third.
  vec4 right = vec4(dot(n[0], n[1]), dot(n[1], n[2]), dot(n[3], n[4]), dot(n[4], n[5]));
  vec4 above = vec4(dot(n[0], n[3]), dot(n[3], n[6]), dot(n[1], n[4]), dot(n[4], n[7]));
  vec4 least = min(right, above);
  bool bent = min(min(least.x, least.y), min(least.z, least.w)) < crease;
  if (bent || jump <= 0.0) return bent;
  float d[8], far = 0.0;
  for (int k = 0; k < 8; ++k)
  {
    d[k] = depth_at(min(p + ivec2(k % 3, k / 3), last));
    far = max(far, d[k]);
  }
  // A jump shows in both second differences around it.
  vec4 second = abs(vec4(d[0], d[3], d[0], d[1]) - 2.0 * vec4(d[1], d[4], d[3], d[4])
    + vec4(d[2], d[5], d[6], d[7]));
  float most = max(max(second.x, second.y), max(second.z, second.w));
  return most > 4e-7 && behind(far, far - most) > jump;
}

float bright(ivec2 p)
{
  return dot(texelFetch(color, clamp(p, ivec2(0), last), 0).rgb, vec3(0.299, 0.587, 0.114));
}

// Whether luminance changes at each of 2 x 2 pixels.
bvec4 steps(ivec2 p)
{
  float s[16];
  for (int k = 0; k < 16; ++k) s[k] = bright(p + ivec2(k % 4, k / 4) - 1);
  bvec4 changed;
  for (int k = 0; k < 4; ++k)
  {
    int o = k % 2 + 4 * (k / 2);
    float e = s[o + 2] + 2.0 * s[o + 6] + s[o + 10] - s[o] - 2.0 * s[o + 4] - s[o + 8];
    float n = s[o + 8] + 2.0 * s[o + 9] + s[o + 10] - s[o] - 2.0 * s[o + 1] - s[o + 2];
    changed[k] = length(vec2(e, n)) / 4.0 > contrast;
  }
  return changed;
}

void main()
{
  last = textureSize(color, 0) - 1;
  ivec2 p = 2 * ivec2(gl_FragCoord.xy);
  ivec4 marks = ivec4(0);
#ifdef LUMINANCE
  marks = 16 * ivec4(steps(p));
#endif
#ifdef SURFACES
  if (candidate(p)) marks += 128;
#endif
  gl_FragData[0] = vec4(marks) / 255.0;
}

//@edges
uniform sampler2D candidates;
// 1 - cosine of the angle between normals at p and q; 0 on different surfaces.
float bent(ivec2 p, ivec2 q)
{
  vec4 n = surfel(clamp(p, ivec2(0), last)), m = surfel(clamp(q, ivec2(0), last));
  return n.a == m.a && dot(n.xyz, n.xyz) > 0.5 && dot(m.xyz, m.xyz) > 0.5
    ? 1.0 - dot(n.xyz, m.xyz) : 0.0;
}

// Whether normals n and m at p and q differ, and by more than their neighbours do: surfaces that
// are small on the screen are round.
bool is_crease(ivec2 p, ivec2 q, vec3 n, vec3 m)
{
  float here = bent(p, q);
  return min(abs(n.z), abs(m.z)) > grazing && here > 1.0 - crease
    && here > 2.0 * max(bent(2 * p - q, p), bent(q, 2 * q - p));
}

// The boundary between p and p + s: 0 none, 1 visible, 2 hidden.
int boundary(ivec2 p, ivec2 s)
{
  ivec2 q = p + s;
  if (q.x > last.x || q.y > last.y) return 0;
  vec4 n = surfel(p), m = surfel(q);
  bool nothing = n.a < 0.5, beyond = m.a < 0.5;
  if (nothing && beyond) return 0;
  float d = depth_at(p), e = depth_at(q);
  bool is_edge = nothing != beyond ? by_id == 1 || jump > 0.0
    : n.a != m.a && (by_id == 1 || (only_chosen == 1 && jump > 0.0));
  if (!is_edge && !nothing && !beyond)
  {
    is_edge = is_crease(p, q, n.xyz, m.xyz);
    if (!is_edge && jump > 0.0)
    {
      float b = depth_at(max(p - s, ivec2(0))), a = depth_at(min(q + s, last));
      float second = min(abs(e - 2.0 * d + b), abs(d - 2.0 * e + a));
      float farther = max(d, e);
      // A crease bends depth by the difference of slopes, pixels per pixel, and no more.
      float bend = abs(dot(vec2(s), n.xy / steep(p, n.xyz) - m.xy / steep(q, m.xyz)));
      bool shaded = dot(n.xyz, n.xyz) > 0.5 && dot(m.xyz, m.xyz) > 0.5;
      float least = jump + (shaded ? min(bend, 40.0) : 0.0);
      is_edge = behind(farther, farther - second) > least && second > 4e-7;
    }
  }
  if (!is_edge) return 0;
  // The nearer surface has the line, which is visible unless the scene is in front.
  bool is_mine = beyond || (!nothing && d <= e), touching = false;
  if (only_chosen == 1)
  {
    // Where a chosen surface meets another, it has the line unless the other is well in front.
    bool first = !nothing && has_lines(n.a), second = !beyond && has_lines(m.a);
    if (!first && !second) return 0;
    touching = first != second && !nothing && !beyond;
    if (touching) is_mine = first;
    else if (is_mine ? !first : !second) return 0;
  }
  float line_depth = is_mine ? d : e, front = texelFetch(scene, is_mine ? p : q, 0).r;
  if (touching) front = min(front, is_mine ? e : d);
  float slope = 1.0 + 1.0 / max(abs(is_mine ? n.z : m.z), 0.05);
  if (behind(line_depth, front) <= slope || abs(line_depth - front) < 4e-7) return 1;
  return dashed == 1 ? 2 : 0;
}

void main()
{
  last = textureSize(color, 0) - 1;
  ivec2 c = ivec2(gl_FragCoord.xy);
  ivec4 marks = ivec4(255.0 * texelFetch(candidates, c, 0) + 0.5);
  // A loop, since some drivers execute branches for all pixels.
  int count = marks[0] >= 128 ? 4 : 0;
  marks = marks & 127;
  for (int k = 0; k < count; ++k)
  {
    ivec2 p = 2 * c + ivec2(k % 2, k / 2);
    marks[k] += boundary(p, ivec2(1, 0)) + 4 * boundary(p, ivec2(0, 1));
  }
  gl_FragData[0] = vec4(marks) / 255.0;
}

//@lines
uniform sampler2D edges;
uniform sampler2D squares;
uniform int reach;
uniform float width;
uniform float dash;
uniform vec4 ink;
uniform sampler2D veil;  // alpha: opacity of volumes
uniform int veiled;      // whether there are volumes
uniform vec2 corner;     // of the picture in the veil

// Opacity of volumes at a pixel of the picture.
float veil_at(ivec2 p)
{
  return texelFetch(veil, clamp(p + ivec2(corner), ivec2(0), textureSize(veil, 0) - 1), 0).a;
}

// How much of a line at p volumes hide. A boundary whose sides have different opacity before them
// lies between surfaces in front of, within and behind a volume: the line is on the clearer side.
float hidden(ivec2 p, ivec2 side, ivec2 opposite)
{
  float here = veil_at(side), there = veil_at(opposite);
  float change = abs(here - there) / max(max(here, there), 0.01);
  return mix(veil_at(p), min(here, there), smoothstep(0.25, 0.5, change));
}

// Coverage of a pixel whose centre is d off the line's centre.
float covered(float d)
{
  return clamp(0.5 * width + 0.5 - d, 0.0, 1.0);
}

void main()
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  if (texelFetch(squares, p / SIDE, 0).r < 0.5) discard;
  ivec2 low = max(p - reach, ivec2(0)) / 2, high = min((p + reach) / 2, textureSize(edges, 0) - 1);
  // Bits of boundaries to the right and above: visible ones, in a dash hidden ones too.
  bool in_dash = fract((gl_FragCoord.x + gl_FragCoord.y) / (2.0 * dash)) < 0.5;
  int beside = in_dash ? 3 : 1, above = 4 * beside;
  float near = 1e6;
  ivec2 nearest = ivec2(0), pace = ivec2(0);  // pixel and step of the boundary; (0, 0) for luminance
  for (int j = low.y; j <= high.y; ++j)
    for (int i = low.x; i <= high.x; ++i)
    {
      vec4 texel = texelFetch(edges, ivec2(i, j), 0);
      if (texel == vec4(0.0)) continue;
      ivec4 marks = ivec4(255.0 * texel + 0.5);
      for (int k = 0; k < 4; ++k)
      {
        ivec2 at = ivec2(2 * i + k % 2, 2 * j + k / 2);
        vec2 o = vec2(at - p);
        // To the middle of each step: the corners of slanted boundaries are off the line.
        float right = (marks[k] & beside) != 0 ? length(o + vec2(0.5, 0.0)) : near;
        float up = (marks[k] & above) != 0 ? length(o + vec2(0.0, 0.5)) : near;
        if (min(right, up) < near)
        {
          near = min(right, up);
          nearest = at;
          pace = right <= up ? ivec2(1, 0) : ivec2(0, 1);
        }
        if ((marks[k] & 16) != 0 && 0.5 + length(o) < near)
        {
          near = 0.5 + length(o);
          pace = ivec2(0);
        }
      }
    }
  float cover = ink.a * covered(near);
  if (veiled == 1 && pace != ivec2(0)) cover *= 1.0 - hidden(p, nearest, nearest + pace);
  if (cover <= 0.0) discard;
  gl_FragData[0] = vec4(ink.rgb, cover);
}

//@debug
uniform sampler2D edges;
void main()
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  int marks = int(255.0 * texelFetch(edges, p / 2, 0)[p.x % 2 + 2 * (p.y % 2)] + 0.5);
  gl_FragData[0] = vec4((marks & 3) != 0, (marks & 12) != 0, (marks & 16) != 0, 1.0);
}
