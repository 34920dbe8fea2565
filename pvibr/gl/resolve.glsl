// Resolves the samples of a pixel as VTK does in a multisampled window (vtkOpenGLRenderWindow): the
// mean of light, with a display gamma of 2.2, and of alpha. Equal samples are returned to the bit.
// A scene drawn on black is composited with its background later, in display values: samples of
// different coverage are therefore averaged in display values there.
// Inputs: samples, COUNT of them; origin of the picture within them, pixels.
uniform sampler2DMS samples;
uniform vec2 origin;
uniform int on_black;
const vec3 GAMMA = vec3(2.2);
void main()
{
  ivec2 at = ivec2(origin + gl_FragCoord.xy);
  vec4 first = texelFetch(samples, at, 0), sum = first;
  bool same = true, covers = true;
  for (int i = 1; i < COUNT; i++)
  {
    vec4 one = texelFetch(samples, at, i);
    same = same && one == first;
    covers = covers && one.a == first.a;
    sum += one;
  }
  vec4 mean = sum / float(COUNT);
  // A loop: llvmpipe evaluates both branches of a condition, but ends loops early.
  int mixed = same || any(isnan(sum)) || on_black == 1 && !covers ? 0 : COUNT;
  vec3 light = vec3(0.0);
  for (int i = 0; i < mixed; i++)
    light += pow(max(texelFetch(samples, at, i).rgb, 0.0), GAMMA);
  for (int i = 0; i < min(mixed, 1); i++) mean.rgb = pow(light / float(COUNT), 1.0 / GAMMA);
  gl_FragData[0] = same ? first : mean;
}
