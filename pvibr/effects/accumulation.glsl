// Accumulation: the mean of many pictures of a still view, each one sample per pixel.
// Display values are averaged: VTK sums lights and mixes translucent layers in display values, so
// the mean of many shadows is the shadow of many lights.

//@add
uniform sampler2D color;  // picture of one sample
void main()
{
  vec4 c = texelFetch(color, ivec2(gl_FragCoord.xy), 0);
  // Clamped to the display's range; NaN becomes black.
  gl_FragData[0] = vec4(
    c.r > 0.0 ? min(c.r, 1.0) : 0.0,
    c.g > 0.0 ? min(c.g, 1.0) : 0.0,
    c.b > 0.0 ? min(c.b, 1.0) : 0.0,
    clamp(c.a, 0.0, 1.0));
}
//@copy
uniform sampler2D color;
void main() { gl_FragData[0] = texelFetch(color, ivec2(gl_FragCoord.xy), 0); }
//@show
uniform sampler2D sum;
uniform sampler2D first;  // picture before all samples
uniform float count;
uniform float share;      // weight of the mean
void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 mean = texelFetch(sum, at, 0) / count;
  gl_FragData[0] = share < 1.0 ? mix(texelFetch(first, at, 0), mean, share) : mean;
}
