// Ambient occlusion from the depth buffer. Around each pixel, slices through its line of sight are
// searched outward on both sides; surfaces cover sectors of the slice, of equal cosine-weighted
// measure, and each sector is weighted by the distance of its first cover. Slices and integral:
// Jimenez et al., "Practical real-time strategies for accurate indirect occlusion", SIGGRAPH 2016
// course; sectors: Therrien et al., "Screen space indirect lighting with visibility bitmask", 2023.
// Slices turn from pixel to pixel in blocks of 4 x 4, over which the second program averages. While
// the view moves, one pixel of each square is searched, and the second program looks them up.
// Inputs: depth of the window, 0 near to 1 far; lengths in world units, positions in view space.

//@common
uniform sampler2D depth;
uniform vec4 lens;    // view x and y at distance 1, or anywhere if parallel: xy * ndc + zw
uniform vec2 planes;
uniform int parallel;
uniform int coarse;   // side of the squares of which one pixel is searched

ivec2 last;           // last pixel
vec2 ndc_step;        // from pixel to pixel

float depth_at(ivec2 p)
{
  return texelFetch(depth, clamp(p, ivec2(0), last), 0).r;
}

float away(float d)
{
  return parallel == 1 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
}

vec2 at_one(vec2 p)
{
  return lens.xy * (ndc_step * (p + 0.5) - 1.0) + lens.zw;
}

vec3 position(vec2 p, float d)
{
  float z = away(d);
  vec2 xy = at_one(p);
  return vec3(parallel == 1 ? xy : xy * z, -z);
}

// Slope of depth along a step: of both sides, weighted by how straight each continues, since window
// depth is affine on planes.
float slope(ivec2 p, ivec2 s, float d)
{
  float a = depth_at(p - s), b = depth_at(p + s);
  float before = abs(d - 2.0 * a + depth_at(p - 2 * s));
  float after = abs(d - 2.0 * b + depth_at(p + 2 * s));
  if (p.x < s.x || p.y < s.y) before = 1.0;
  if (any(greaterThan(p + s, last))) after = 1.0;
  before += 1e-9;
  after += 1e-9;
  return ((d - a) * after + (b - d) * before) / (before + after);
}

vec2 slopes(ivec2 p, float d)
{
  return vec2(slope(p, ivec2(1, 0), d), slope(p, ivec2(0, 1), d));
}

// The pixel of a square that is searched.
ivec2 searched(ivec2 square)
{
  return min(square * coarse + coarse / 2, last);
}

void begin()
{
  last = textureSize(depth, 0) - 1;
  ndc_step = 2.0 / vec2(last + 1);
}

//@search
uniform int slices;
uniform int steps;
uniform float radius;
uniform float thickness;
uniform vec3 vary;    // offsets of an Accumulation sample, 0 to 1

const float PI = 3.14159265;
const float LEAP = 4.0;  // rise over run between two surfaces

int ones(uint n)
{
  n -= (n >> 1) & 0x55555555u;
  n = (n & 0x33333333u) + ((n >> 2) & 0x33333333u);
  return int((((n + (n >> 4)) & 0x0F0F0F0Fu) * 0x01010101u) >> 24);
}

uint first(int n)
{
  return n >= 32 ? 0xFFFFFFFFu : (1u << uint(n)) - 1u;
}

// Measures from the line of sight to two angles with these cosines. side: cosine and sine of the
// normal's angle, and the angle of the horizon.
vec2 measured(vec2 cosines, vec3 side)
{
  vec2 c = clamp(cosines, -1.0, 1.0), s = sqrt(1.0 - c * c), h = acos(c);
  vec2 m = 0.5 * (side.x * s * s + side.y * (h - s * c));
  return mix(m, vec2(0.5 * (side.x + side.y * side.z)), greaterThan(h, side.zz));
}

struct Surfel { vec3 at, sight, normal; vec2 pixel; float error; };

