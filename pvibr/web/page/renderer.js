// Draws scenes: VTK's programs with their uniforms, in the order of pvibr's frames.
import { resetClippingRange } from './camera.js';
import { Instances } from './instances.js';
import { Mesh } from './meshes.js';
import { Programs, RefusedError } from './programs.js';
import { View, multiply, normalMatrix, times } from './views.js';

const MAX_SAMPLES = 8; // as PyVista's off screen

const transposed = (m) => m.map((_, i) => m[4 * (i % 4) + Math.floor(i / 4)]);

// One pass over a subplot: its programs with the uniforms of its view.
class Pass {
  constructor(renderer, subplot, view, picks) {
    Object.assign(this, { gl: renderer.gl, programs: renderer.programs, subplot, view, picks });
    this.shared = { ...view.uniforms, ...view.lightUniforms(subplot.lights) };
    if (picks) this.shared.ibr_fades = 0;
    this.variant = picks ? 'picks' : '';
    this.thing = 0;
  }

  program(number, groups, textures) {
    const program = this.programs.of(this.subplot.programs[number], this.variant);
    program.use([this.shared, { ibr_thing: this.thing }, ...groups], textures);
    return program;
  }

  cull({ back, front }) {
    const { gl } = this;
    if (!back && !front) return gl.disable(gl.CULL_FACE);
    gl.enable(gl.CULL_FACE);
    return gl.cullFace(back ? gl.BACK : gl.FRONT);
  }
}

