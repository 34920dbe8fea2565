// Draws scenes: VTK's programs with their uniforms, in the order of pvibr's frames.
import { resetClippingRange } from './camera.js';
import { Stage } from './effects.js';
import { Crowd, Figures, playersOf } from './figures.js';
import { Instances } from './instances.js';
import { HiddenLabels } from './labels.js';
import { Mesh } from './meshes.js';
import { Programs, RefusedError } from './programs.js';
import { Projector } from './projectors.js';
import { Quadrics } from './quadrics.js';
import { Shadows, receiverUniforms } from './shadows.js';
import { COPY, VERTEX, copy, cover, target } from './targets.js';
import { multiply, normalMatrix, times, viewOf } from './views.js';

const MAX_SAMPLES = 8; // as PyVista's off screen

const transposed = (m) => m.map((_, i) => m[4 * (i % 4) + Math.floor(i / 4)]);

// One pass over a subplot: its programs with the uniforms of its view. Solid ones do not blend.
class Pass {
  constructor(renderer, subplot, view, variant = '') {
    Object.assign(this, { gl: renderer.gl, programs: renderer.programs, subplot, view, variant });
    this.shared = { ...view.uniforms, ...view.lightUniforms(subplot.lights) };
    this.solid = variant !== '';
    if (this.solid) this.shared.ibr_fades = 0;
    this.textures = {};
    this.thing = 0;
  }

  // Lets its programs read shadow maps and projected images.
  receive(received) {
    if (received.length) Object.assign(this.shared, receiverUniforms(this.view));
    for (const each of received) {
      Object.assign(this.shared, each.uniforms(this.view));
      Object.assign(this.textures, each.textures);
    }
  }

