// Figures and crowds that play: joints from frames of clips, vertices posed by pvibr's own program.
import { Instances } from './instances.js';
import { fill, texture } from './programs.js';
import { cover } from './targets.js';
import { multiply } from './views.js';

const UNITS = 65535; // of weights
const MEMBERS_OF_A_ROW = 1024;
const TEXELS = 4; // of a member
const PLACE_ERROR = 0.02;
const COVER = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

// The time within a clip at a time, as clip.py's local_times has it.
export function localTime(time, [speed, offset, cycles, count], duration) {
  const cycle = cycles * duration;
  if (!(cycle > 0)) return 0;
  const played = offset + speed * time;
  let local = played - cycle * Math.floor(played / cycle);
  if (count < Infinity && played < 0) local = 0;
  else if (played >= count * cycle) local = (count % 1 || 1) * cycle;
  return cycle > duration ? duration - Math.abs(duration - local) : Math.min(local, duration);
}

// What plays in a scene: figures, and crowds by their things.
export const playersOf = (scene) =>
  scene.subplots.flatMap(({ figures = [], things }) => [
    ...figures,
    ...things.filter(({ plays }) => plays).map(({ plays }) => plays),
  ]);

export const timingOf = (player, member) =>
  player.timing.subarray(4 * member, 4 * member + 4);

// Seconds of time after which everything that plays is about where it was, at most a minute.
export function lengthOf(players) {
  const periods = new Set();
  for (const player of players)
    for (let i = 0; i < player.clip.length; i++) {
      const [speed, , cycles, count] = timingOf(player, i);
      const cycle = cycles * player.clips[player.clip[i]].duration;
      const seconds = count < Infinity ? count * cycle : cycle;
      if (seconds > 0 && speed) periods.add(Number((seconds / Math.abs(speed)).toPrecision(4)));
    }
  if (!periods.size) return 1;
  const longest = Math.max(...periods);
  const misfit = (length) =>
    Math.max(...[...periods].map((p) => Math.abs(length / p - Math.round(length / p))));
  let best = longest;
  for (let length = longest; length <= 60; length += longest) {
    if (misfit(length) < misfit(best) - 1e-9) best = length;
    if (misfit(best) < 0.02) break;
  }
  return best;
}

// A pose at a time of a clip: the rows of the matrices of joints, 12 numbers each, and morph weights.
function poseAt(player, clip, seconds) {
  const { axes, places, duration, weights } = player.clips[clip];
  const count = player.joints.length;
  const frames = places.length / 3 / count;
  const at = duration > 0 ? (seconds / duration) * (frames - 1) : 0;
  const first = Math.min(Math.floor(at), Math.max(frames - 2, 0));
  const share = at - first;
  const step = share > 0 ? 3 : 0;
  const rows = new Float64Array(12 * count);
  for (let joint = 0; joint < count; joint++)
    for (let column = 0; column < 4; column++) {
      const from = column < 3 ? axes : places;
      const i = 3 * ((column < 3 ? 3 * joint + column : joint) * frames + first);
      for (let row = 0; row < 3; row++)
        rows[12 * joint + 4 * row + column] =
          from[i + row] + share * (from[i + row + step] - from[i + row]);
    }
  const targets = weights.shape[1];
  const now = weights.slice(targets * first, targets * (first + 1));
  if (step)
    for (let k = 0; k < targets; k++)
      now[k] += share * (weights[targets * (first + 1) + k] - now[k]);
  return { rows, weights: now };
}

// The product of two matrices of 3 rows of 4, from some places of arrays on.
function product(a, i, b, j, out, k) {
  for (let row = 0; row < 12; row += 4)
    for (let column = 0; column < 4; column++)
      out[k + row + column] =
        a[i + row] * b[j + column] +
        a[i + row + 1] * b[j + 4 + column] +
        a[i + row + 2] * b[j + 8 + column] +
        (column === 3 ? a[i + row + 3] : 0);
}

