// A wide blur by a chain of ever smaller images: a wide kernel is a small one on a small image.
// halve: halves one axis by a Gaussian with an even number of texels, two per bilinear tap;
// symmetric, so that every texel contributes equally to either half.
// mix: blends a finer and a wider level.
// down13, tent: halve and double the size in one pass: J. Jimenez, "Next generation post
// processing in Call of Duty: Advanced Warfare", SIGGRAPH 2014, slides 153 to 162: 13 taps for five
// overlapping squares, the middle one weighted as the others together; a 3 x 3 tent.
// Images are mirrored at their edges: at 0 and at extent, which may be within the last texel.
// add: the light to blend with a picture.
// Inputs: image, wide (linear filter, clamped to the edge). Positions are in texels, so that odd
// sizes keep their scale. PAIRS taps with PLACES (texels from the middle) and WEIGHTS.
//@halve
uniform sampler2D image;
uniform vec2 axis;  // (1, 0) or (0, 1)
uniform vec2 extent;  // of the image, in texels
void main()
{
  vec2 texel = 1.0 / vec2(textureSize(image, 0));
  vec2 middle = gl_FragCoord.xy * (1.0 + axis);
  vec4 sum = vec4(min(uv.x, 0.0));
  for (int i = 0; i < PAIRS; ++i)
  {
    vec2 at = abs(middle + PLACES[i] * axis);
    sum += WEIGHTS[i] * texture(image, min(at, 2.0 * extent - at) * texel);
  }
  gl_FragData[0] = sum;
}
//@mix
uniform sampler2D image;
uniform sampler2D wide;
uniform float share;  // of the wider level
void main()
{
  vec2 place = 0.5 * gl_FragCoord.xy / vec2(textureSize(wide, 0));
  gl_FragData[0] = mix(texture(image, uv), texture(wide, place), share);
}
//@down13
uniform sampler2D image;
uniform vec2 extent;
void main()
{
  vec2 texel = 1.0 / vec2(textureSize(image, 0));
  vec2 middle = gl_FragCoord.xy * 2.0;
  vec4 sum = vec4(min(uv.x, 0.0));
  for (int j = -1; j <= 1; ++j)
  {
    for (int i = -1; i <= 1; ++i)
    {
      float weight = 0.03125 * float((2 - abs(i)) * (2 - abs(j)));
      vec2 at = abs(middle + 2.0 * vec2(i, j));
      sum += weight * texture(image, min(at, 2.0 * extent - at) * texel);
    }
  }
  for (int j = -1; j <= 1; j += 2)
  {
    for (int i = -1; i <= 1; i += 2)
    {
      vec2 at = abs(middle + vec2(i, j));
      sum += 0.125 * texture(image, min(at, 2.0 * extent - at) * texel);
    }
  }
  gl_FragData[0] = sum;
}
//@tent
uniform sampler2D image;
uniform sampler2D wide;
uniform vec2 extent;  // of wide
uniform float share;  // of the wider level
void main()
{
  vec2 texel = 1.0 / vec2(textureSize(wide, 0));
  vec4 sum = vec4(min(uv.x, 0.0));
  for (int j = -1; j <= 1; ++j)
  {
    for (int i = -1; i <= 1; ++i)
    {
      float weight = 0.0625 * float((2 - abs(i)) * (2 - abs(j)));
      vec2 at = abs(0.5 * gl_FragCoord.xy + vec2(i, j));
      sum += weight * texture(wide, min(at, 2.0 * extent - at) * texel);
    }
  }
  gl_FragData[0] = mix(texture(image, uv), sum, share);
}
//@add
uniform sampler2D light;
uniform vec2 place;    // size of the picture as a fraction of the light's
uniform vec2 shift;    // and its origin, as a fraction
uniform float intensity;
void main()
{
#if WHOLE  // llvmpipe samples a third faster at interpolated positions
  vec3 more = intensity * texture(light, uv).rgb;
#else
  vec3 more = intensity * texture(light, uv * place + shift).rgb;
#endif
  gl_FragData[0] = vec4(more, clamp(max(more.r, max(more.g, more.b)), 0.0, 1.0));
}