export class Renderer {
  constructor(gl, scene) {
    Object.assign(this, { gl, scene, programs: new Programs(gl) });
    this.refused = new Set(); // names of things whose shaders this browser does not take
    this.drawn = scene.subplots.map(({ things }) =>
      things.map((tree) => ({
        tree,
        shown: tree.kind === 'mesh' ? new Mesh(gl, tree) : new Instances(gl, tree),
      })),
    );
    this.backdrop = this.programs.of(GRADIENT);
    this.average = this.programs.of(AVERAGE);
    gl.getExtension('EXT_color_buffer_float');
    this.samples = Math.min(MAX_SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    this.targets = {};
  }

  // Targets: the picture's samples, the picture for picks, weighted colors.
  resize([fullWidth, fullHeight], quality) {
    const { gl } = this;
    const [width, height] = [fullWidth, fullHeight].map((n) =>
      Math.max(1, Math.round(n * quality)),
    );
    if (this.width === width && this.height === height) return;
    Object.values(this.targets).forEach(({ release }) => release());
    Object.assign(this, { width, height });
    const samples = quality < 1 ? 0 : this.samples;
    this.targets = {
      picture: target(gl, [gl.RGBA8], { width, height, samples }),
      picks: target(gl, [gl.RGBA8], { width, height }),
      weighted: target(gl, [gl.RGBA16F, gl.R16F], { width, height }),
    };
  }

  // Pixels of a subplot: left, bottom, width, height.
  rectangle({ viewport: [x0, y0, x1, y1] }) {
    const [left, bottom] = [Math.round(x0 * this.width), Math.round(y0 * this.height)];
    return [
      left,
      bottom,
      Math.round(x1 * this.width) - left,
      Math.round(y1 * this.height) - bottom,
    ];
  }

  draw(cameras, size, quality = 1) {
    const { gl } = this;
    this.resize(size, quality);
    this.cameras = cameras;
    const { frame } = this.targets.picture;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    this.scene.subplots.forEach((_, i) => this.drawSubplot(i, false));
    gl.disable(gl.SCISSOR_TEST);
    this.copy(frame, null, gl.COLOR_BUFFER_BIT, size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  copy(from, to, what, [w, h] = [this.width, this.height]) {
    const { gl, width, height } = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
    const filter = w === width && h === height ? gl.NEAREST : gl.LINEAR;
    gl.blitFramebuffer(0, 0, width, height, 0, 0, w, h, what, filter);
  }

  begin(subplot, rectangle, picks) {
    const { gl } = this;
    gl.viewport(...rectangle);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...rectangle);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
    const { bottom, top } = subplot.background;
    gl.clearColor(...(picks ? [0, 0, 0] : bottom), picks ? 0 : 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    if (top && !picks) this.cover(this.backdrop, [{ bottom, top }]);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (!picks) gl.enable(gl.BLEND);
  }

  drawSubplot(number, picks) {
    const { gl } = this;
    const subplot = this.scene.subplots[number];
    const rectangle = this.rectangle(subplot);
    if (rectangle[2] < 1 || rectangle[3] < 1) return;
    const camera = this.cameras[number];
    resetClippingRange(camera, subplot.reach);
    const view = new View(camera, rectangle[2], rectangle[3]);
    this.begin(subplot, rectangle, picks);
    const pass = new Pass(this, subplot, view, picks);
    const visible = this.drawn[number].filter(
      ({ tree }) => tree.visible !== false && !(picks && !tree.pickable),
    );
    const numbered = (list, each) =>
      list.forEach((item) => {
        pass.thing = this.drawn[number].indexOf(item) + 1;
        try {
          each(item);
        } catch (error) {
          if (!(error instanceof RefusedError)) throw error;
          this.refused.add(item.tree.name || item.tree.kind);
        }
      });
    const meshes = visible.filter(({ tree }) => tree.kind === 'mesh');
    const sets = visible.filter(({ tree }) => tree.kind === 'instances');
    numbered(
      meshes.filter(({ tree }) => !tree.translucent),
      (item) => this.drawMesh(pass, item),
    );
    for (const { shown } of sets) shown.prepare(view);
    numbered(sets, ({ shown }) => shown.drawMeshes(pass));
    if (picks) numbered(sets, ({ shown }) => shown.drawCards(pass, 'solid'));
    else {
      numbered(sets, ({ shown }) => shown.drawCards(pass, 'core'));
      gl.depthMask(false);
      numbered(sets, ({ shown }) => shown.drawCards(pass, 'fringe'));
    }
    const translucent = meshes.filter(({ tree }) => tree.translucent);
    gl.depthMask(picks);
    if (translucent.length && !sets.length && !picks) this.drawWeighted(pass, translucent);
    else
      numbered(picks ? translucent : sorted(translucent, view), (item) =>
        this.drawMesh(pass, item),
      );
    gl.depthMask(true);
  }

  // Blends translucent meshes in any order, as vtkOrderIndependentTranslucentPass does.
  drawWeighted(pass, items) {
    const { gl } = this;
    const { picture, weighted } = this.targets;
    const rectangle = gl.getParameter(gl.VIEWPORT);
    gl.disable(gl.SCISSOR_TEST);
    gl.depthMask(true);
    this.copy(picture.frame, weighted.frame, gl.DEPTH_BUFFER_BIT);
    gl.bindFramebuffer(gl.FRAMEBUFFER, weighted.frame);
    gl.depthMask(false);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
    gl.clearBufferfv(gl.COLOR, 1, [0, 0, 0, 0]);
    gl.blendFuncSeparate(gl.ONE, gl.ONE, gl.ZERO, gl.ONE_MINUS_SRC_ALPHA);
    pass.variant = 'weighted';
    items.forEach((item) => this.drawMesh(pass, item));
    pass.variant = '';
    gl.bindFramebuffer(gl.FRAMEBUFFER, picture.frame);
    gl.viewport(0, 0, this.width, this.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST);
    this.cover(this.average, [], { colors: weighted.textures[0], weights: weighted.textures[1] });
    gl.enable(gl.DEPTH_TEST);
    gl.viewport(...rectangle);
  }

  // Draws a triangle that covers the viewport.
  cover(program, groups, textures) {
    const { gl } = this;
    program.use(groups, textures);
    gl.bindVertexArray(null);
    for (let i = 0; i < 8; i++) gl.disableVertexAttribArray(i);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawMesh(pass, { tree, shown }) {
    const { gl } = this;
    const model = transposed(tree.matrix);
    const placed = multiply(model, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...tree.origin, 1]);
    const eye = multiply(pass.view.eyeFromWorld, placed);
    const uniforms = {
      ...tree.material.uniforms,
      MCVCMatrix: eye,
      MCDCMatrix: multiply(pass.view.clipFromEye, eye),
      normalMatrix: normalMatrix(eye),
    };
    const draw = (kind, each) => {
      if (!(kind in tree.programs)) return;
      const program = pass.program(tree.programs[kind], [uniforms], shown.textures);
      shown.bind(program);
      each(program);
    };
    pass.cull(tree.material);
    if (tree.edges) {
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(1, 1);
    }
    draw('faces', () => shown.draw('faces'));
    gl.disable(gl.POLYGON_OFFSET_FILL);
    pass.cull({});
    draw('verts', () => shown.draw('verts'));
    draw('lines', (program) =>
      this.drawWide(pass, tree, program, uniforms, () => shown.draw('lines')),
    );
    if (!tree.edges || pass.picks) return;
    const edge = this.programs.of(EDGES, pass.variant);
    edge.use([uniforms, { color: tree.material.edge_color }]);
    shown.bind(edge);
    this.drawWide(pass, tree, edge, uniforms, () => shown.draw('edges'));
  }

  // WebGL's lines are a pixel wide: wider ones are drawn at each place of a disc of their width.
  drawWide({ view }, tree, program, { MCDCMatrix }, draw) {
    const { width, height } = view;
    for (const [x, y] of disc(tree.material.line_width)) {
      const moved = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, (2 * x) / width, (2 * y) / height, 0, 1];
      program.set('MCDCMatrix', multiply(moved, MCDCMatrix));
      draw();
    }
  }

  // The thing at shares of the canvas, y up: its index and its values there, or null.
  pick(number, u, v) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets.picks.frame);
    this.drawSubplot(number, true);
    const [x, y] = [Math.floor(u * this.width), Math.floor(v * this.height)];
    const texel = new Uint8Array(4);
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, texel);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    if (!texel[3]) return null;
    const thing = this.drawn[number][texel[3] - 1].tree;
    const row = texel[0] + 256 * texel[1] + 65536 * texel[2];
    const ids = thing.ids ?? thing.source;
    const values = {};
    for (const name in thing.scalars ?? {}) values[name] = thing.scalars[name][row];
    return { thing, name: thing.name, index: ids ? ids[row] : row, values };
  }

  // Colors a thing, or all parts of the set of its name, by one of its scalars.
  setScalars(thing, name, range, table) {
    for (const { tree, shown } of this.drawn.flat()) {
      if (tree.name !== thing.name || !tree.scalars?.[name]) continue;
      tree.coloring = { ...tree.coloring, name, range, table: table ?? tree.coloring.table };
      shown.color(tree.scalars[name], tree.coloring);
    }
  }
}

