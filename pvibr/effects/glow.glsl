// Glow of chosen objects. source: their light where nothing hides them, averaged per texel. fade:
// the maximum of this frame's light and what remains of earlier frames.
// Inputs: glow (colour times weight and coverage; linear filter); glow_depth and scene_depth, window
// depth from 0 near to 1 far.
// Defines: TAPS along a side of a texel, each at most 2 pixels wide: a tap reads the colour of 2 x 2
// pixels and the depth of one of them.
//@source
uniform sampler2D glow;
uniform sampler2D glow_depth;
uniform sampler2D scene_depth;
uniform vec2 picture_size;  // pixels
uniform float texel_size;   // pixels
uniform vec4 projection;    // the lower right 2 x 2 of clip from view, row by row
uniform vec2 pixel_size;    // world units: constant part, and per distance
float view_distance(float depth)
{
  float z = 2.0 * depth - 1.0;
  return (z * projection.w - projection.y) / (projection.x - z * projection.z);
}
void main()
{
  float tap = texel_size / float(TAPS);
  vec2 first = (gl_FragCoord.xy - 0.5) * texel_size + 0.5 * tap;
  vec3 sum = vec3(min(uv.x, 0.0));
  for (int j = 0; j < TAPS; ++j)
  {
    for (int i = 0; i < TAPS; ++i)
    {
      vec2 place = (first + tap * vec2(i, j)) / picture_size;
      // Half a pixel aside: inside one pixel of both, not at the corner of four.
      vec2 glow_place = place - 0.5 / vec2(textureSize(glow_depth, 0));
      float glow_distance = -view_distance(texture(glow_depth, glow_place).r);
      float scene_distance = -view_distance(texture(scene_depth, place - 0.5 / picture_size).r);
      // Multisamples differ along slopes: three pixel sizes are no depth step.
      float tolerance = 3.0 * (pixel_size.x + pixel_size.y * abs(glow_distance));
      vec3 light = texture(glow, place).rgb;
      bool is_visible = glow_distance <= scene_distance + tolerance && dot(light, vec3(1.0)) < 1e9;
      sum += is_visible ? clamp(light, 0.0, 10000.0) : vec3(0.0);
    }
  }
  gl_FragData[0] = vec4(sum / float(TAPS * TAPS), 1.0);
  gl_FragData[1] = vec4(1e9 * dot(sum, vec3(1.0)));
}
//@fade
uniform sampler2D light;
uniform sampler2D past;
uniform float remaining;  // fraction of the past light
void main()
{
  gl_FragData[0] = max(texture(light, uv), remaining * texture(past, uv));
  gl_FragData[1] = vec4(1e9 * dot(gl_FragData[0].rgb, vec3(1.0)));
}
