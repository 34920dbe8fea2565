// A thin lens on a picture with depth. At half size, each texel gathers the light that the lens spreads
// over it, at samples on a spiral: surfaces before the focus plane as a layer that covers, surfaces
// behind it unless something nearer hides them. At full size the layers are composed; circles of up to
// two pixels are gathered there, since half size would make combs of their edges, and pixels in focus
// are unchanged, to the bit.
//
// The circle of confusion of a thin lens (Potmesil and Chakravarty, "A lens and aperture camera model
// for synthetic image generation", SIGGRAPH 1981) is linear in the depth buffer's value, in perspective
// as in parallel views: that is `lens`. Circles are radii in half-size texels, negative before the
// focus plane; x and y in such texels.

//@reduce
uniform sampler2D color;  // full size, RGBA
uniform sampler2D depth;  // full size, 0 near to 1 far
uniform vec3 lens;        // circle = x + y * depth, at most z either way

// NaN, which would spread, becomes black.
vec4 finite(vec4 c)
{
  return vec4(c.r >= 0.0 ? c.r : 0.0, c.g >= 0.0 ? c.g : 0.0, c.b >= 0.0 ? c.b : 0.0, c.a);
}

void main()
{
  ivec2 most = textureSize(depth, 0) - 1;
  ivec2 at = 2 * ivec2(uv * vec2((most + 2) / 2));
  vec4 sum = vec4(0.0);
  float first = 0.0, circle = 0.0, weight = 0.0;
  // Of four pixels, those as far as the nearest: a mean of two surfaces would be a halo.
  float c[4];
  for (int i = 0; i < 4; i++)
  {
    float z = texelFetch(depth, min(at + ivec2(i & 1, i >> 1), most), 0).r;
    c[i] = clamp(lens.x + lens.y * z, -lens.z, lens.z);
    first = i == 0 ? c[0] : min(first, c[i]);
  }
  for (int i = 0; i < 4; i++)
  {
    float w = c[i] - first < 0.25 + 0.1 * abs(first) ? 1.0 : 0.0;
    vec4 pixel = finite(texelFetch(color, min(at + ivec2(i & 1, i >> 1), most), 0));
    sum += w * min(pixel, vec4(60000.0));
    circle += w * c[i];
    weight += w;
  }
  gl_FragData[0] = sum / weight;
  gl_FragData[1] = vec4(circle / weight, 0.25 * weight, 0.0, 0.0);
}
//@tile
uniform sampler2D circle;
void main()
{
  // The largest circle before the focus plane, of 8 x 8 texels.
  ivec2 most = textureSize(circle, 0) - 1;
  ivec2 at = 8 * ivec2(uv * vec2((most + 8) / 8));
  float least = 0.0;
  for (int j = 0; j < 8; j++)
    for (int i = 0; i < 8; i++)
      least = min(least, texelFetch(circle, min(at + ivec2(i, j), most), 0).r);
  gl_FragData[0] = vec4(-least);
}
//@spread
uniform sampler2D tiles;
uniform int reach;
void main()
{
  // The largest circle of any tile that reaches this one.
  ivec2 most = textureSize(tiles, 0) - 1;
  ivec2 at = ivec2(uv * vec2(most + 1));
  float largest = 0.0;
  for (int j = -reach; j <= reach; j++)
    for (int i = -reach; i <= reach; i++)
    {
      vec2 gap = 8.0 * max(abs(vec2(i, j)) - 1.0, 0.0);
      float c = texelFetch(tiles, clamp(at + ivec2(i, j), ivec2(0), most), 0).r;
      if (c * c >= dot(gap, gap)) largest = max(largest, c);
    }
  gl_FragData[0] = vec4(largest);
}
//@gather
uniform sampler2D color;   // half size
uniform sampler2D circle;  // half size
uniform sampler2D tiles;
uniform int samples;

float before(float c) { return smoothstep(1.0, 1.5, -c); }

// Samples of a circle: about two for each texel in it, and eight.
int samples_in(float radius)
{
  return radius > 0.25 ? min(samples, 8 + int(6.0 * radius * radius)) : 0;
}