// The places at which lines of a width are drawn, in pixels: rings a pixel apart.
function disc(width) {
  const places = [];
  for (let radius = Math.max(0, (width - 1) / 2); radius >= 0; radius--) {
    const count = radius > 0 ? Math.max(4, Math.ceil(2 * Math.PI * radius)) : 1;
    for (let i = 0; i < count; i++) {
      const angle = (2 * Math.PI * i) / count;
      places.push([radius * Math.cos(angle), radius * Math.sin(angle)]);
    }
  }
  return places;
}

// Items from far to near, by the middles of their points.
function sorted(items, { eyeFromWorld: m }) {
  const depth = ({ tree }) => times(m, times(transposed(tree.matrix), tree.origin))[2];
  return [...items].sort((a, b) => depth(a) - depth(b));
}

// A framebuffer with depth: renderbuffers of samples, or textures.
function target(gl, formats, { width, height, samples = 0 }) {
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  const buffer = (place, format) => {
    const made = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, made);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, made);
    return () => gl.deleteRenderbuffer(made);
  };
  const textures = [];
  const releases = [buffer(gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24)];
  formats.forEach((format, i) => {
    if (samples) return releases.push(buffer(gl.COLOR_ATTACHMENT0 + i, format));
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, made, 0);
    textures.push(made);
    return releases.push(() => gl.deleteTexture(made));
  });
  gl.drawBuffers(formats.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  const release = () => [...releases, () => gl.deleteFramebuffer(frame)].forEach((f) => f());
  return { frame, textures, release };
}

const GRADIENT = {
  vertex: `#version 300 es
out float share;
void main() {
  vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  share = 0.5 * p.y + 0.5;
  gl_Position = vec4(p, 0.0, 1.0);
}`,
  fragment: `#version 300 es
precision highp float;
uniform vec3 bottom;
uniform vec3 top;
in float share;
out vec4 color;
void main() { color = vec4(mix(bottom, top, share), 1.0); }`,
};

const EDGES = {
  vertex: `#version 300 es
uniform mat4 MCDCMatrix;
in vec4 vertexMC;
void main() { gl_Position = MCDCMatrix * vertexMC; }`,
  fragment: `#version 300 es
precision highp float;
uniform vec3 color;
out vec4 fragOutput0;
void main() { fragOutput0 = vec4(color, 1.0); }`,
};

const AVERAGE = {
  vertex: GRADIENT.vertex,
  fragment: `#version 300 es
precision highp float;
uniform highp sampler2D colors;
uniform highp sampler2D weights;
in float share;
out vec4 color;
void main() {
  vec4 sum = texelFetch(colors, ivec2(gl_FragCoord.xy), 0);
  color = vec4(sum.rgb / max(texelFetch(weights, ivec2(gl_FragCoord.xy), 0).r, 1e-4), 1.0 - sum.a);
}`,
};
