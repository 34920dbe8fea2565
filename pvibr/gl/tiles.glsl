// A program drawn only over the tiles of a target that contain something to draw.

//@squares
// Whether anything is within reach of each square of SIDE pixels.
uniform sampler2D found;     // non-zero: something
uniform int step;            // side of its texels, pixels
uniform int reach;           // pixels
void main()
{
  ivec2 low = ivec2(gl_FragCoord.xy) * SIDE - reach, last = textureSize(found, 0) - 1;
  ivec2 high = min((low + SIDE - 1 + 2 * reach) / step, last);
  low = max(low, ivec2(0)) / step;
  vec4 most = vec4(0.0);
  for (int j = low.y; j <= high.y; ++j)
    for (int i = low.x; i <= high.x; ++i)
      most = max(most, texelFetch(found, ivec2(i, j), 0));
  gl_FragData[0] = vec4(most != vec4(0.0));
}

//@tiles
// Whether anything is in each tile of squares.
uniform sampler2D squares;
uniform int side;            // side, squares
void main()
{
  ivec2 low = ivec2(gl_FragCoord.xy) * side;
  ivec2 high = min(low + side, textureSize(squares, 0));
  float most = 0.0;
  for (int j = low.y; j < high.y; ++j)
    for (int i = low.x; i < high.x; ++i)
      most = max(most, texelFetch(squares, ivec2(i, j), 0).r);
  gl_FragData[0] = vec4(most);
}

//@geometry
// Turns each of the two full-screen triangles into half of the tiles' rectangles.
layout(triangles) in;
layout(triangle_strip, max_vertices = 256) out;
uniform sampler2D tiles;
uniform vec2 extent;         // of a tile, in normalised device coordinates
void main()
{
  ivec2 size = textureSize(tiles, 0);
  int total = size.x * size.y, some = (total + 1) / 2, first = gl_PrimitiveIDIn * some;
  for (int k = first; k < min(first + some, total); ++k)
  {
    ivec2 tile = ivec2(k % size.x, k / size.x);
    if (texelFetch(tiles, tile, 0).r < 0.5) continue;
    for (int i = 0; i < 4; ++i)
    {
      gl_Position = vec4(extent * vec2(tile + ivec2(i % 2, i / 2)) - 1.0, 0.0, 1.0);
      EmitVertex();
    }
    EndPrimitive();
  }
}
