// Image effects: a subplot's scene in textures of its own, and pvibr's programs over these.
import { COPY, VERTEX, copy, cover, target } from './targets.js';
import { texture } from './programs.js';
import { inverse } from './views.js';

const ENDLESS = 1e9;
const columns = (m) => [0, 1, 2, 3].map((j) => m.slice(4 * j, 4 * j + 4));

// Directions in eye space of (x, y, 1) on the screen, by columns; see backgrounds.py.
function rays({ parallel, clipFromEye, tangent, center: [cx, cy], width, height }) {
  if (parallel) {
    const [a, b] = [(tangent * width) / height, tangent];
    return [a, 0, 0, 0, b, 0, a * cx, b * cy, -1];
  }
  const [x, y, z, w] = columns(inverse(clipFromEye));
  const near = w.map((value, i) => value - z[i]);
  return [x, y, near].flatMap((column) => column.slice(0, 3).map((value) => value / near[3]));
}

// Uniforms that follow the camera or the size of the picture, by kind.
const KINDS = {
  view_from_clip: ({ clipFromEye }) => inverse(clipFromEye),
  parallel: ({ parallel }) => Number(parallel),
  planes: ({ near, far }) => [near, far],
  rise({ eyeFromWorld: m }, up, base) {
    const r = [0, 1, 2].map((i) => m[i] * up[0] + m[4 + i] * up[1] + m[8 + i] * up[2]);
    return [...r, -(r[0] * m[12] + r[1] * m[13] + r[2] * m[14]) - base];
  },
  sky(view, axes) {
    const r = view.rotation; // by columns, so that rows of its transpose
    const [k, product] = [rays(view), []];
    for (let j = 0; j < 3; j++) {
      const world = [0, 1, 2].map(
        (i) => r[3 * i] * k[3 * j] + r[3 * i + 1] * k[3 * j + 1] + r[3 * i + 2] * k[3 * j + 2],
      );
      product.push(...axes.map((a) => a[0] * world[0] + a[1] * world[1] + a[2] * world[2]));
    }
    return product;
  },
  lens({ clipFromEye: c, parallel }) {
    const [a, b] = [1 / c[0], 1 / c[5]];
    const [x, y] = parallel ? [-c[12], -c[13]] : [c[8], c[9]];
    return [a, b, a * x, b * y];
  },
  outline_lens: ({ clipFromEye: c, parallel }) =>
    parallel ? [0, 0, 0, 0] : [1 / c[0], 1 / c[5], c[8], c[9]],
  pixel: ({ pixelScale, parallel }) =>
    parallel ? [1 / pixelScale, 0, 1] : [0, 1 / pixelScale, 0],
  half_diagonals({ width, height }, [x, y]) {
    const half = Math.hypot(width, height) / 2;
    return [-x * width, -y * height, width, height].map((value) => value / half);
  },
  picture_size: ({ width, height }) => [width, height],
  texel_size: ({ height }, rows) => height / rows,
  extent({ width, height }, rows, level, axis) {
    const scale = rows / height / 2 ** level;
    return [axis === 1 ? ENDLESS : width * scale, axis === 0 ? ENDLESS : height * scale];
  },
  light_place({ width, height }, rows) {
    const texel = height / rows;
    return [width, height].map((n) => n / (2 * texel * Math.ceil(texels(n, texel) / 2)));
  },
};

const texels = (pixels, texel) => Math.ceil(pixels / texel - 1e-6);
const BLENDS = {
  over: ['SRC_ALPHA', 'ONE_MINUS_SRC_ALPHA', 'ONE', 'ONE_MINUS_SRC_ALPHA'],
  add: ['ONE', 'ONE', 'ONE_MINUS_DST_ALPHA', 'ONE'],
  screen: ['ONE_MINUS_DST_COLOR', 'ONE', 'ONE_MINUS_DST_ALPHA', 'ONE'],
};

export class Stage {
  constructor(gl, programs, tree, names) {
    Object.assign(this, { gl, programs, tree, targets: {} });
    const floats = gl.getExtension('EXT_color_buffer_float');
    const halves = floats ?? gl.getExtension('EXT_color_buffer_half_float');
    this.format = halves ? gl.RGBA16F : gl.RGBA8;
    this.images = { white: pixel(gl, [255, 255, 255, 255]) };
    tree.passes.forEach(({ textures }, number) => {
      for (const [name, source] of Object.entries(textures))
        if (typeof source !== 'string')
          this.images[`${number} ${name}`] = source.names
            ? marks(gl, names, source.names)
            : image(gl, source);
    });
  }

