// Draws scenes: VTK's programs with their uniforms, in the order of pvibr's frames.
import { resetClippingRange } from './camera.js';
import { Instances } from './instances.js';
import { Mesh } from './meshes.js';
import { Programs } from './programs.js';
import { View, multiply, normalMatrix } from './views.js';

const transposed = (m) => m.map((_, i) => m[4 * (i % 4) + Math.floor(i / 4)]);

// One pass over a subplot: its programs with the uniforms of its view.
class Pass {
  constructor(renderer, subplot, view, picks) {
    Object.assign(this, { gl: renderer.gl, programs: renderer.programs, subplot, view, picks });
    this.shared = { ...view.uniforms, ...view.lightUniforms(subplot.lights) };
    if (picks) this.shared.ibr_fades = 0;
    this.thing = 0;
  }

  program(number, groups, textures) {
    const program = this.programs.of(this.subplot.programs[number], this.picks);
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
    this.drawn = scene.subplots.map(({ things }) =>
      things.map((tree) => ({
        tree,
        shown: tree.kind === 'mesh' ? new Mesh(gl, tree) : new Instances(gl, tree),
      })));
    this.picture = null;
    this.backdrop = this.programs.of(GRADIENT, false);
  }

  // A target of single samples for picking, of the canvas's size.
  resize([width, height]) {
    const { gl } = this;
    if (this.width === width && this.height === height) return;
    this.release();
    Object.assign(this, { width, height });
    this.picture = this.targetOf();
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  targetOf() {
    const { gl, width, height } = this;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    const buffers = [[gl.COLOR_ATTACHMENT0, gl.RGBA8], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]];
    const made = buffers.map(([place, format]) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      return buffer;
    });
    return { frame, buffers: made };
  }

  release() {
    this.picture?.buffers.forEach((buffer) => this.gl.deleteRenderbuffer(buffer));
    if (this.picture) this.gl.deleteFramebuffer(this.picture.frame);
  }

  // Pixels of a subplot: left, bottom, width, height.
  rectangle({ viewport: [x0, y0, x1, y1] }) {
    const [left, bottom] = [Math.round(x0 * this.width), Math.round(y0 * this.height)];
    return [left, bottom, Math.round(x1 * this.width) - left, Math.round(y1 * this.height) - bottom];
  }

  draw(cameras, time, size) {
    const { gl } = this;
    this.resize(size);
    this.cameras = cameras;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null); // multisampled by the browser
    this.scene.subplots.forEach((_, i) => this.drawSubplot(i, false));
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
    if (top && !picks) {
      this.backdrop.use([{ bottom, top }]);
      gl.bindVertexArray(null);
      for (let i = 0; i < 8; i++) gl.disableVertexAttribArray(i);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
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
    resetClippingRange(camera, subplot.bounds);
    const view = new View(camera, rectangle[2], rectangle[3]);
    this.begin(subplot, rectangle, picks);
    const pass = new Pass(this, subplot, view, picks);
    const visible = this.drawn[number].filter(({ tree }) => tree.visible !== false && !(picks && !tree.pickable));
    const numbered = (list, each) => list.forEach((item) => {
      pass.thing = this.drawn[number].indexOf(item) + 1;
      each(item);
    });
    const meshes = visible.filter(({ tree }) => tree.kind === 'mesh');
    const sets = visible.filter(({ tree }) => tree.kind === 'instances');
    numbered(meshes.filter(({ tree }) => !tree.translucent), (item) => this.drawMesh(pass, item));
    for (const { shown } of sets) shown.prepare(view);
    numbered(sets, ({ shown }) => shown.drawMeshes(pass));
    if (picks) numbered(sets, ({ shown }) => shown.drawCards(pass, 'solid'));
    else {
      numbered(sets, ({ shown }) => shown.drawCards(pass, 'core'));
      gl.depthMask(false);
      numbered(sets, ({ shown }) => shown.drawCards(pass, 'fringe'));
    }
    gl.depthMask(picks);
    numbered(meshes.filter(({ tree }) => tree.translucent), (item) => this.drawMesh(pass, item));
    gl.depthMask(true);
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
    const program = pass.program(tree.program, [uniforms], shown.textures);
    shown.bind(program);
    pass.cull(tree.material);
    if (tree.edges) {
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(1, 1);
    }
    shown.draw('faces');
    gl.disable(gl.POLYGON_OFFSET_FILL);
    shown.draw('lines');
    shown.draw('verts');
    if (tree.edges && !pass.picks) {
      const edge = this.programs.of(EDGES, false);
      edge.use([uniforms, { color: tree.material.edge_color }]);
      shown.bind(edge);
      shown.draw('edges');
    }
    pass.cull({});
  }

  // The thing at a pixel of the canvas, y down: its index and its value there, or null.
  pick(number, x, y) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.picture.frame);
    this.drawSubplot(number, true);
    const texel = new Uint8Array(4);
    gl.readPixels(Math.floor(x), Math.floor(this.height - y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, texel);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    if (!texel[3]) return null;
    const thing = this.drawn[number][texel[3] - 1].tree;
    const row = texel[0] + 256 * texel[1] + 65536 * texel[2];
    const ids = thing.ids ?? thing.source;
    const values = {};
    for (const name in thing.scalars ?? {}) values[name] = thing.scalars[name][row];
    return { thing, name: thing.name, index: ids ? ids[row] : row, value: thing.scalars ? values : null };
  }

  // Colors a thing, or all parts of the set of its name, by one of its scalars.
  setScalars(thing, name, range, table) {
    for (const { tree, shown } of this.drawn.flat()) {
      if (tree.name !== thing.name || !tree.scalars?.[name]) continue;
      tree.coloring = { ...tree.coloring, name, range, table: table ?? tree.coloring.table };
      shown.color(tree.scalars[name], tree.coloring);
    }
  }

  dispose() {
    this.release();
    this.picture = null;
  }
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
out vec4 shade;
void main() { shade = vec4(color, 1.0); }`,
};
