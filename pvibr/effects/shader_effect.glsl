// Inputs and call of a user's effect, documented in template.glsl. Sections: head before the user's
// source, surface if the source names it, main after it.

//@head
uniform sampler2D ibr_color;
uniform sampler2D ibr_depth;
uniform vec4 ibr_tile;    // the part of the subplot drawn now: left, bottom, right, top
uniform vec3 ibr_planes;  // distances of near and far plane; 1 if the projection is parallel
uniform float ibr_intensity;
uniform vec2 size;
uniform float time;
uniform float scale;
const float nothing = 1e30;
vec2 ibr_place(vec2 uv) { return (uv - ibr_tile.xy) / (ibr_tile.zw - ibr_tile.xy); }
float ibr_number(float x) { return abs(x) < 1e30 ? x : 0.0; }  // NaN fails every comparison
vec4 color_at(vec2 uv) {
  vec4 c = texture(ibr_color, ibr_place(uv));
  return vec4(ibr_number(c.r), ibr_number(c.g), ibr_number(c.b), ibr_number(c.a));
}
ivec2 ibr_pixel(vec2 uv) {
  ivec2 last = textureSize(ibr_depth, 0) - 1;
  return clamp(ivec2(floor(ibr_place(uv) * vec2(last + 1))), ivec2(0), last);
}
float depth_at(vec2 uv) {
  float d = texelFetch(ibr_depth, ibr_pixel(uv), 0).r;
  if (d >= 1.0) return nothing;
  if (ibr_planes.z > 0.5) return mix(ibr_planes.x, ibr_planes.y, d);
  return ibr_planes.x * ibr_planes.y / (ibr_planes.y - d * (ibr_planes.y - ibr_planes.x));
}

//@surface
uniform sampler2D ibr_surface;  // see pvibr/things/buffers.py
uniform vec2 ibr_corner;        // of the picture in it, in texels
vec4 ibr_surface_at(vec2 uv) {
  return texelFetch(ibr_surface, ibr_pixel(uv) + ivec2(ibr_corner), 0);
}
vec3 normal_at(vec2 uv) {
  vec4 t = ibr_surface_at(uv);
  if (t.a <= 0.0 || t.x > 1.5) return vec3(0.0);
  return vec3(t.xy, sqrt(max(1.0 - dot(t.xy, t.xy), 0.0)) * sign(t.z));
}
int id_at(vec2 uv) {
  vec4 t = ibr_surface_at(uv);
  return t.a > 0.0 ? int(abs(t.z) + 0.5) - 1 : -1;
}

//@main
void main() {
  vec4 before = texture(ibr_color, uv);
  vec4 after = effect(mix(ibr_tile.xy, ibr_tile.zw, uv));
  bool is_finite = all(lessThan(abs(after), vec4(1e30)));
  gl_FragData[0] = is_finite ? mix(before, after, ibr_intensity) : before;
}
