// A template for an effect of your own: copy it, change it, and
//
//   pl.ibr.add(pvibr.ShaderEffect('my.glsl', amount=0.5, tint=(1, 0.9, 0.7)))
//
// The text has one function, `vec4 effect(vec2 uv)`, called for each pixel; what it returns is the
// pixel's new colour. It is GLSL 1.50 without `main`, may have functions and constants of its own,
// and declares no uniform: each setting is one already, by its name (float, int, bool, vec2 to
// vec4 for a tuple of 2 to 4; of choices the number, from 0), and so is each image (sampler2D,
// row 0 at the bottom).
//
//   uv                from 0 to 1 across the subplot, (0, 0) its lower left corner; the same in a
//                     large screenshot, which is drawn in tiles: within a tile, what lies beyond
//                     its border is not known, and its border is repeated
//   vec2 size         the subplot in pixels: vec2 pixel = uv * size
//   float scale       a large screenshot has so many times more pixels: width_in_pixels * scale
//   float time        pl.ibr.time in seconds
//   vec4 color_at(uv) the picture so far, bilinear. Red, green and blue are those of the display,
//                     from 0 to 1, above with needs_hdr. Alpha is how much of the pixel the scene
//                     covers, below 1 only where the background is to be seen; colours are
//                     multiplied by it where that is transparent. Return it as it is, unless you
//                     draw over the background. Where it is no number (NaN, infinity), it is 0.
//   float depth_at(uv)  distance along the view in world units; `nothing` (1e30) where nothing is
//   vec3 normal_at(uv)  normal in view space (x right, y up, z to the eye), length 1; 0 where
//                     nothing is or what is there is not lit
//   int id_at(uv)     which of pl.ibr.buffer_objects it is; -1 where nothing is
//
// Normals and ids are those of opaque surfaces. They are drawn only where the text names them.
// The result is mixed with the picture by the effect's `intensity`; at 0 it is not called at all.
// Where it is no number, the pixel stays.

vec4 effect(vec2 uv)
{
  vec4 c = color_at(uv);
  float gray = dot(c.rgb, vec3(0.2126, 0.7152, 0.0722));
  return vec4(mix(c.rgb, gray * tint, amount), c.a);
}
