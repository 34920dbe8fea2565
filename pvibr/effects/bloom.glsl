// Bloom, entry point bright: light above the threshold, averaged over squares of the picture.
// Brightness S is the largest channel, so that colours keep their hue and blue counts like green;
// it is that of 2 x 2 pixels, one bilinear tap, or of one pixel if fireflies are reduced.
// FIREFLIES: a mean weighted by 1 / (1 + firefly_reduction S): B. Karis, "Tone mapping", graphicrants.blogspot.com,
// 2013; partial, within each square: J. Jimenez, "Next generation post processing in Call of Duty:
// Advanced Warfare", SIGGRAPH 2014, slides 166 to 168. Half-open squares, counted in pixels.
// Inputs: color (display values, above 1 where the frame has them; alpha 0 where only a plain
// background is; linear filter).
// Defines: TAPS and STEP, along a side of a square of TAPS * STEP pixels; OPERATOR 0 subtract,
// 1 keep, 2 soft; FLOATS if colours may be infinite or NaN; FIREFLIES.
//@bright
uniform sampler2D color;
uniform vec2 pixel;        // of the picture, one over its size
uniform float threshold;
uniform vec2 ramp;         // of the soft step: factor and summand that take its ends to 0 and 1
uniform float background;  // 1 if a plain background is included
uniform float saturation;
uniform float firefly_reduction;
vec4 above(vec4 c)
{
#if FLOATS
  // Infinity would stay in sums for ever. Comparisons do not find NaN: NVIDIA turns !(a < b) round.
  if (any(isnan(c)) || any(isinf(c))) return vec4(0.0);
  c.rgb = clamp(c.rgb, 0.0, 10000.0);
#endif
  vec3 s = c.rgb * clamp(c.a + background, 0.0, 1.0);
  float b = max(s.r, max(s.g, s.b));
#if OPERATOR == 0
  float kept = max(b - threshold, 0.0) / max(b, 1e-9);
#elif OPERATOR == 1
  float kept = b > threshold ? 1.0 : 0.0;
#else
  float t = clamp(b * ramp.x + ramp.y, 0.0, 1.0);
  float kept = t * t * (3.0 - 2.0 * t);
#endif
  vec3 light = mix(vec3(b), s, saturation) * kept;
#if FIREFLIES
  float weight = 1.0 / (1.0 + firefly_reduction * b * kept);
  return vec4(light, 1.0) * weight;
#else
  return vec4(light, 1.0);
#endif
}
void main()
{
  vec2 first = (gl_FragCoord.xy * float(TAPS * STEP) - 0.5 * float((TAPS - 1) * STEP)) * pixel;
  vec4 sum = vec4(min(uv.x, 0.0));
  for (int j = 0; j < TAPS; ++j)
  {
    for (int i = 0; i < TAPS; ++i)
    {
      sum += above(texture(color, first + float(STEP) * vec2(i, j) * pixel));
    }
  }
#if FIREFLIES
  gl_FragData[0] = vec4(sum.rgb / max(sum.a, 1e-9), 1.0);
#else
  gl_FragData[0] = vec4(sum.rgb / float(TAPS * TAPS), 1.0);
#endif
  gl_FragData[1] = vec4(1e9 * dot(sum.rgb, vec3(1.0)));
}
