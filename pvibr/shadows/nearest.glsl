// A pyramid of the nearest depth: each texel of a level has the least of two by two below it, or
// of four by four of the map in the first. All levels of a view lie side by side in a tile.

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
