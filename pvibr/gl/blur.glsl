// Blur by a chain of ever smaller images: a wide kernel is a small one on a small image.
// halve: half the size along one axis by a Gaussian of an even number of texels, two to each
// bilinear tap. Symmetric, so that every texel gives the same share whichever half it is in.
// mix: what is finer and what is wider, as two parts of one. any: the largest over squares of 16
// texels, read back to skip what is dark. blend: blurred light onto a picture.
// Inputs: image, wide (linear filter, clamped to the edge); places are counted in texels, so that
// odd sizes keep their scale. PAIRS taps with PLACES (texels from the middle) and WEIGHTS.
//@halve
uniform sampler2D image;
uniform vec2 axis;  // (1, 0) or (0, 1)
void main()
{
  vec2 texel = 1.0 / vec2(textureSize(image, 0));
  vec2 middle = gl_FragCoord.xy * (1.0 + axis);
  vec4 sum = vec4(min(uv.x, 0.0));
  for (int i = 0; i < PAIRS; ++i)
  {
    sum += WEIGHTS[i] * texture(image, (middle + PLACES[i] * axis) * texel);
  }
  gl_FragData[0] = sum;
}
//@mix
uniform sampler2D image;
uniform sampler2D wide;
uniform float share;  // of what is wide
void main()
{
  vec2 place = 0.5 * gl_FragCoord.xy / vec2(textureSize(wide, 0));
  gl_FragData[0] = mix(texture(image, uv), texture(wide, place), share);
}
//@any
uniform sampler2D light;
void main()
{
  vec2 texel = 1.0 / vec2(textureSize(light, 0));
  vec4 most = vec4(min(uv.x, 0.0));
  for (int j = 0; j < 8; ++j)
  {
    for (int i = 0; i < 8; ++i)
    {
      most = max(most, texture(light, (gl_FragCoord.xy * 16.0 + 2.0 * vec2(i, j) - 7.0) * texel));
    }
  }
  gl_FragData[0] = most;
}
//@blend
uniform sampler2D color;
uniform sampler2D light;
uniform vec2 place;    // of a pixel in the light: one over its pixels
uniform float keep;    // 0: the light alone
uniform float intensity;
uniform float screen;  // 1: light fills what is left to white, and does not go beyond
void main()
{
  vec4 c = keep * texelFetch(color, ivec2(gl_FragCoord.xy), 0) + min(uv.x, 0.0);
  vec3 more = intensity * texture(light, gl_FragCoord.xy * place).rgb;
  more *= 1.0 - screen * clamp(c.rgb, 0.0, 1.0);
  gl_FragData[0] = vec4(c.rgb + more, max(c.a, max(more.r, max(more.g, more.b))));
}