// Weighted measure of covered sectors on one side. n: angle of the normal towards that side.
float covered(Surfel s, vec2 way, float n, float jitter, float dither)
{
  vec3 side = vec3(cos(n), sin(n), 0.5 * PI + n);
  float whole = max(0.5 * (side.x + side.y * side.z), 1e-6), sum = 0.0;
  float reach = max(length(way), 1e-3);
  vec3 before = vec3(0.0);
  uint taken_sectors = 0u;
  for (int k = 0; k < steps; ++k)
  {
    // Steps of increasing length, at least a pixel.
    float share = (float(k) + jitter) / float(steps);
    vec2 o = way * max(share * share, float(k + 1) / reach);
    ivec2 q = ivec2(floor(s.pixel + 0.5 + o));
    if (float(k) > reach || any(lessThan(q, ivec2(0))) || any(greaterThan(q, last))) break;
    float d = depth_at(q);
    if (d >= 1.0) continue;
    vec3 to = position(vec2(q), d), v = to - s.at;
    vec3 gap = v - before;
    float far = length(v), rise = dot(gap, s.sight);
    bool leap = rise > LEAP * length(gap - rise * s.sight);
    // Between two samples of one surface the distance is interpolated.
    float between = leap ? far : 0.5 * (far + min(length(before), radius));
    float weight = 1.0 - between * between / (radius * radius);
    before = v;
    if (far >= radius || dot(v, s.normal) < s.error) continue;
    // The back of the surface, along its own line of sight.
    float deep = leap ? thickness : thickness + max(rise, 0.0);
    vec3 w = v + (parallel == 1 ? vec3(0.0, 0.0, -deep) : to * (deep / length(to)));
    vec2 ends = vec2(dot(v, s.sight), dot(w, s.sight)) / vec2(far, length(w));
    ivec2 sector = ivec2(floor(32.0 * measured(ends, side) / whole + dither));
    sector = clamp(sector, 0, 32);
    uint cover = first(sector.y) & ~first(sector.x) & ~taken_sectors;
    taken_sectors |= cover;
    sum += weight * float(ones(cover));
  }
  return sum * whole / 32.0;
}

void main()
{
  begin();
  ivec2 square = ivec2(gl_FragCoord.xy), p = searched(square);
  float d = depth_at(p);
  gl_FragData[0] = vec4(1.0);
  if (d >= 1.0) return;
  Surfel s;
  s.at = position(vec2(p), d);
  s.pixel = vec2(p);
  s.sight = parallel == 1 ? vec3(0.0, 0.0, 1.0) : -normalize(s.at);
  vec2 g = slopes(p, d);
  vec3 right = position(s.pixel + vec2(1.0, 0.0), d + g.x) - s.at;
  vec3 up = position(s.pixel + vec2(0.0, 1.0), d + g.y) - s.at;
  // Of unit vectors: the square of the cross product of tiny ones is no float.
  s.normal = normalize(cross(normalize(right), normalize(up)));
  float z = -s.at.z;
  // Error of 24-bit depths, and of positions.
  float grain = (planes.y - planes.x) * (parallel == 1 ? 1.0 : z * z / (planes.x * planes.y));
  s.error = 1e-6 * z + 2.4e-7 * grain;
  vec3 beside = abs(s.sight.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0);
  vec3 side = normalize(cross(beside, s.sight));
  vec3 top = cross(s.sight, side);

  // Counted from the view axis: tiles of large screenshots get the pattern of the whole.
  ivec2 place = ivec2(floor(at_one(s.pixel) / (lens.xy * ndc_step) + 0.25)) & 3;
  if (coarse > 1) place = square & 3;
  int cell = 4 * place.x + place.y;
  float turn = float((cell * 7) & 15) / 16.0 + vary.x;
  float jitter = fract((float((cell * 11 + 5) & 15) + 0.5) / 16.0 + vary.y);
  float dither = fract((float((cell * 5) & 15) + 0.5) / 16.0 + vary.z);
  float hidden = 0.0, whole = 0.0;
  for (int k = 0; k < slices; ++k)
  {
    float a = PI * (float(k) + turn) / float(slices);
    vec3 across = cos(a) * side + sin(a) * top;
    // The radius on the screen, in pixels.
    vec2 way = parallel == 1 ? across.xy : (across.xy + s.at.xy * across.z / z) / z;
    way *= radius / (lens.xy * ndc_step);
    vec3 axis = cross(across, s.sight);
    vec3 flat_normal = s.normal - axis * dot(s.normal, axis);
    float size = length(flat_normal);
    if (size < 1e-4) continue;
    float n = sign(dot(across, flat_normal))
      * acos(clamp(dot(flat_normal, s.sight) / size, -1.0, 1.0));
    hidden += size * (covered(s, way, n, jitter, dither)
      + covered(s, -way, -n, 1.0 - jitter, dither));
    whole += size * (cos(n) + n * sin(n));
  }
  gl_FragData[0] = vec4(1.0 - hidden / max(whole, 1e-6));
}

