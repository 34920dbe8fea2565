// Glow: chosen objects shine. source: their light where nothing hides them, averaged over squares
// of the picture. fade: what is left of the light of earlier frames, or this frame's where it is
// more.
// Inputs: glow (colour times intensity and coverage; linear filter), own (its depth) and scene (the
// depth of all), both window depth from 0 near to 1 far.
// Defines: TAPS along a side of a square, each at most 2 pixels wide; colour is that of 2 x 2
// pixels, depth of one of them.
//@source
uniform sampler2D glow;
uniform sampler2D own;
uniform sampler2D scene;
uniform vec2 pixels;      // of the picture
uniform float side;       // of a square, in pixels
uniform vec4 projection;  // the lower right 2 x 2 of clip from view, row by row
uniform vec2 pixel_size;  // world units, constant and by distance
float away(float depth)
{
  float z = 2.0 * depth - 1.0;
  return (z * projection.w - projection.y) / (projection.x - z * projection.z);
}
void main()
{
  float tap = side / float(TAPS);
  vec2 first = (gl_FragCoord.xy - 0.5) * side + 0.5 * tap;
  vec3 sum = vec3(min(uv.x, 0.0));
  for (int j = 0; j < TAPS; ++j)
  {
    for (int i = 0; i < TAPS; ++i)
    {
      vec2 place = (first + tap * vec2(i, j)) / pixels;
      // Half a pixel aside: within a pixel of both, not between four.
      float distance = -away(texture(own, place - 0.5 / vec2(textureSize(own, 0))).r);
      float hidden = -away(texture(scene, place - 0.5 / pixels).r);
      // Samples of a pixel differ by a slope: three pixels are no step.
      float step = 3.0 * (pixel_size.x + pixel_size.y * abs(distance));
      vec3 light = texture(glow, place).rgb;
      bool seen = distance <= hidden + step && dot(light, vec3(1.0)) < 1e9;
      sum += seen ? clamp(light, 0.0, 10000.0) : vec3(0.0);
    }
  }
  gl_FragData[0] = vec4(sum / float(TAPS * TAPS), 1.0);
  gl_FragData[1] = vec4(1e9 * dot(sum, vec3(1.0)));
}
//@fade
uniform sampler2D light;
uniform sampler2D past;
uniform float left;  // of the past, 0 to 1
void main()
{
  gl_FragData[0] = max(texture(light, uv), left * texture(past, uv));
  gl_FragData[1] = vec4(1e9 * dot(gl_FragData[0].rgb, vec3(1.0)));
}
