// Accumulation: the mean of pictures of a still view, each a sample of every pixel.
// What is averaged are display values: in VTK lights and layers of translucent things are sums and
// mixtures of these, so that the mean of many shadows is the shadow of many lights.

//@add
uniform sampler2D color;  // the picture of a sample
void main()
{
  vec4 c = texelFetch(color, ivec2(gl_FragCoord.xy), 0);
  // As far as a display shows it; NaN is black.
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
uniform sampler2D first;  // the picture before all samples
uniform float count;
uniform float share;      // of the mean
void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 mean = texelFetch(sum, at, 0) / count;
  gl_FragData[0] = share < 1.0 ? mix(texelFetch(first, at, 0), mean, share) : mean;
}
