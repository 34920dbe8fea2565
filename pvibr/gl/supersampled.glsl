// The filter of vtkSSAAPass on two pictures at once, with and without annotations: along rows, then
// along columns; where annotations changed a pixel, it replaces the picture's. Both are of eight
// bits, as VTK's are, so what VTK drew comes out unchanged.
// Inputs: drawn (with annotations, alpha their coverage) and scene (without).

//@filtered
uniform sampler2D drawn;
uniform sampler2D scene;

// Lanczos kernel with two lobes, at multiples of 3/8 of a pixel.
vec4 filtered(sampler2D source, vec2 at, vec2 pace)
{
  float w[5] = float[](0.38026, 0.27667, 0.08074, -0.02612, -0.02143);
  vec4 sum = texture(source, at) * w[0];
  for (int k = 1; k < 5; k++)
    sum += (texture(source, at - float(k) * pace) + texture(source, at + float(k) * pace)) * w[k];
  return clamp(sum, 0.0, 1.0);
}
//@across
uniform float width;  // pixels
void main()
{
  vec2 pace = vec2(0.375 / width, 0.0);
  gl_FragData[0] = filtered(drawn, uv, pace);
  gl_FragData[1] = filtered(scene, uv, pace);
}
//@compose
uniform sampler2D picture;
vec3 rounded(vec3 c) { return floor(255.0 * c + 0.5) / 255.0; }
void main()
{
  vec2 size = vec2(textureSize(picture, 0)), pace = vec2(0.0, 0.375 / size.y);
  // From the centre of the first texel to that of the last, as vtkTextureObject copies.
  vec2 margin = 0.5 / vec2(textureSize(drawn, 0)), at = mix(margin, 1.0 - margin, uv);
  vec4 with = filtered(drawn, at, pace), before = filtered(scene, at, pace);
  vec4 below = texelFetch(picture, ivec2(uv * size), 0);
  float part = 1.0 - with.a;
  vec3 found = rounded(with.rgb) + part * (below.rgb - rounded(before.rgb));
  gl_FragData[0] = vec4(found, with.a + part * below.a);
}