// Meshes at rest, and their vertices in poses: rows of textures, as pvibr's sheets have them.
class Posing {
  constructor(gl, programs, posing, parts) {
    Object.assign(this, { gl, programs, posing, poses: 0, textures: {} });
    this.limit = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    let rest = 0;
    this.parts = parts.map(({ points, follows, normals }) => {
      const count = points.length / 3;
      const rows = Math.ceil(count / posing.width);
      const groups = Math.ceil((follows.influences ?? 0) / 4);
      const { shapes } = follows;
      const numbers = 3 * (follows.nodes?.length ?? 0) + (shapes ? 1 + shapes.count : 0);
      const part = { points, normals, follows, count, rows, groups, rest, numbers };
      if (shapes) part.shapes = this.shapesOf(part);
      rest += rows * Math.max(groups, 1);
      return part;
    });
    this.restRows = rest;
    this.rowsOfPose = this.parts.reduce((sum, { rows }) => sum + rows, 0);
    this.room = Math.floor(this.limit / Math.max(this.rowsOfPose, 1));
    if (this.parts.length) this.load();
    this.state = texture(gl, new Float32Array(4), { width: 1, height: 1 });
    this.places = texture(gl, new Float32Array(4), { width: 1, height: 1 });
  }

  load() {
    const { gl, posing, restRows } = this;
    const images = [0, 1, 2, 3].map(() => new Float32Array(4 * posing.width * restRows));
    for (const { points, normals, follows, count, rows, rest } of this.parts)
      for (let i = 0; i < count; i++) {
        const at = 4 * (rest * posing.width + i);
        images[0].set(points.subarray(3 * i, 3 * i + 3), at);
        if (normals) images[1].set(normals.subarray(3 * i, 3 * i + 3), at);
        for (let k = 0; k < (follows.influences ?? 0); k++) {
          const there = at + 4 * posing.width * rows * Math.floor(k / 4) + (k % 4);
          images[2][there] = follows.joints[follows.influences * i + k];
          images[3][there] = follows.weights[follows.influences * i + k] / UNITS;
        }
      }
    const names = ['ibr_rest', 'ibr_rest_normals', 'ibr_joints', 'ibr_weights'];
    const size = { width: posing.width, height: restRows };
    this.rest = Object.fromEntries(names.map((name, i) => [name, texture(gl, images[i], size)]));
  }

  // The differences of morph targets as textures, some rows for each.
  shapesOf({ follows: { shapes }, count, rows }) {
    const { gl, posing } = this;
    const size = { width: posing.width, height: rows * shapes.count };
    const image = (values) => {
      const texels = new Float32Array(4 * size.width * size.height);
      for (let shape = 0; shape < shapes.count; shape++)
        for (let i = 0; i < count; i++) {
          const from = 3 * (shape * count + i);
          texels.set(
            values.subarray(from, from + 3),
            4 * (shape * rows * size.width + i),
          );
        }
      return texture(gl, texels, size);
    };
    return { ibr_shapes: image(shapes.points), ibr_shape_normals: image(shapes.normals) };
  }

  // Makes room for poses.
  resize(poses) {
    const { gl, posing } = this;
    if (this.frame) gl.deleteFramebuffer(this.frame);
    Object.values(this.textures).forEach((handle) => gl.deleteTexture(handle));
    this.poses = poses;
    let first = 0;
    for (const part of this.parts) {
      part.first = first;
      first += part.rows * poses;
    }
    this.height = first;
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    ['ibr_posed', 'ibr_posed_normals'].forEach((name, i) => {
      const handle = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, handle);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, posing.width, first);
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
        gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
      gl.framebufferTexture2D(
        gl.FRAMEBUFFER,
        gl.COLOR_ATTACHMENT0 + i,
        gl.TEXTURE_2D,
        handle,
        0,
      );
      this.textures[name] = handle;
    });
    gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE)
      throw new Error('this browser cannot draw to textures of floats');
  }

  // Poses all meshes by the rows of joints of each pose.
  draw(poses) {
    if (!this.parts.length || !poses.length) return;
    if (poses.length > this.poses)
      this.resize(Math.min(2 ** Math.ceil(Math.log2(poses.length)), this.room));
    const { gl, posing } = this;
    const numbers = this.parts.reduce((sum, part) => sum + part.numbers, 0);
    const stateRows = Math.max(1, Math.ceil((numbers * poses.length) / posing.state));
    const state = new Float32Array(4 * posing.state * stateRows);
    const places = new Float32Array(4 * this.height);
    let at = 0;
    for (const part of this.parts) {
      const { nodes = [], bind, shapes } = part.follows;
      poses.forEach((moment, pose) => {
        for (let row = 0; row < part.rows; row++)
          places.set(
            [part.rest + row, at / 4, part.rows, 3 * nodes.length],
            4 * (part.first + pose * part.rows + row),
          );
        for (let k = 0; k < nodes.length; k++, at += 12)
          product(moment.rows, 12 * nodes[k], bind, 12 * k, state, at);
        if (!shapes) return;
        state[at + 1] = shapes.count;
        at += 4;
        for (let k = 0; k < shapes.count; k++, at += 4)
          state.set([k * part.rows, moment.weights[shapes.first + k]], at);
      });
    }
    fill(gl, this.state, state, posing.state, stateRows);
    fill(gl, this.places, places, 1, this.height, 4);
    const shares = [1 / stateRows, 1 / this.height];
    const textures = { ...this.rest, ibr_state: this.state, ibr_places: this.places };
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    for (const what of [gl.BLEND, gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.CULL_FACE]) gl.disable(what);
    gl.colorMask(true, true, true, true);
    for (const { groups, count, rows, first, rest, shapes, follows } of this.parts) {
      const defines = `#define GROUPS ${groups}\n#define SHAPES ${Number(Boolean(shapes))}\n`;
      const fragment = posing.header + defines + posing.source;
      const program = this.programs.of({ vertex: COVER, fragment });
      const uniforms = { ibr_rest_share: 1 / this.restRows, ibr_shares: shares };
      if (shapes) {
        uniforms.ibr_shape_first = rest;
        uniforms.ibr_shape_share = 1 / (rows * follows.shapes.count);
      }
      gl.viewport(0, first, Math.min(count, posing.width), rows * poses.length);
      cover(gl, program, [uniforms], { ...textures, ...shapes });
    }
  }
}

