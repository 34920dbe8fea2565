// Spheres, ellipsoids and cylinders by rays: blocks of items in view, each in a mode for its size.
import { Cards } from './cards.js';
import { colorOf } from './coloring.js';
import { texture, fill } from './programs.js';

const BLOCK = 64;
const ROW = 1024;
const OPAQUE = 127; // alphas of looks are as quadrics.py has them

const rows = (count) => Math.max(1, Math.ceil(count / ROW));

function table(gl, values, type) {
  const height = rows(values.length / 4);
  const texels = new type(4 * ROW * height);
  texels.set(values);
  return texture(gl, texels, { width: ROW, height });
}

// Uniforms of a view and of the target's pixels, see quadric_cards.py.
function viewUniforms({ clipFromEye: c, near, parallel, pixelScale }, [x, y, width, height]) {
  const scale = [c[0], c[5]];
  const offset = parallel ? [c[12], c[13]] : [-c[8], -c[9]];
  const factors = [2 / width / scale[0], 2 / height / scale[1]];
  const corner = [x, y];
  const offsets = scale.map((s, i) => (-1 - offset[i]) / s - corner[i] * factors[i]);
  return {
    ibr_pixel: 1 / pixelScale,
    ibr_near: near,
    ibr_ndc_from_slope: [...scale, ...offset],
    ibr_shear: 0,
    ibr_zw_from_z: [c[10], c[14], c[11], c[15]],
    ibr_eye: [0, 0, 0],
    ibr_size: [width, height],
    ibr_slope_from_pixel: [...factors, ...offsets],
  };
}

export class Quadrics {
  constructor(gl, tree) {
    Object.assign(this, { gl, tree, count: tree.ids.length });
    this.textures = {
      ibr_items: table(gl, tree.items, Float32Array),
      ibr_looks: table(gl, tree.looks, Uint8Array),
    };
    this.looks = tree.looks.slice();
    this.entries = tree.modes.map(() => table(gl, new Float32Array(4), Float32Array));
    this.cards = new Cards(gl);
  }

  // Colors items by values, as a lookup table maps them; opacity and what is hidden stay.
  color(values, coloring) {
    const color = colorOf(coloring);
    const each = this.tree.looks_per_item;
    for (let i = 0; i < this.count * each; i++) {
      const alpha = this.looks[4 * i + 3];
      const code = alpha && alpha <= OPAQUE ? alpha + OPAQUE + 1 : alpha;
      const [r, g, b] = color(values[Math.floor(i / each)]);
      this.looks.set([r, g, b, code], 4 * i);
    }
    const texels = new Uint8Array(4 * ROW * rows(this.count * each));
    texels.set(this.looks);
    fill(this.gl, this.textures.ibr_looks, texels, ROW, texels.length / 4 / ROW);
  }

  // Blocks in view by mode, near ones first, with their middles in eye space.
  choose(view) {
    const { tree } = this;
    const { eyeFromWorld: m, planes, parallel, near, pixelScale } = view;
    const found = tree.modes.map(() => []);
    for (let k = 0; k < tree.reach.length; k++) {
      const [a, b, c] = tree.middles.subarray(3 * k, 3 * k + 3);
      const x = m[0] * a + m[4] * b + m[8] * c + m[12];
      const y = m[1] * a + m[5] * b + m[9] * c + m[13];
      const z = m[2] * a + m[6] * b + m[10] * c + m[14];
      const reach = tree.reach[k] + tree.largest[k];
      let inside = -z - reach - near;
      for (const p of planes)
        inside = Math.min(inside, p[0] * x + p[1] * y + p[2] * z + p[3] - reach);
      if (inside < -2 * reach) continue;
      const nearest = Math.max(Math.hypot(x, y, z) - tree.reach[k], near);
      const size = (2 * tree.largest[k] * pixelScale) / (parallel ? 1 : nearest);
      const mode =
        inside > 0 ? tree.modes.findIndex(({ largest }) => size <= largest) : tree.modes.length - 1;
      found[mode].push([x, y, z, k]);
    }
    for (const blocks of found) blocks.sort((p, q) => q[2] - p[2]);
    return found;
  }

  // Items of translucent sets, each an entry of its own, far ones first.
  sorted(view) {
    const { tree, count } = this;
    const m = view.eyeFromWorld;
    const texels = tree.items.length / 4 / count;
    const blocks = [];
    for (let k = 0; k < tree.reach.length; k++) {
      const [a, b, c] = tree.middles.subarray(3 * k, 3 * k + 3);
      blocks.push([0, 1, 2].map((i) => m[i] * a + m[4 + i] * b + m[8 + i] * c + m[12 + i]));
    }
    // Where a texel has the middle's coordinates: its first three, or a column of three texels.
    const at = texels === 3 ? [3, 7, 11] : [0, 1, 2];
    const depths = new Float32Array(count);
    for (let i = 0; i < count; i++) {
      const [x, y, z] = at.map((j) => tree.items[4 * texels * i + j]);
      depths[i] = blocks[Math.floor(i / BLOCK)][2] + m[2] * x + m[6] * y + m[10] * z;
    }
    const order = Uint32Array.from(depths.keys()).sort((i, j) => depths[i] - depths[j]);
    const entries = [...order].map((i) => [...blocks[Math.floor(i / BLOCK)], i]);
    return [...tree.modes.slice(1).map(() => []), entries];
  }

  draw(pass) {
    const { gl, tree } = this;
    const unit = tree.translucent ? 1 : BLOCK;
    const found = tree.translucent ? this.sorted(pass.view) : this.choose(pass.view);
    const shared = {
      ...viewUniforms(pass.view, gl.getParameter(gl.VIEWPORT)),
      ibr_margin: pass.solid ? 0 : 0.5,
      ibr_count: this.count,
      ibr_unit: unit,
      ibr_first: 0,
    };
    pass.cull({});
    // Quads, the nearest, hide the most.
    for (let k = tree.modes.length - 1; k >= 0; k--) {
      const count = found[k].length;
      if (!count) continue;
      const texels = new Float32Array(4 * ROW * rows(count));
      found[k].forEach((entry, i) => texels.set(entry, 4 * i));
      fill(gl, this.entries[k], texels, ROW, rows(count));
      const mode = tree.modes[k];
      const textures = { ...this.textures, ibr_entries: this.entries[k] };
      const groups = [tree.material.uniforms, shared, { ibr_end: count }];
      const program = pass.program(mode.program, groups, textures);
      this.cards.draw(program, count * unit, mode.corners);
    }
  }
}
