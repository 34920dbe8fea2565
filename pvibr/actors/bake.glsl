// Reduction of one row of supersampled views to atlas tiles.
// Averages scale x scale samples. Colour and normal are weighted by coverage (premultiplied), so
// that every further average, mip levels and bilinear taps included, stays right; depth is
// averaged over the covered samples only. Porter and Duff, "Compositing Digital Images", 1984.
// Inputs: surface (albedo rgb, coverage), shape (object-space normal * 0.5 + 0.5, depth 0 to 1).
// Defines: SCALE, samples along a side of a texel.
// Outputs: geometry (depth, coverage, nx, ny), albedo (r, g, b, nz); normals * 0.5 + 0.5.
uniform sampler2D surface;
uniform sampler2D shape;
const int scale = SCALE;
void main()
{
  ivec2 corner = ivec2(uv * vec2(textureSize(surface, 0))) / scale * scale;
  vec4 color = vec4(0.0);
  vec3 normal = vec3(0.0);
  float depth = 0.0;
  for (int j = 0; j < scale; ++j)
  {
    for (int i = 0; i < scale; ++i)
    {
      vec4 s = texelFetch(surface, corner + ivec2(i, j), 0);
      vec4 g = texelFetch(shape, corner + ivec2(i, j), 0);
      color += vec4(s.rgb * s.a, s.a);
      normal += (g.xyz * 2.0 - 1.0) * s.a;
      depth += g.w * s.a;
    }
  }
  float samples = float(scale * scale);
  float d = color.a > 0.0 ? depth / color.a : 0.5;
  vec3 n = normal / samples * 0.5 + 0.5;
  color /= samples;
  gl_FragData[0] = vec4(d, color.a, n.xy);
  gl_FragData[1] = vec4(color.rgb, n.z);
}