const shifted = (matrix, [x, y, z]) => multiply(matrix, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]);
const isPosed = ({ follows }) => Boolean(follows.nodes || follows.shapes);
const byColumns = (m) => m.map((_, i) => m[4 * (i % 4) + Math.floor(i / 4)]);

// A figure: its meshes are things, which follow its joints.
class Figure {
  constructor(gl, programs, posing, tree, items) {
    Object.assign(this, { tree, items });
    this.posed = items.filter(({ tree: mesh }) => isPosed(mesh));
    const parts = this.posed.map((item) => item.tree);
    this.posing = new Posing(gl, programs, posing, parts);
  }

  at(time) {
    const { tree, posing } = this;
    const [clip] = tree.clip;
    const seconds = localTime(time, timingOf(tree, 0), tree.clips[clip].duration);
    const shown = `${clip} ${seconds}`;
    if (this.shown === shown) return;
    this.shown = shown;
    const pose = poseAt(tree, clip, seconds);
    posing.draw([pose]);
    this.posed.forEach(({ tree: mesh, shown: drawn }, i) => {
      mesh.material.uniforms.ibr_posed_row = posing.parts[i].first;
      Object.assign(drawn.textures, posing.textures);
    });
    const placed = shifted(byColumns(tree.matrix), tree.origin);
    for (const { tree: mesh } of this.items) {
      const { node, offset } = mesh.follows;
      if (node === undefined || node < 0) continue;
      const joint = [...pose.rows.subarray(12 * node, 12 * node + 12), 0, 0, 0, 1];
      const moved = multiply(placed, byColumns(joint));
      mesh.matrix = byColumns(offset ? multiply(moved, byColumns(offset)) : moved);
    }
  }
}

// All figures of a scene, and its crowds, which are told the time.
export class Figures {
  constructor(gl, programs, scene, drawn) {
    this.figures = scene.subplots.flatMap(({ figures = [] }, subplot) =>
      figures.map((tree, number) => {
        const items = drawn[subplot].filter(({ tree: t }) => t.follows?.figure === number);
        return new Figure(gl, programs, scene.posing, tree, items);
      }),
    );
    this.crowds = drawn.flat().filter(({ shown }) => shown instanceof Crowd);
  }

  at(time) {
    for (const figure of this.figures) figure.at(time);
    for (const { shown } of this.crowds) shown.time = time;
  }
}

// A set of instances whose meshes are posed, each member at its own time of its own clip.
export class Crowd extends Instances {
  constructor(gl, tree, programs, posing) {
    super(gl, tree);
    this.time = 0;
    this.posings = tree.levels.map((parts) => {
      return new Posing(gl, programs, posing, parts.filter(isPosed));
    });
    if (tree.bins) {
      const [height, width] = tree.bins.shape;
      this.textures.ibr_bins = texture(gl, tree.bins, { width, height });
      this.textures.ibr_moves = texture(gl, new Float32Array(4), { width: 1, height: 1 });
    }
    this.members = tree.levels.map((parts) =>
      parts.map(() => texture(gl, new Float32Array(4), { width: 1, height: 1 })),
    );
  }

