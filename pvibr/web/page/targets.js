// Framebuffers with what is drawn into them.
import { withoutArrays } from './programs.js';

// Of programs that cover the viewport.
export const VERTEX = `#version 300 es
out vec2 uv;
void main() {
  uv = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
  gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0);
}`;

export const COPY = `#version 300 es
precision highp float;
uniform sampler2D color;
in vec2 uv;
out vec4 fragOutput0;
void main() { fragOutput0 = vec4(texture(color, uv).rgb, 1.0); }`;

// A framebuffer with depth: renderbuffers of samples, or textures; `depth` is its format, if any,
// and `depthTexture` says whether programs read it.
export function target(gl, formats, options) {
  const { width, height, samples = 0, depth = gl.DEPTH_COMPONENT24, depthTexture } = options;
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  const buffer = (place, format) => {
    const made = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, made);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, made);
    return () => gl.deleteRenderbuffer(made);
  };
  const image = (place, format, filter) => {
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
      gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, place, gl.TEXTURE_2D, made, 0);
    return made;
  };
  const textures = [];
  const releases = [];
  const keep = (made) => {
    releases.push(() => gl.deleteTexture(made));
    return made;
  };
  let depthImage = null;
  if (depth && depthTexture) depthImage = keep(image(gl.DEPTH_ATTACHMENT, depth, gl.NEAREST));
  else if (depth) releases.push(buffer(gl.DEPTH_ATTACHMENT, depth));
  const filter = options.linear ? gl.LINEAR : gl.NEAREST;
  formats.forEach((format, i) => {
    const place = gl.COLOR_ATTACHMENT0 + i;
    if (samples) releases.push(buffer(place, format));
    else textures.push(keep(image(place, format, filter)));
  });
  gl.drawBuffers(formats.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  const release = () => [...releases, () => gl.deleteFramebuffer(frame)].forEach((f) => f());
  return { frame, textures, depth: depthImage, width, height, release };
}

// Copies what is in a framebuffer to another one; samples are resolved.
export function copy(gl, from, to, what, [width, height], [toWidth, toHeight] = [width, height]) {
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
  const filter = toWidth === width && toHeight === height ? gl.NEAREST : gl.LINEAR;
  gl.blitFramebuffer(0, 0, width, height, 0, 0, toWidth, toHeight, what, filter);
}

// Draws a triangle that covers the viewport.
export function cover(gl, program, groups, textures) {
  program.use(groups, textures);
  withoutArrays(gl);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}