//@apply
uniform sampler2D color;
uniform sampler2D visibility;
uniform sampler2D unlit_depth;  // of surfaces that keep their colour
uniform float strength;
uniform int exempts;            // whether there are such surfaces
uniform int edges;              // whether pixels are mixed from multisamples

bool is_exempt(ivec2 p, float d, float near)
{
  float unlit = texelFetch(unlit_depth, clamp(p, ivec2(0), last), 0).r;
  return exempts == 1 && unlit < 1.0 && unlit <= d + near + 1e-6;
}

bool is_inside(ivec2 p, float near)
{
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i)
      if (!is_exempt(p + ivec2(i, j), depth_at(p + ivec2(i, j)), 2.0 * near)) return false;
  return true;
}

void main()
{
  begin();
  ivec2 p = ivec2(uv * vec2(last + 1));
  vec4 c = texelFetch(color, p, 0);
  gl_FragData[0] = c;
  float d = depth_at(p);
  if (d >= 1.0) return;
  vec2 g = slopes(p, d);
  // Depths of multisamples differ by half a pixel, and colours at edges are mixed.
  float near = edges == 1 ? abs(g.x) + abs(g.y) : 0.0;
  if (is_exempt(p, d, near) && (edges == 0 || is_inside(p, near))) return;
  float z = away(d), sum = 0.0, weight = 0.0;
  float tolerance = 3.0 * float(coarse) * lens.y * ndc_step.y * (parallel == 1 ? 1.0 : z);
  // Any 4 x 4 pixels around this one: the rim of 5 x 5 counts half. Of squares fewer, blended.
  int rim = coarse > 1 ? 1 : 2;
  ivec2 last_square = textureSize(visibility, 0) - 1;
  for (int j = -rim; j <= rim; ++j)
    for (int i = -rim; i <= rim; ++i)
    {
      ivec2 square = clamp(p / coarse + ivec2(i, j), ivec2(0), last_square);
      ivec2 q = searched(square);
      float e = depth_at(q), w = (abs(i) == 2 ? 0.5 : 1.0) * (abs(j) == 2 ? 0.5 : 1.0);
      float off = abs(away(e) - away(min(d + dot(g, vec2(q - p)), 1.0)));
      w *= e < 1.0 ? max(1.0 - off / tolerance, 0.0) : 0.0;
      if (coarse > 1)
      {
        vec2 apart = abs(vec2(q - p)) / float(coarse);
        w *= max(1.5 - apart.x, 0.0) * max(1.5 - apart.y, 0.0);
        if (i == 0 && j == 0) w = max(w, 1e-3);
      }
      w = q == p ? 1.0 : w;
      sum += w * texelFetch(visibility, square, 0).r;
      weight += w;
    }
  gl_FragData[0] = vec4(c.rgb * pow(max(sum / weight, 0.0), strength), c.a);
}
