// Mip levels of straight RGBA that mix in nothing transparent: Gortler et al., "The Lumigraph",
// SIGGRAPH 1996, section 3.4. pull: means weighted by alpha, premultiplied. push: straight colours,
// of the next smaller level where a texel is transparent.
// Inputs: from_straight, 1 if the colours of `image` are not premultiplied.
//@head
uniform sampler2D image;
uniform int from_straight;
//@pull
void main()
{
  ivec2 last = textureSize(image, 0) - 1;
  // Texels of odd sizes are shared.
  vec2 scale = vec2(last + 1) / max(floor(0.5 * vec2(last + 1)), 1.0);
  vec2 low = (gl_FragCoord.xy - 0.5) * scale, high = low + scale, first = floor(low + 1e-3);
  vec4 sum = vec4(0.0);
  for (int j = 0; j < 3; ++j)
  {
    for (int i = 0; i < 3; ++i)
    {
      vec2 at = first + vec2(i, j);
      vec2 share = max(min(at + 1.0, high) - max(at, low), 0.0);
      vec4 c = texelFetch(image, min(ivec2(at), last), 0);
      sum += share.x * share.y * (from_straight == 1 ? vec4(c.rgb * c.a, c.a) : c);
    }
  }
  gl_FragData[0] = sum / (scale.x * scale.y);
}
//@push
uniform sampler2D smaller;
void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 own = texelFetch(image, at, 0);
  vec3 wide = texelFetch(smaller, min(at / 2, textureSize(smaller, 0) - 1), 0).rgb;
  vec3 straight = from_straight == 1 ? own.rgb : own.rgb / max(own.a, 1e-6);
  gl_FragData[0] = vec4(own.a > 0.0 ? straight : wide, own.a);
}
