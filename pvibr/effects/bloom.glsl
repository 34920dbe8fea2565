// Bloom: bright light spreads. bright: what lies above the threshold, averaged over squares of the
// picture.
// Brightness S is the largest channel, so that colours keep their hue and blue shines like green;
// it is that of 2 x 2 pixels, one bilinear tap. Half-open squares, counted in pixels.
// Inputs: color (display values, above 1 where the frame has them; alpha 0 where only a plain
// background is; linear filter).
// Defines: TAPS along a side of a square of 2 TAPS pixels; WAY 0 subtract, 1 keep, 2 soft.
//@bright
uniform sampler2D color;
uniform float threshold;
uniform float knee;
uniform float background;  // 1 where a plain background shines too
uniform float saturation;
vec3 above(vec4 c)
{
  // What is endless would stay in sums for ever.
  vec3 s = clamp(c.rgb, 0.0, 10000.0) * mix(clamp(c.a, 0.0, 1.0), 1.0, background);
  float b = max(s.r, max(s.g, s.b));
#if WAY == 0
  float kept = max(b - threshold, 0.0) / max(b, 1e-9);
#elif WAY == 1
  float kept = b > threshold ? 1.0 : 0.0;
#else
  float kept = smoothstep(threshold - knee, threshold + knee, b);
#endif
  // NaN fails every comparison.
  return dot(c, vec4(1.0)) < 1e9 ? mix(vec3(b), s, saturation) * kept : vec3(0.0);
}
void main()
{
  vec2 pixel = 1.0 / vec2(textureSize(color, 0));
  vec2 first = gl_FragCoord.xy * float(2 * TAPS) - float(TAPS) + 1.0;
  vec3 sum = vec3(min(uv.x, 0.0));
  for (int j = 0; j < TAPS; ++j)
  {
    for (int i = 0; i < TAPS; ++i)
    {
      sum += above(texture(color, (first + 2.0 * vec2(i, j)) * pixel));
    }
  }
  gl_FragData[0] = vec4(sum / float(TAPS * TAPS), 1.0);
}