  prepare(view) {
    const { gl, tree } = this;
    super.prepare(view);
    if (tree.bins) this.move();
    const frame = gl.getParameter(gl.FRAMEBUFFER_BINDING);
    const viewport = gl.getParameter(gl.VIEWPORT);
    const states = [gl.BLEND, gl.DEPTH_TEST, gl.SCISSOR_TEST].filter((s) => gl.isEnabled(s));
    tree.levels.forEach((parts, k) => this.place(k, parts, view));
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(...viewport);
    states.forEach((state) => gl.enable(state));
  }

  // Tells cards which moment of its clip each member shows: a part of it from 0 to 1.
  move() {
    const { clip, clips } = this.tree.plays;
    const texels = new Float32Array(4 * MEMBERS_OF_A_ROW * this.rows);
    clip.forEach((k, i) => {
      const { duration } = clips[k];
      const seconds = localTime(this.time, timingOf(this.tree.plays, i), duration);
      texels.set([seconds / (duration || 1), 0, k, 0], 4 * i);
    });
    fill(this.gl, this.textures.ibr_moves, texels, MEMBERS_OF_A_ROW, this.rows);
  }

  // Which pose each member of a level has, and the joints of the poses.
  poses(slots, room) {
    const { tree, time } = this;
    const { clip, clips } = tree.plays;
    const shared = slots.length > room;
    const phases = Math.max(1, Math.floor(room / clips.length));
    const [numbers, poses, known] = [new Uint32Array(slots.length), [], new Map()];
    slots.forEach((slot, i) => {
      const { duration } = clips[clip[slot]];
      let seconds = localTime(time, timingOf(tree.plays, slot), duration);
      let key = i;
      if (shared) {
        const phase = Math.min(Math.floor((seconds / (duration || 1)) * phases), phases - 1);
        seconds = ((phase + 0.5) * duration) / phases;
        key = clip[slot] * phases + phase;
      }
      if (!known.has(key)) {
        known.set(key, poses.length);
        poses.push(poseAt(tree.plays, clip[slot], seconds));
      }
      numbers[i] = known.get(key);
    });
    return { numbers, poses };
  }

  place(k, parts, view) {
    const { gl, tree, levels } = this;
    const slots = levels.near[k];
    if (!slots.length) return;
    const posing = this.posings[k];
    const { numbers, poses } = this.poses(slots, posing.room);
    posing.draw(poses);
    const rows = Math.ceil(slots.length / MEMBERS_OF_A_ROW);
    const matrices = slots.map((slot) => this.matrix(slot, view));
    let posed = 0;
    parts.forEach((mesh, j) => {
      const { follows, origin } = mesh;
      const texels = new Float32Array(4 * TEXELS * MEMBERS_OF_A_ROW * rows);
      const part = isPosed(mesh) ? posing.parts[posed++] : null;
      slots.forEach((slot, i) => {
        const at = 4 * TEXELS * i;
        if (follows.nodes || follows.node < 0) texels.set(matrices[i], at);
        else product(matrices[i], 0, poses[numbers[i]].rows, 12 * follows.node, texels, at);
        if (!follows.nodes)
          for (let row = at; row < at + 12; row += 4)
            texels[row + 3] +=
              texels[row] * origin[0] + texels[row + 1] * origin[1] + texels[row + 2] * origin[2];
        const first = part ? part.first + numbers[i] * part.rows : 0;
        texels.set([first, slot, levels.shares[slot], PLACE_ERROR * tree.radii[slot]], at + 12);
      });
      fill(gl, this.members[k][j], texels, TEXELS * MEMBERS_OF_A_ROW, rows);
    });
  }

  // The rows of the matrix of a member: eye from its figure, less the figure's origin.
  matrix(slot, { rotation: r }) {
    const { axes } = this.tree;
    const eye = this.levels.eyes;
    const rows = new Float32Array(12);
    for (let row = 0; row < 3; row++) {
      for (let column = 0; column < 3; column++) {
        const a = (i) => (axes ? axes[9 * slot + 3 * i + column] : Number(i === column));
        rows[4 * row + column] = r[row] * a(0) + r[3 + row] * a(1) + r[6 + row] * a(2);
      }
      rows[4 * row + 3] = eye[3 * slot + row];
    }
    return rows;
  }

  texturesOf(k, j) {
    const textures = super.texturesOf(k, j);
    return { ...textures, ...this.posings[k].textures, ibr_entries: this.members[k][j] };
  }
}
