// A pyramid of the nearest depth: each texel has the least of 2 x 2 in the level below, in the first
// level of 4 x 4 in the map. All levels of a view lie side by side in a tile.

void main()
{
  vec2 here = floor(uv * size);
  float least = 1.0;
  for (int j = 0; j < STEP; ++j)
    for (int i = 0; i < STEP; ++i)
    {
      vec2 p = float(STEP) * here + vec2(i, j);
      if (max(p.x, p.y) < side) least = min(least, texelFetch(source, ivec2(corner + p), 0).r);
    }
  gl_FragData[0] = vec4(least);
}