  // What a subplot is drawn into, of a size.
  begin(width, height, samples) {
    const { gl } = this;
    if (this.width !== width || this.height !== height || this.samples !== samples) {
      Object.values(this.targets).forEach(({ release }) => release());
      Object.assign(this, { width, height, samples });
      const size = { width, height };
      const format = this.tree.floats ? this.format : gl.RGBA8;
      const none = { ...size, depth: null, linear: true };
      this.targets = {
        scene: target(gl, [format], { ...size, samples }),
        drawn: target(gl, [format], { ...size, depthTexture: true }),
        0: target(gl, [this.format], none),
        1: target(gl, [this.format], none),
      };
      if (this.tree.surfaces)
        this.targets.surfaces = target(gl, [this.format], { ...size, depthTexture: true });
    }
    return this.targets.scene.frame;
  }

  // Draws the effects over the scene, and then the picture into a rectangle of a framebuffer.
  finish(view, frame, rectangle) {
    const { gl, tree, targets } = this;
    gl.disable(gl.SCISSOR_TEST);
    const both = gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT;
    copy(gl, targets.scene.frame, targets.drawn.frame, both, [this.width, this.height]);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    this.picture = targets.drawn;
    tree.passes.forEach((pass, number) => this.draw(pass, number, view));
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(...rectangle);
    const program = this.programs.of({ vertex: VERTEX, fragment: COPY });
    cover(gl, program, [], { color: this.picture.textures[0] });
    gl.enable(gl.DEPTH_TEST);
  }

  draw(pass, number, view) {
    const { gl } = this;
    const to = this.destination(pass);
    const uniforms = { ...pass.uniforms };
    for (const [name, [kind, ...parameters]] of Object.entries(pass.view))
      uniforms[name] = KINDS[kind](view, ...parameters);
    const textures = {};
    for (const [name, source] of Object.entries(pass.textures))
      textures[name] = this.source(source, `${number} ${name}`);
    gl.bindFramebuffer(gl.FRAMEBUFFER, to.frame);
    gl.viewport(0, 0, to.width, to.height);
    const blend = pass.target ? null : BLENDS[pass.blend];
    if (blend) {
      gl.enable(gl.BLEND);
      gl.blendFuncSeparate(...blend.map((name) => gl[name]));
    } else gl.disable(gl.BLEND);
    const program = this.programs.of({ vertex: VERTEX, fragment: this.text(pass) });
    cover(gl, program, [uniforms], textures);
    if (!pass.target) this.picture = to;
  }

  // The source of a pass; a texel of bloom touches as many pixels as the picture's size says.
  text({ fragment, taps }) {
    if (!taps) return fragment;
    const count = Math.ceil(this.height / taps) + 1;
    return fragment.replace('in vec2 uv;', `#define TAPS ${count}\nin vec2 uv;`);
  }

  source(name, key) {
    const { targets, images } = this;
    if (typeof name !== 'string') return images[key];
    if (name === 'color') return this.picture.textures[0];
    if (name === 'depth') return targets.drawn.depth;
    if (name === 'surface') return targets.surfaces.textures[0];
    if (name === 'surface_depth') return targets.surfaces.depth;
    return images[name] ?? targets[name].textures[0];
  }

  // The picture itself if a pass is blended with it, the free one of two, or a target by name.
  destination({ target: name, blend, rows, halvings, share = 1 }) {
    const { gl, targets } = this;
    if (!name && blend) return this.picture;
    if (!name) return this.picture === targets[0] ? targets[1] : targets[0];
    if (!targets[name]) {
      let size = [this.width, this.height].map((n) => Math.ceil(n / share));
      if (rows)
        size = size.map((n, i) =>
          Math.ceil(texels(n, this.height / rows) / 2 ** halvings[i]),
        );
      const options = { width: size[0], height: size[1], depth: null, linear: Boolean(rows) };
      targets[name] = target(gl, [share > 1 ? gl.RGBA8 : this.format], options);
    }
    return targets[name];
  }
}

const pixel = (gl, rgba) => texture(gl, new Uint8Array(rgba), { width: 1, height: 1 });

function image(gl, source) {
  const [height, width, channels] = source.shape;
  const pixels = new Uint8Array(4 * width * height).fill(255);
  for (let i = 0; i < width * height; i++)
    for (let k = 0; k < channels; k++) pixels[4 * i + k] = source[channels * i + k];
  return texture(gl, pixels, { width, height, linear: true, repeat: true });
}

// A texture that marks the numbers of chosen things.
function marks(gl, names, chosen) {
  const pixels = new Uint8Array(4 * (names.length + 1));
  names.forEach((name, i) => pixels.fill(chosen.includes(name) ? 255 : 0, 4 * i + 4, 4 * i + 8));
  return texture(gl, pixels, { width: names.length + 1, height: 1 });
}
