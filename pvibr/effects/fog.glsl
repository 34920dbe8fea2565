// Fog: what is seen fades into the fog's colour with the air between. Air as dense everywhere, or
// denser below: exp(-height / scale), integrated along the ray in closed form, as by Quilez, "Better
// fog", iquilezles.org/articles/fog, 2010. Background stays as it is.
// Inputs: color, the picture so far; depth of the window, 0 near to 1 far; lengths in world units.
uniform sampler2D color;
uniform sampler2D depth;
uniform mat4 view_from_clip;
uniform int parallel;
uniform vec4 tint;  // colour; intensity
uniform vec3 air;   // where it begins; density at the base, per unit; one over the height scale
uniform vec4 rise;  // up in view space; height of the eye over the base
void main()
{
  vec4 c = texture(color, uv);
  gl_FragData[0] = c;
  float d = texture(depth, uv).r;
  if (d >= 1.0) return;
  vec4 to = view_from_clip * vec4(2.0 * vec3(uv, d) - 1.0, 1.0);
  vec3 seen = to.xyz / to.w;
  vec3 from = parallel == 1 ? vec3(seen.xy, 0.0) : vec3(0.0);
  float way = length(seen - from);
  vec3 ray = (seen - from) / max(way, 1e-30);
  from += ray * min(air.x, way);
  way = max(way - air.x, 0.0);
  // At both ends of the way, in height scales.
  float start = (rise.w + dot(rise.xyz, from)) * air.z;
  float climb = dot(rise.xyz, ray) * way * air.z;
  vec2 dense = exp(clamp(-vec2(start, start + climb), -80.0, 80.0));
  float mean = abs(climb) < 1e-3 ? dense.x * (1.0 - 0.5 * climb) : (dense.x - dense.y) / climb;
  float share = tint.a * (1.0 - exp(-air.y * way * mean));
  gl_FragData[0] = vec4(mix(c.rgb, tint.rgb, share), c.a);
}
