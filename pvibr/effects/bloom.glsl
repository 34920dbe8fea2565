// Bloom, bright pass: light above the threshold, averaged per texel. Texels have any size and share
// the pixels at their edges, so the image has the same rows in a window of any size. Brightness is
// luminance, Rec. 709; the light keeps its pixel's hue.
// FIREFLIES: a mean weighted by 1 / (1 + firefly_reduction S): B. Karis, "Tone mapping",
// graphicrants.blogspot.com, 2013; partial, per texel: J. Jimenez, "Next generation post processing
// in Call of Duty: Advanced Warfare", SIGGRAPH 2014, slides 166 to 168.
// Inputs: color (nearest filter, clamped to the edge; display values, above 1 in HDR frames; alpha 0
// on plain background).
// Defines: OPERATOR 0 subtract, 1 keep, 2 soft; FLOATS if colours may be infinite or NaN; FIREFLIES;
// TAPS: most pixels that a texel touches along a side; WHOLE if texels have whole pixels; METERED if
// a texel holds stops by which the threshold is exposed. Starts with the light of tone_mapping.glsl.
//@bright
uniform sampler2D color;
uniform vec2 picture_size;  // pixels
uniform float texel_size;   // pixels
uniform vec3 limits;        // the threshold, and both ends of the soft step
uniform float background;   // 1 to include plain background
uniform float saturation;
uniform float firefly_reduction;
#if METERED
uniform sampler2D metered;
#endif
vec4 above(vec4 c, float threshold, vec2 ramp)
{
  vec3 s = c.rgb * clamp(c.a + background, 0.0, 1.0);
#if FLOATS
  s = clamp(s, 0.0, 10000.0);
#endif
  float b = dot(s, LUMINANCE);
#if OPERATOR == 0
  float share_above = max(b - threshold, 0.0) / max(b, 1e-9);
#elif OPERATOR == 1
  float share_above = b > threshold ? 1.0 : 0.0;
#else
  float t = clamp(b * ramp.x + ramp.y, 0.0, 1.0);
  float share_above = t * t * (3.0 - 2.0 * t);
#endif
  vec4 light = vec4(s * share_above, 1.0);
#if FIREFLIES
  light /= 1.0 + firefly_reduction * b * share_above;
#endif
#if FLOATS
  // Infinity would spoil all sums. Comparisons miss NaN: NVIDIA rewrites !(a < b).
  float total = c.r + c.g + c.b + c.a;
  light = isnan(total) || isinf(total) ? vec4(0.0) : light;
#endif
  return light;
}
void main()
{
  vec3 exposed = limits;
#if METERED
  exposed = to_display(to_light(limits) * exp2(-texelFetch(metered, ivec2(0), 0).r));
#endif
  float slope = 1.0 / max(exposed.z - exposed.y, 1e-6);
  vec2 ramp = vec2(slope, -exposed.y * slope);
  // Columns of nearest pixels: the fastest way to read a texel's pixels on llvmpipe, by a quarter.
  vec2 low = (gl_FragCoord.xy - 0.5) * texel_size, high = min(low + texel_size, picture_size);
  vec2 first = floor(low), pixel = 1.0 / picture_size;
  vec4 sum = vec4(vec3(0.0), 1e-9);
  for (int i = 0; i < TAPS; ++i)
  {
    for (int j = 0; j < TAPS; ++j)
    {
      vec2 at = first + vec2(i, j);
      vec4 light = above(textureLod(color, (at + 0.5) * pixel, 0.0), exposed.x, ramp);
#if WHOLE
      sum += light;
#else
      vec2 share = max(min(at + 1.0, high) - max(at, low), 0.0);
      sum += share.x * share.y * light;
#endif
    }
  }
  vec3 mean = sum.rgb / sum.a;
  mean = mix(vec3(dot(mean, LUMINANCE)), mean, saturation);
  gl_FragData[0] = vec4(mean, 1.0);
  gl_FragData[1] = vec4(1e9 * dot(mean, vec3(1.0)));
}
