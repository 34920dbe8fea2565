// Full-screen layers over the picture or behind the scene.
// Inputs: color, the picture so far, whose alpha is the scene's coverage of a pixel; tile, the part
// of the subplot that is drawn now (left, bottom, right, top as fractions; large screenshots are
// drawn in tiles). Other inputs are declared at each entry point.
//@common
uniform sampler2D color;
uniform vec4 tile;
vec2 place() { return mix(tile.xy, tile.zw, uv); }  // in the whole subplot, 0 to 1
void cover(vec3 layer, float alpha) {
  if (alpha <= 0.0) discard;
  gl_FragData[0] = vec4(layer, alpha);
}

//@vignette
uniform vec3 tint;
uniform vec4 corner_offset;  // half diagonals: centre to lower left corner; to the opposite one
uniform vec3 ring;  // radius and softness in half diagonals; intensity
void main() {
  vec4 c = texture(color, uv);
  float radius = length(corner_offset.xy + corner_offset.zw * uv);
  float shade = ring.z * smoothstep(ring.x, ring.x + ring.y, radius);
  gl_FragData[0] = vec4(mix(c.rgb, tint, shade), c.a);
}

//@flash
uniform vec3 tint;
uniform float opacity;
void main() { cover(tint, opacity); }

//@night_vision
uniform vec3 tint;
uniform vec3 tube;  // gain, grain, intensity
uniform int grain_number;
uniform vec2 grid;  // window size, pixels: grain keeps its size in large screenshots
// Jarzynski and Olano, "Hash functions for GPU rendering", JCGT 9(3), 2020: pcg.
uint hashed(uint n) {
  n = n * 747796405u + 2891336453u;
  n = ((n >> ((n >> 28u) + 4u)) ^ n) * 277803737u;
  return (n >> 22u) ^ n;
}
void main() {
  vec4 c = texture(color, uv);
  float y = dot(max(c.rgb, 0.0), vec3(0.2126, 0.7152, 0.0722));
  float shine = (1.0 - exp(-tube.x * y)) / (1.0 - exp(-tube.x));
  uvec2 pixel = uvec2(place() * grid);
  uint n = hashed(pixel.x + hashed(pixel.y + hashed(uint(grain_number))));
  shine += tube.y * (float(n >> 8) / 16777216.0 - 0.5);
  gl_FragData[0] = vec4(mix(c.rgb, tint * clamp(shine, 0.0, 1.0), tube.z), c.a);
}

// Signed distance of p, in pixels from the centre, inside an opening whose inscribed circle has the
// radius r.
//@disk
float inside(vec2 p, float r) { return r - length(p); }

//@shape
uniform sampler2D shape;  // signed distance, inside > 0, in radii of its inscribed circle
uniform vec4 shape_circle;  // that circle in uv: centre, radius along each side
float inside(vec2 p, float r) {
  return textureLod(shape, shape_circle.xy + shape_circle.zw * p / max(r, 1e-3), 0.0).r * r;
}

//@iris
uniform vec3 tint;
uniform vec4 corner_offset;  // pixels: centre to lower left corner; to the opposite one
uniform vec2 opening;  // pixels: radius of the inscribed circle; one over the width of the edge
void main() {
  float inner = inside(corner_offset.xy + corner_offset.zw * uv, opening.x) * opening.y;
  if (inner >= 1.0) discard;
  gl_FragData[0] = vec4(tint, 1.0 - max(inner, 0.0));
}

//@image
uniform sampler2D image;
uniform vec4 image_rect;  // edges in the subplot
uniform vec4 bounds;  // the part of the subplot that it may cover
uniform float opacity;
vec4 picture() {
  vec2 at = place();
  vec4 k = texture(image, (at - image_rect.xy) / (image_rect.zw - image_rect.xy));
  vec2 low = max(image_rect.xy, bounds.xy), high = min(image_rect.zw, bounds.zw);
  bool covered = all(greaterThanEqual(at, low)) && all(lessThanEqual(at, high));
  return vec4(k.rgb, covered ? opacity * k.a : 0.0);
}

//@picture
void main() {
  vec4 k = picture();
  cover(k.rgb, k.a);
}

//@mixed
uniform int mode;
void main() {
  vec4 c = texture(color, uv);
  vec4 k = picture();
  vec3 light = k.rgb * k.a;
  if (mode == 1) gl_FragData[0] = vec4(c.rgb + light, c.a);
  else if (mode == 2) gl_FragData[0] = vec4(c.rgb * mix(vec3(1.0), k.rgb, k.a), c.a);
  else gl_FragData[0] = vec4(c.rgb + light * max(1.0 - c.rgb, 0.0), c.a);
}

//@behind
uniform vec3 low;  // the renderer's own background: bottom, top
uniform vec3 high;
// The scene c was drawn on black: add what shows through it, and keep alpha.
vec4 behind(vec4 c, vec4 k) {
  return vec4(c.rgb + (1.0 - c.a) * mix(mix(low, high, place().y), k.rgb, k.a), c.a);
}

//@backdrop
void main() { gl_FragData[0] = behind(texture(color, uv), picture()); }

// The colour of a direction, z up; rise: elevation, -1 to 1.
//@gradient
uniform vec3 top;
uniform vec3 horizon;
uniform vec3 bottom;
uniform float bend;
vec3 sky(vec3 to, float rise) {
  float share = abs(rise) / (1.0 + bend * (1.0 - abs(rise)));
  return mix(horizon, rise > 0.0 ? top : bottom, share);
}

//@panorama
uniform sampler2D panorama;
vec3 sky(vec3 to, float rise) {
  vec2 at = vec2(0.5 - atan(to.y, to.x) / 6.2831853, 0.5 + 0.5 * rise);
  return textureLod(panorama, at, 0.0).rgb;
}

//@sky
uniform mat3 sky_from_clip;  // takes (x, y, 1) in this tile to a direction
uniform vec2 amount;  // opacity, intensity
void main() {
  vec4 c = texture(color, uv);
  gl_FragData[0] = c;
  if (c.a >= 1.0) return;
  vec3 to = normalize(sky_from_clip * vec3(2.0 * uv - 1.0, 1.0));
  float rise = asin(clamp(to.z, -1.0, 1.0)) / 1.5707963;
  gl_FragData[0] = behind(c, vec4(amount.y * sky(to, rise), amount.x));
}
