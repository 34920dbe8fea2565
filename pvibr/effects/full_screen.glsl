// Billboards that fill a subplot: what lies over the picture, and what lies behind the scene.
// Inputs of all: color, the picture so far, whose alpha is how much of a pixel the scene covers;
// tile, the shares of the subplot that are drawn now (left, bottom, right, top: large screenshots
// are drawn in tiles); size, the whole subplot in pixels. Further ones at each entry point.
//@common
uniform sampler2D color;
uniform vec4 tile;
uniform vec2 size;
vec2 place() { return mix(tile.xy, tile.zw, uv); }  // in the whole subplot, 0 to 1
void cover(vec3 sheet, float much) {
  if (much <= 0.0) discard;
  gl_FragData[0] = vec4(sheet, much);
}

//@vignette
uniform vec3 tint;
uniform vec4 away;  // from the middle, in half diagonals: of the lower left corner; to the other
uniform vec3 ring;  // radius and softness as shares of half the diagonal; intensity
void main() {
  vec4 c = texture(color, uv);
  float far = length(away.xy + away.zw * uv);
  float dark = ring.z * smoothstep(ring.x, ring.x + ring.y, far);
  gl_FragData[0] = vec4(mix(c.rgb, tint, dark), c.a);
}

//@flash
uniform vec3 tint;
uniform float much;
void main() { cover(tint, much); }

//@night_vision
uniform vec3 tint;
uniform vec3 tube;  // gain, grain, intensity
uniform int moment;  // another one, another grain
uniform vec2 grid;  // pixels of the window: grain is as large in large screenshots
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
  uint n = hashed(pixel.x + hashed(pixel.y + hashed(uint(moment))));
  shine += tube.y * (float(n >> 8) / 16777216.0 - 0.5);
  gl_FragData[0] = vec4(mix(c.rgb, tint * clamp(shine, 0.0, 1.0), tube.z), c.a);
}

// What is open: how far p, in pixels from the middle, is within an opening whose inner circle has
// the radius r.
//@disk
float inside(vec2 p, float r) { return r - length(p); }

//@shape
uniform sampler2D shape;  // distance to its edge, inside > 0; 1 is the radius of its inner circle
uniform vec4 scale;  // of that circle: the middle, and the radius along both sides
float inside(vec2 p, float r) {
  return textureLod(shape, scale.xy + scale.zw * p / max(r, 1e-3), 0.0).r * r;
}

//@iris
uniform vec3 tint;
uniform vec4 away;  // from the middle, in pixels: of the lower left corner; from there to the other
uniform vec2 reach;  // of the opening's inner circle; one over the width of its edge; in pixels
void main() {
  float deep = inside(away.xy + away.zw * uv, reach.x) * reach.y;
  if (deep >= 1.0) discard;
  gl_FragData[0] = vec4(tint, 1.0 - max(deep, 0.0));
}

//@image
uniform sampler2D image;
uniform vec4 frame;  // where its edges are in the subplot
uniform vec4 bounds;  // what of the subplot it may cover
uniform float opacity;
vec4 picture() {
  vec2 at = place();
  vec4 k = texture(image, (at - frame.xy) / (frame.zw - frame.xy));
  vec2 low = max(frame.xy, bounds.xy), high = min(frame.zw, bounds.zw);
  bool seen = all(greaterThanEqual(at, low)) && all(lessThanEqual(at, high));
  return vec4(k.rgb, seen ? opacity * k.a : 0.0);
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
uniform vec3 low;  // the background that was there: below, above
uniform vec3 high;
// The scene c was drawn on black: what shows through it is added, and alpha stays.
vec4 behind(vec4 c, vec4 k) {
  return vec4(c.rgb + (1.0 - c.a) * mix(mix(low, high, place().y), k.rgb, k.a), c.a);
}

//@backdrop
void main() { gl_FragData[0] = behind(texture(color, uv), picture()); }

// Colours of a direction, z up; how far it rises, -1 to 1.
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
uniform mat3 sky_from_clip;  // of (x, y, 1) in what is drawn now: to a direction
uniform vec2 amount;  // opacity, intensity
void main() {
  vec4 c = texture(color, uv);
  gl_FragData[0] = c;
  if (c.a >= 1.0) return;
  vec3 to = normalize(sky_from_clip * vec3(2.0 * uv - 1.0, 1.0));
  float rise = asin(clamp(to.z, -1.0, 1.0)) / 1.5707963;
  gl_FragData[0] = behind(c, vec4(amount.y * sky(to, rise), amount.x));
}
