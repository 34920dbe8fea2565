// Blurred moments of depth, which filtered shadow maps hold in place of depth.
// First pass: depth of 2 x 2 texels to moments, blurred along x; second pass: along y.

float linear_depth(float d)
{
  return parallel == 1 ? d : near * d / (far - d * (far - near));
}

vec4 moments(float t)
{
#if KIND == 1
  // Donnelly and Lauritzen, "Variance shadow maps", I3D 2006.
  return vec4(t, t * t, 0.0, 1.0);
#elif KIND == 2
  // Lauritzen and McCool, "Layered variance shadow maps", 2008: exponential variance, two warps.
  float a = exp(WARP * (2.0 * t - 1.0));
  float b = -exp(-WARP * (2.0 * t - 1.0));
  return vec4(a, a * a, b, b * b);
#else
  // Peters and Klein, "Moment shadow mapping", I3D 2015.
  float s = t * t;
  return vec4(t, s, s * t, s * s);
#endif
}

vec4 moments_at(vec2 at)
{
#if FIRST
  vec4 sum = vec4(0.0);
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i)
    {
      vec2 p = clamp(2.0 * at + vec2(i, j), 2.0 * corner, 2.0 * (corner + side) - 1.0);
      sum += moments(linear_depth(texelFetch(source, ivec2(p), 0).r));
    }
  return 0.25 * sum;
#else
  return texelFetch(source, ivec2(clamp(at, corner, corner + side - 1.0)), 0);
#endif
}

void main()
{
  vec2 here = corner + floor(uv * side);
  vec4 sum = moments_at(here);
  float weight = 1.0;
  for (int i = 1; i <= reach; ++i)
  {
    float w = exp(-0.5 * float(i * i) / (sigma * sigma));
    vec2 d = (FIRST == 1 ? vec2(1.0, 0.0) : vec2(0.0, 1.0)) * float(i);
    sum += w * (moments_at(here - d) + moments_at(here + d));
    weight += 2.0 * w;
  }
  gl_FragData[0] = sum / weight;
}
