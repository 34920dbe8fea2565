// From light to display values: an exposure, then a curve that maps all light into [0, 1].
// Curves and sources: maths/tones.py, the numpy twin.
// Inputs: color, the picture so far (display values, above 1 for light); stops, the exposure;
// metered, one texel of further stops.
//@light
float channel_to_light(float c) {
  return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}
vec3 to_light(vec3 c) {
  c = max(c, 0.0);
  return vec3(channel_to_light(c.r), channel_to_light(c.g), channel_to_light(c.b));
}
float channel_to_display(float c) {
  return c <= 0.0031308 ? 12.92 * c : 1.055 * pow(c, 1.0 / 2.4) - 0.055;
}
vec3 to_display(vec3 c) {
  c = max(c, 0.0);
  return vec3(channel_to_display(c.r), channel_to_display(c.g), channel_to_display(c.b));
}
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

//@measure
// Sum of log2 luminance over a part of the picture, and its number of samples: 4 x 4 per texel of a
// small target. Pixels with NaN or infinity do not count.
uniform sampler2D color;
uniform vec2 step;  // between two samples, in uv
void main() {
  vec2 sum = vec2(0.0);
  for (int i = 0; i < 16; i++) {
    vec2 at = uv + step * (vec2(i % 4, i / 4) - 1.5);
    vec3 c = textureLod(color, at, 0.0).rgb;
    if (!all(lessThan(abs(c), vec3(1e4)))) continue;  // max() would turn NaN into a number
    sum += vec2(log2(max(dot(to_light(c), LUMINANCE), 1.0 / 1024.0)), 1.0);
  }
  gl_FragData[0] = vec4(sum, 0.0, 1.0);
}

//@adapt
// The exposure of a metered picture, on its way from that of the previous time. Without a pixel that
// counts it stays.
uniform sampler2D measured;
uniform sampler2D last;   // of the last frame
uniform sampler2D past;   // of the previous time
uniform int is_first;
uniform float remaining;  // part of the difference from the past, 0 to adapt at once
uniform vec2 stop_range;
uniform float middle_grey;
void main() {
  vec2 sum = vec2(0.0);
  for (int i = 0; i < SIDE * SIDE; i++) {
    sum += texelFetch(measured, ivec2(i % SIDE, i / SIDE), 0).rg;
  }
  float stops = is_first == 1 ? 0.0 : texelFetch(last, ivec2(0), 0).r;
  if (sum.y > 0.0) stops = clamp(log2(middle_grey) - sum.x / sum.y, stop_range.x, stop_range.y);
  if (remaining > 0.0) stops = mix(stops, texelFetch(past, ivec2(0), 0).r, remaining);
  gl_FragData[0] = vec4(stops);
}

//@map
uniform sampler2D color;
uniform sampler2D metered;
uniform float stops;
uniform float white;
uniform float intensity;
// Defines: CURVE, index into maths/tones.py: CURVES; EXPOSED, 0 if stops is 0; METERED, 1 if there are
// further stops.

vec3 faithful(vec3 c) {
  c = max(c, 0.0);
  float peak = max(max(c.r, max(c.g, c.b)), 1.0);
  return mix(c / peak, vec3(1.0), (peak - 1.0) / (peak + 1.0));
}
vec3 reinhard(vec3 c) {
  float y = dot(c, LUMINANCE);
  return c * (1.0 + y / (white * white)) / (1.0 + y);
}
vec3 aces(vec3 c) {
  const mat3 to = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566,
                       0.83777);
  const mat3 from = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367,
                         -0.00605, 1.07602);
  vec3 v = to * min(c, 1e4);  // beyond, the quotient of two squares overflows
  return from * ((v * (v + 0.0245786) - 0.000090537)
                 / (v * (0.983729 * v + 0.4329510) + 0.238081));
}
vec3 agx(vec3 c) {
  const mat3 to = mat3(0.842479062, 0.042328242, 0.042375655, 0.0784336, 0.878468636, 0.0784336,
                       0.079223745, 0.079166127, 0.879142974);
  const mat3 from = mat3(1.196879005, -0.052896852, -0.052971636, -0.098020881, 1.151903130,
                         -0.098043450, -0.099029744, -0.098961177, 1.151073673);
  const float low = -12.47393, high = 4.026069;
  vec3 x = (clamp(log2(max(to * c, 1e-10)), low, high) - low) / (high - low);
  vec3 y = vec3(15.5);
  y = y * x - 40.14;
  y = y * x + 31.96;
  y = y * x - 6.868;
  y = y * x + 0.4298;
  y = y * x + 0.1191;
  y = y * x - 0.00232;
  return from * y;
}
vec3 neutral(vec3 c) {
  const float start = 0.8 - 0.04;
  float least = min(c.r, min(c.g, c.b));
  c -= least < 0.08 ? least - 6.25 * least * least : 0.04;
  float peak = max(c.r, max(c.g, c.b));
  if (peak < start) return c;
  float room = 1.0 - start;
  float top = 1.0 - room * room / (peak + room - start);
  return mix(c * (top / peak), vec3(top), 1.0 - 1.0 / (0.15 * (peak - top) + 1.0));
}
void main() {
  vec4 source = texture(color, uv);
  vec3 c = source.rgb;
  float all_stops = METERED == 0 ? stops : stops + texelFetch(metered, ivec2(0), 0).r;
  if (CURVE == 0) {
    c = faithful(EXPOSED == 0 ? c : to_display(to_light(c) * exp2(all_stops)));
  } else {
    c = to_light(c) * exp2(all_stops);
    if (CURVE == 3) {
      c = clamp(agx(c), 0.0, 1.0);
    } else {
      c = CURVE == 1 ? reinhard(c) : CURVE == 2 ? aces(c) : neutral(c);
      c = to_display(clamp(c, 0.0, 1.0));
    }
  }
  gl_FragData[0] = vec4(intensity < 1.0 ? mix(source.rgb, c, intensity) : c, source.a);
}
