// Reduction of one row of supersampled views to atlas tiles.
// Averages SCALE x SCALE samples. Colour and normal are weighted by coverage (premultiplied), so
// that every further average, smaller levels and bilinear taps included, stays right; depth is
// averaged over the covered samples only. Porter and Duff, "Compositing Digital Images", 1984.
// Inputs: surface (albedo rgb times coverage, coverage), shape (object-space normal * 0.5 + 0.5,
// depth 0 to 1; all 0 where nothing is): an average of both is one bilinear tap for 2 x 2 samples.
// Outputs: geometry (depth, coverage, nx, ny), albedo (r, g, b, nz); normals * 0.5 + 0.5.
// Defines: SCALE, samples along a side of a texel: 1 or even.
uniform sampler2D surface;
uniform sampler2D shape;
void main()
{
#if SCALE == 1
  vec4 s = texture(surface, uv);
  vec4 g = texture(shape, uv);
#else
  vec4 s = vec4(0.0);
  vec4 g = vec4(0.0);
  vec2 tap = 2.0 / vec2(textureSize(surface, 0));
  vec2 first = uv - tap * (0.25 * float(SCALE) - 0.5);
  for (int j = 0; j < SCALE / 2; ++j)
  {
    for (int i = 0; i < SCALE / 2; ++i)
    {
      s += texture(surface, first + tap * vec2(i, j));
      g += texture(shape, first + tap * vec2(i, j));
    }
  }
  s *= 4.0 / float(SCALE * SCALE);
  g *= 4.0 / float(SCALE * SCALE);
#endif
  vec3 n = g.xyz - 0.5 * s.a + 0.5;
  gl_FragData[0] = vec4(s.a > 0.0 ? g.w / s.a : 0.5, s.a, n.xy);
  gl_FragData[1] = vec4(s.rgb, n.z);
}