void main()
{
  ivec2 most = textureSize(circle, 0) - 1;
  ivec2 at = ivec2(uv * vec2(most + 1));
  vec4 center = texelFetch(color, at, 0);
  float c = texelFetch(circle, at, 0).r;
  float wide = texelFetch(tiles, at / 8, 0).r;
  bool hides = c < -1.0;
  // Neighbours turn the spiral: four of them, mixed, are a spiral of four times as many samples.
  float turn = 0.6 * float((at.x & 1) + 2 * (at.y & 1));
  vec2 start = vec2(cos(turn), sin(turn));
  mat2 golden = mat2(-0.7373688, 0.6754903, -0.6754903, -0.7373688);

  // -- behind: surfaces as far as this one or farther, and what nearer ones spread over it ------
  float radius = hides ? wide : max(c, 0.0);
  vec4 same = hides ? vec4(0.0) : center * 1e-3, front = vec4(0.0);
  float weight = hides ? 0.0 : 1e-3, cover = 0.0;
  // Empty loops in place of branches, which some drivers execute for all pixels.
  int count = hides || c > 0.75 ? samples_in(radius) : 0;
  vec2 ray = start;
  float divisor = float(max(count, 1)), area = radius * radius / divisor;
  for (int i = 0; i < count; i++)
  {
    float r = radius * sqrt((float(i) + 0.5) / divisor);
    ivec2 to = clamp(at + ivec2(floor(ray * r + 0.5)), ivec2(0), most);
    ray = golden * ray;
    vec2 entry = texelFetch(circle, to, 0).rg;
    float theirs = entry.r, w = entry.g * (1.0 - before(theirs));
    vec4 there = texelFetch(color, to, 0);
    // Hidden from the lens's centre: the nearest visible surface stands in.
    float near_by = hides ? w / (1.0 + r * r) : w;
    float spread = max(theirs, 0.5);
    float over = w * area / (spread * spread) * clamp(theirs - r + 0.5, 0.0, 1.0);
    bool is_front = !hides && theirs < c - max(0.5, 0.15 * c);
    over = is_front ? over : 0.0;
    near_by = is_front ? 0.0 : near_by;
    front += over * there;
    cover += over;
    same += near_by * there;
    weight += near_by;
  }
  vec4 behind = weight > 0.0 ? same / weight : center;
  if (cover > 0.0) behind = mix(behind, front / cover, min(cover, 1.0));

  // -- before: each surface spreads over its circle, and covers -----------------------------------
  vec4 near = vec4(0.0);
  float covered = 0.0;
  count = wide > 1.0 ? samples_in(wide) : 0;
  divisor = float(max(count, 1));
  wide += 0.5;  // circles end softly
  ray = start;
  area = wide * wide / divisor;
  for (int i = 0; i < count; i++)
  {
    float r = wide * sqrt((float(i) + 0.5) / divisor);
    ivec2 to = clamp(at + ivec2(floor(ray * r + 0.5)), ivec2(0), most);
    ray = golden * ray;
    vec2 entry = texelFetch(circle, to, 0).rg;
    float theirs = entry.r, spread = max(-theirs, 0.5);
    float w = entry.g * before(theirs) * area / (spread * spread);
    w *= clamp(spread - r + 0.5, 0.0, 1.0);
    near += w * texelFetch(color, to, 0);
    covered += w;
  }
  if (weight <= 0.0 && covered > 0.0)  // nothing behind is visible nearby
    behind = near / covered;
  float scale = covered > 1.0 ? 1.0 / covered : 1.0;
  gl_FragData[0] = behind;
  gl_FragData[1] = near * scale;
  gl_FragData[2] = vec4(covered * scale);
}
//@compose
uniform sampler2D color;   // full size
uniform sampler2D depth;   // full size
uniform sampler2D circle;  // half size, and all that follow
uniform sampler2D behind;
uniform sampler2D near;
uniform sampler2D cover;
uniform vec3 lens;
uniform int stage;         // 0 all, 1 circles, 2 before the focus plane, 3 behind it

