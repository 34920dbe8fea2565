// Fog: surfaces fade into the fog's colour with the air in between, which is uniform or thins out
// with height as exp(-height / scale), integrated along the ray in closed form: Quilez, "Better fog",
// iquilezles.org/articles/fog, 2010. The background is unchanged.
// Inputs: color, the picture so far; window depth, 0 near to 1 far; lengths in world units.
uniform sampler2D color;
uniform sampler2D depth;
uniform mat4 view_from_clip;
uniform int parallel;
uniform vec4 tint;  // colour; intensity
uniform vec3 air;   // distance at which fog begins; density at the base; one over the height scale
uniform vec4 rise;  // up in view space; height of the eye above the base
void main()
{
  vec4 c = texture(color, uv);
  gl_FragData[0] = c;
  float d = texture(depth, uv).r;
  if (d >= 1.0) return;
  vec4 to = view_from_clip * vec4(2.0 * vec3(uv, d) - 1.0, 1.0);
  vec3 surface = to.xyz / to.w;
  vec3 from = parallel == 1 ? vec3(surface.xy, 0.0) : vec3(0.0);
  float way = length(surface - from);
  vec3 ray = (surface - from) / max(way, 1e-30);
  from += ray * min(air.x, way);
  way = max(way - air.x, 0.0);
  // Heights of both ends of the ray, in height scales.
  float start = (rise.w + dot(rise.xyz, from)) * air.z;
  float climb = dot(rise.xyz, ray) * way * air.z;
  vec2 dense = exp(clamp(-vec2(start, start + climb), -80.0, 80.0));
  float mean = abs(climb) < 1e-3 ? dense.x * (1.0 - 0.5 * climb) : (dense.x - dense.y) / climb;
  float share = tint.a * (1.0 - exp(-air.y * way * mean));
  gl_FragData[0] = vec4(mix(c.rgb, tint.rgb, share), c.a);
}
