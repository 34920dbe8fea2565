// The colour of a pixel from its samples, as VTK resolves a multisampled window: the mean of light,
// by a display gamma of 2.2, and of alpha (vtkOpenGLRenderWindow). Where samples are the same it is
// theirs, to the bit. A scene drawn on black is composited with what is behind it later, in display
// values: there samples that cover different shares have the mean of display values, too.
// Inputs: samples, as many as `count`; origin of the picture within them, pixels.
uniform sampler2DMS samples;
uniform int count;
uniform vec2 origin;
uniform int on_black;
const vec3 GAMMA = vec3(2.2);
void main()
{
  ivec2 at = ivec2(origin + gl_FragCoord.xy);
  vec4 first = texelFetch(samples, at, 0), sum = first;
  vec3 light = pow(max(first.rgb, 0.0), GAMMA);
  bool same = true, covers = true;
  for (int i = 1; i < count; i++)
  {
    vec4 one = texelFetch(samples, at, i);
    same = same && one == first;
    covers = covers && one.a == first.a;
    sum += one;
    light += pow(max(one.rgb, 0.0), GAMMA);
  }
  vec4 mean = sum / float(count);
  bool linear = any(isnan(sum)) || on_black == 1 && !covers;
  if (!linear) mean.rgb = pow(light / float(count), 1.0 / GAMMA);
  gl_FragData[0] = same ? first : mean;
}
