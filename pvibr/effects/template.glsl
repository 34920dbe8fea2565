// A template for an effect of your own: copy it, change it, and
//
//   pl.ibr.add(pvibr.ShaderEffect('my.glsl', amount=0.5, tint=(1, 0.9, 0.7)))
//
// The source has one function, `vec4 effect(vec2 uv)`, which returns the new colour of each pixel. It
// is GLSL 1.50 without `main`, may have other functions and constants, and declares no uniforms:
// each setting is one already, by its name (float, int, bool, vec2 to vec4 for tuples of 2 to 4; for
// choices their index, from 0), and so is each image (sampler2D, row 0 at the bottom).
//
//   uv                0 to 1 across the subplot, (0, 0) at the lower left; also in a large
//                     screenshot, which is drawn in tiles whose border pixels repeat outward
//   vec2 size         the subplot in pixels: vec2 pixel = uv * size
//   float scale       magnification of a large screenshot: width_in_pixels * scale
//   float time        pl.ibr.time in seconds
//   vec4 color_at(uv) the picture so far, bilinear: display colours from 0 to 1, above with
//                     needs_hdr. Alpha is the scene's coverage of the pixel, below 1 only where the
//                     background is visible; colours are premultiplied if that is transparent.
//                     Return alpha unchanged unless you draw over the background. NaN and infinity
//                     are read as 0.
//   float depth_at(uv)  distance along the view in world units; `nothing` (1e30) on background
//   vec3 normal_at(uv)  unit normal in view space (x right, y up, z to the eye); 0 on background
//                     and on surfaces without lighting
//   int id_at(uv)     index into pl.ibr.buffer_objects; -1 on background
//
// Normals and ids are those of opaque surfaces, drawn only if the source names them. The result is
// mixed with the picture by the effect's `intensity`; at 0 the effect does not run. Where the result
// is NaN or infinite, the pixel is unchanged.

vec4 effect(vec2 uv)
{
  vec4 c = color_at(uv);
  float gray = dot(c.rgb, vec3(0.2126, 0.7152, 0.0722));
  return vec4(mix(c.rgb, gray * tint, amount), c.a);
}