  program(number, groups, textures) {
    const program = this.programs.of(this.subplot.programs[number], this.variant);
    const uniforms = [this.shared, { ibr_thing: this.thing }, ...groups];
    program.use(uniforms, { ...textures, ...this.textures });
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
    this.floats = Boolean(gl.getExtension('EXT_color_buffer_float'));
    this.drawn = scene.subplots.map(({ things }) =>
      things.map((tree) => ({ tree, shown: this.shown(tree) })),
    );
    this.players = playersOf(scene);
    this.figures = new Figures(gl, this.programs, scene, this.drawn);
    // What each subplot's surfaces receive: shadows and projected images.
    this.received = scene.subplots.map(({ shadows, projectors }) => [
      ...(shadows ? [new Shadows(gl, shadows, this.programs)] : []),
      ...projectors.map((tree) => new Projector(gl, tree)),
    ]);
    this.stages = scene.subplots.map(({ stage }, i) => {
      const names = this.drawn[i].map(({ tree }) => tree.name);
      return stage && new Stage(gl, this.programs, stage, names);
    });
    this.labels = scene.subplots.map(
      ({ annotations }) => new HiddenLabels(gl, this.programs, annotations),
    );
    this.backdrop = this.programs.of(GRADIENT);
    this.average = this.programs.of(AVERAGE);
    this.samples = Math.min(MAX_SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    this.targets = {};
  }

  shown(tree) {
    const { gl, programs, scene } = this;
    if (tree.kind === 'mesh') return new Mesh(gl, tree);
    if (tree.kind === 'quadrics') return new Quadrics(gl, tree);
    return tree.plays ? new Crowd(gl, tree, programs, scene.posing) : new Instances(gl, tree);
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
    this.quick = quality < 1;
    this.targets = {
      picture: target(gl, [gl.RGBA8], { width, height, samples }),
      picks: target(gl, [gl.RGBA8], { width, height }),
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

  // `sample` is the number of a picture whose mean with those before is shown, or null.
  draw(cameras, size, quality = 1, time = 0, sample = null) {
    const { gl } = this;
    this.figures.at(time);
    // What moves casts other shadows.
    const moment = `${time} ${this.players.map(({ clip }) => clip[0])}`;
    if (this.moment !== moment)
      for (const { maps } of this.received.flat()) maps.forEach((map) => (map.stale = true));
    this.moment = moment;
    this.resize(size, quality);
    this.cameras = cameras;
    this.offset = sample ? placeOf(sample) : [0, 0];
    const { frame } = this.targets.picture;
    this.scene.subplots.forEach((_, i) => this.drawSubplot(i, false));
    gl.disable(gl.SCISSOR_TEST);
    if (sample !== null && this.floats) this.drawMean(sample);
    else copy(gl, frame, null, gl.COLOR_BUFFER_BIT, [this.width, this.height], size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  // Shows the mean of pictures since the first one.
  drawMean(sample) {
    const { gl, targets, width, height } = this;
    const none = { width, height, depth: null };
    targets.sample ??= target(gl, [gl.RGBA8], none);
    targets.mean ??= target(gl, [gl.RGBA16F], none);
    const size = [width, height];
    copy(gl, targets.picture.frame, targets.sample.frame, gl.COLOR_BUFFER_BIT, size);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / (sample + 1));
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    const program = this.programs.of({ vertex: VERTEX, fragment: COPY });
    gl.bindFramebuffer(gl.FRAMEBUFFER, targets.mean.frame);
    cover(gl, program, [], { color: targets.sample.textures[0] });
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    cover(gl, program, [], { color: targets.mean.textures[0] });
    gl.enable(gl.DEPTH_TEST);
  }

  begin(subplot, rectangle, picks) {
    const { gl } = this;
    gl.viewport(...rectangle);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...rectangle);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
    const { bottom, top } = subplot.background;
    const bare = picks || subplot.stage?.on_black; // a sky is behind it
    gl.clearColor(...(bare ? [0, 0, 0] : bottom), bare || subplot.stage ? 0 : 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    if (top && !bare) cover(gl, this.backdrop, [{ bottom, top }]);
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
    resetClippingRange(camera, subplot.reach, subplot.near);
    const size = rectangle.slice(2);
    const view = viewOf(picks ? camera : shifted(camera, this.offset, size), ...size);
    const stage = picks ? null : this.stages[number];
    const received = picks ? [] : this.received[number];
    this.drawMaps(number, received);
    this.frame = picks ? this.targets.picks.frame : this.targets.picture.frame;
    if (stage) {
      this.frame = stage.begin(view.width, view.height, this.quick ? 0 : this.samples);
      rectangle.splice(0, 2, 0, 0);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    this.begin(subplot, rectangle, picks);
    const pass = new Pass(this, subplot, view, picks ? 'picks' : '');
    pass.receive(received);
    const visible = this.drawn[number].filter(
      ({ tree }) => tree.visible !== false && !(picks && !tree.pickable),
    );
    this.drawOpaque(pass, number, visible);
    const translucent = visible.filter(({ tree }) => tree.translucent);
    const hasSets = visible.some(({ tree }) => tree.kind !== 'mesh');
    gl.depthMask(picks);
    if (translucent.length && !hasSets && !picks) this.drawWeighted(pass, translucent);
    else this.drawEach(pass, number, picks ? translucent : sorted(translucent, view));
    gl.depthMask(true);
    if (!picks) this.labels[number].ask(view);
    if (!stage) return;
    if (subplot.stage.surfaces) this.drawSurfaces(number, view, stage, visible);
    stage.finish(view, this.targets.picture.frame, this.rectangle(subplot));
  }

  // Draws normals and numbers of opaque surfaces, which outlines read.
  drawSurfaces(number, view, stage, visible) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, stage.targets.surfaces.frame);
    gl.disable(gl.BLEND);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.drawOpaque(new Pass(this, this.scene.subplots[number], view, 'surfaces'), number, visible);
  }

  // Calls with each of some things, numbered for picks; by default draws meshes.
  drawEach(pass, number, items, draw = (item) => this.drawMesh(pass, item)) {
    for (const item of items) {
      const items = this.drawn[number];
      // Parts of a set are one object.
      const isSame = ({ tree }) => tree.kind === 'instances' && tree.name === item.tree.name;
      pass.thing =
        (pass.variant === 'surfaces' ? items.findIndex((o) => o === item || isSame(o)) : -1) + 1 ||
        items.indexOf(item) + 1;
      try {
        draw(item);
      } catch (error) {
        if (!(error instanceof RefusedError)) throw error;
        this.refused.add(item.tree.name || item.tree.kind);
      }
    }
  }

  // Draws what is opaque, and soft edges of cards unless the pass is solid.
  drawOpaque(pass, number, visible) {
    const { gl } = this;
    const sets = visible.filter(({ tree }) => tree.kind === 'instances');
    const meshes = visible.filter(({ tree }) => tree.kind !== 'instances' && !tree.translucent);
    this.drawEach(pass, number, meshes);
    for (const { shown } of sets) shown.prepare(pass.view);
    this.drawEach(pass, number, sets, ({ shown }) => shown.drawMeshes(pass));
    const cards = (name) =>
      this.drawEach(pass, number, sets, ({ shown }) => shown.drawCards(pass, name));
    if (pass.solid) return cards('solid');
    cards('core');
    gl.depthMask(false);
    cards('fringe');
    if (!this.stages[number] || pass.variant) return;
    gl.colorMask(false, false, false, false); // effects read the depth of soft edges, too
    gl.depthMask(true);
    cards('depth');
    gl.colorMask(true, true, true, true);
  }

  // Draws the stale depth maps of what surfaces receive.
  drawMaps(number, received) {
    const draw = (view) => {
      const pass = new Pass(this, this.scene.subplots[number], view, 'depth');
      const casters = this.drawn[number].filter(
        ({ tree }) => tree.visible !== false && tree.casts !== false,
      );
      this.drawOpaque(pass, number, casters);
    };
    for (const map of received.flatMap(({ maps }) => maps)) map.update(draw);
  }

  // Blends translucent meshes in any order, as vtkOrderIndependentTranslucentPass does.
  drawWeighted(pass, items) {
    const { gl } = this;
    const rectangle = gl.getParameter(gl.VIEWPORT);
    const size = [rectangle[0] + rectangle[2], rectangle[1] + rectangle[3]];
    const weighted = this.weightedTarget(...size);
    gl.disable(gl.SCISSOR_TEST);
    gl.depthMask(true);
    copy(gl, this.frame, weighted.frame, gl.DEPTH_BUFFER_BIT, size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, weighted.frame);
    gl.depthMask(false);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
    gl.clearBufferfv(gl.COLOR, 1, [0, 0, 0, 0]);
    gl.blendFuncSeparate(gl.ONE, gl.ONE, gl.ZERO, gl.ONE_MINUS_SRC_ALPHA);
    pass.variant = 'weighted';
    items.forEach((item) => this.drawMesh(pass, item));
    pass.variant = '';
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, ...size);
    gl.enable(gl.SCISSOR_TEST);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST);
    cover(gl, this.average, [], { colors: weighted.textures[0], weights: weighted.textures[1] });
    gl.enable(gl.DEPTH_TEST);
    gl.viewport(...rectangle);
  }

  weightedTarget(width, height) {
    const { gl, targets } = this;
    if (targets.weighted?.width !== width || targets.weighted.height !== height) {
      targets.weighted?.release();
      targets.weighted = target(gl, [gl.RGBA16F, gl.R16F], { width, height });
    }
    return targets.weighted;
  }

  drawMesh(pass, { tree, shown }) {
    if (tree.kind === 'quadrics') return shown.draw(pass);
    const { gl } = this;
    const model = transposed(tree.matrix);
    const placed = multiply(model, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...tree.origin, 1]);
    const eye = multiply(pass.view.eyeFromWorld, placed);
    const uniforms = {
      ...tree.material.uniforms,
      MCVCMatrix: eye,
      MCDCMatrix: multiply(pass.view.clipFromEye, eye),
      normalMatrix: normalMatrix(eye),
      ...ownUniforms(tree, pass.view, eye, model),
    };
    const draw = (kind, each) => {
      if (!(kind in tree.programs)) return;
      const program = pass.program(tree.programs[kind], [uniforms], shown.textures);
      shown.bind(program);
      each(program);
    };
    pass.cull(pass.variant === 'depth' ? {} : tree.material);
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
    if (!tree.edges || pass.solid) return;
    const edge = this.programs.of(shown.textures.ibr_posed ? posed(EDGES) : EDGES, pass.variant);
    edge.use([uniforms, { color: tree.material.edge_color }], shown.textures);
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

// Of what receives shadows: the scale by which normals shrink, and half the width of lines.
function ownUniforms({ material }, { parallel, pixelScale }, eye, model) {
  const columns = [0, 4, 8].map((k) => Math.hypot(model[k], model[k + 1], model[k + 2]));
  const distance = parallel ? 1 : Math.hypot(eye[12], eye[13], eye[14]);
  return {
    ibr_scale: Math.cbrt(columns[0] * columns[1] * columns[2]),
    ibr_radius: (0.5 * material.line_width * distance) / pixelScale,
  };
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

// Where in its pixels a picture is taken, from their middle: a sequence that fills them evenly.
function placeOf(sample) {
  const inverse = (base) => {
    let [value, scale] = [0, 1];
    for (let rest = sample; rest; rest = Math.floor(rest / base))
      value += (rest % base) * (scale /= base);
    return value;
  };
  return [inverse(2) - 0.5, inverse(3) - 0.5];
}

// A camera whose picture is shifted by parts of pixels.
function shifted(camera, offset, size) {
  const center = camera.window_center ?? [0, 0];
  return { ...camera, window_center: center.map((x, i) => x + (2 * offset[i]) / size[i]) };
}

// Items from far to near, by the middles of their points.
function sorted(items, { eyeFromWorld: m }) {
  const depth = ({ tree }) => times(m, times(transposed(tree.matrix), tree.origin))[2];
  return [...items].sort((a, b) => depth(a) - depth(b));
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

// The same for vertices that are posed, as posing.glsl fetches them.
const posed = ({ vertex, fragment }) => ({
  vertex: vertex.replace('in vec4 vertexMC;', 'uniform highp sampler2D ibr_posed;\nuniform int ibr_posed_row;').replace(
    'void main() {',
    `void main() {
  int width = textureSize(ibr_posed, 0).x;
  ivec2 texel = ivec2(gl_VertexID % width, ibr_posed_row + gl_VertexID / width);
  vec4 vertexMC = vec4(texelFetch(ibr_posed, texel, 0).xyz, 1.0);`,
  ),
  fragment,
});

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