// An empty loop where nothing is blurred: see gather.
vec4 upsampled(vec2 at, float c, bool is_blurred)
{
  ivec2 low = ivec2(floor(at)), most = textureSize(circle, 0) - 1;
  vec2 part = at - vec2(low);
  vec4 sum = vec4(0.0);
  float weight = 0.0;
  int count = is_blurred ? 4 : 0;
  for (int i = 0; i < count; i++)
  {
    ivec2 k = ivec2(i & 1, i >> 1);
    ivec2 to = clamp(low + k, ivec2(0), most);
    float w = (k.x == 1 ? part.x : 1.0 - part.x) * (k.y == 1 ? part.y : 1.0 - part.y);
    // The same surface only: one in focus would shine into the blur beside it.
    float gap = 0.02 + abs(texelFetch(circle, to, 0).r - c) / (0.5 + abs(c));
    w = (w + 1e-3) / (gap * gap);
    sum += w * texelFetch(behind, to, 0);
    weight += w;
  }
  return sum / weight;
}

// NaN, which would spread, becomes black.
vec4 finite(vec4 c)
{
  c.rgb = mix(c.rgb, vec3(0.0), isnan(c.rgb));
  return vec4(clamp(c.rgb, 0.0, 60000.0), c.a);
}

const ivec2 BESIDE[12] = ivec2[](ivec2(1, 0), ivec2(0, 1), ivec2(-1, 0), ivec2(0, -1),
  ivec2(1, 1), ivec2(-1, 1), ivec2(-1, -1), ivec2(1, -1),
  ivec2(2, 0), ivec2(0, 2), ivec2(-2, 0), ivec2(0, -2));

// Circles of up to two pixels, gathered at full size.
vec4 fine(ivec2 at, vec4 center, float c, bool is_small)
{
  ivec2 most = textureSize(depth, 0) - 1;
  float radius = 2.0 * abs(c), weight = 1.0 / max(3.14159 * radius * radius, 1.0);
  vec4 sum = center * weight;
  int count = is_small ? 12 : 0;
  for (int i = 0; i < count; i++)
  {
    ivec2 to = clamp(at + BESIDE[i], ivec2(0), most);
    float theirs = clamp(lens.x + lens.y * texelFetch(depth, to, 0).r, -lens.z, lens.z);
    // A surface behind spreads no farther over this one than this one's circle.
    float r = 2.0 * abs(theirs), away = length(vec2(BESIDE[i]));
    r = theirs > c + 0.1 ? min(r, radius) : r;
    float w = clamp(r - away + 0.5, 0.0, 1.0) / max(3.14159 * r * r, 1.0);
    sum += w * finite(texelFetch(color, to, 0));
    weight += w;
  }
  return sum / weight;
}

void main()
{
  vec2 place = uv * vec2(textureSize(depth, 0));  // as gl_FragCoord is
  ivec2 pixel = ivec2(place);
  vec4 sharp = texelFetch(color, pixel, 0);
  float c = clamp(lens.x + lens.y * texelFetch(depth, pixel, 0).r, -lens.z, lens.z);
  vec2 half_uv = place * 0.5 / vec2(textureSize(circle, 0));
  float covered = texture(cover, half_uv).r;
  float blurred = smoothstep(1.0, 1.5, abs(c));
  if (abs(c) > 0.02) sharp = fine(pixel, finite(sharp), c, abs(c) < 1.5);
  vec4 soft = upsampled(place * 0.5 - 0.5, c, blurred > 0.0), mixed = sharp;
  if (blurred > 0.0) mixed = blurred < 1.0 ? mix(sharp, soft, blurred) : soft;
  if (stage == 3) covered = 0.0;
  if (covered > 0.002)
    mixed = mixed * (1.0 - covered) + texture(near, half_uv);
  if (stage == 1) mixed = vec4(max(-c, 0.0) / lens.z, max(c, 0.0) / lens.z, 0.0, 1.0);
  if (stage == 2) mixed = texture(near, half_uv);
  gl_FragData[0] = mixed;
}
