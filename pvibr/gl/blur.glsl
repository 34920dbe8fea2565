// Blur by a chain of ever smaller images: a wide kernel is a small one on a small image.
// halve: half the size along one axis by a Gaussian of an even number of texels, two to each
// bilinear tap. Symmetric, so that every texel gives the same share whichever half it is in.
// mix: what is finer and what is wider, as two parts of one.
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
