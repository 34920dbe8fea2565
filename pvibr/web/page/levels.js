// Which instances are seen, and what each is drawn as: pvibr's limits of sizes, in the page.

const SHARE_STEPS = 64;

const sign = (x) => (x >= 0 ? 1 : -1);

// The patch of directions in which the eye sees an instance, as cards.glsl has it.
function patchOf(x, y, z, side, isHalf) {
  if (isHalf) z = Math.max(z, 0);
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z) || 1;
  let [u, v] = [x / sum, y / sum];
  if (isHalf) [u, v] = [u + v, u - v];
  else if (z < 0) [u, v] = [(1 - Math.abs(v)) * sign(u), (1 - Math.abs(u)) * sign(v)];
  const cell = (t) => Math.min(Math.max(Math.floor(((t + 1) * side) / 2), 0), side - 1);
  return cell(v) * side + cell(u);
}

export class Levels {
  constructor(tree) {
    this.tree = tree;
    const count = tree.radii.length;
    this.count = count;
    this.eyes = new Float32Array(3 * count);
    this.sizes = new Float32Array(count);
    this.depths = new Float32Array(count);
    this.meshLow = Math.min(...tree.mesh_from);
    this.varies =
      new Set(tree.mesh_from).size > 1 || tree.mesh_to.some((row) => new Set(row).size > 1);
    this.near = tree.levels.map(() => []);
    this.shares = new Float32Array(count);
    this.cards = tree.cards.map(() => new Uint32Array(count));
    this.cardCounts = tree.cards.map(() => 0);
  }

  // Chooses what draws each instance; entries are from near to far.
  choose(view, visible) {
    const { tree, eyes, sizes, depths } = this;
    const [m, o] = [view.eyeFromWorld, tree.origin];
    const base = [0, 1, 2].map((i) => m[i] * o[0] + m[4 + i] * o[1] + m[8 + i] * o[2] + m[12 + i]);
    const seen = new Uint32Array(this.count);
    let n = 0;
    const [p0, p1, p2, p3] = view.planes;
    const inside = (p, x, y, z, r) => p[0] * x + p[1] * y + p[2] * z + p[3] > -r;
    for (let i = 0; i < this.count; i++) {
      if (!visible(i)) continue;
      const [a, b, c] = [tree.centers[3 * i], tree.centers[3 * i + 1], tree.centers[3 * i + 2]];
      const r = tree.radii[i];
      const z = base[2] + m[2] * a + m[6] * b + m[10] * c;
      if (!view.parallel && z >= r) continue;
      const x = base[0] + m[0] * a + m[4] * b + m[8] * c;
      const y = base[1] + m[1] * a + m[5] * b + m[9] * c;
      if (!(
        inside(p0, x, y, z, r) &&
        inside(p1, x, y, z, r) &&
        inside(p2, x, y, z, r) &&
        inside(p3, x, y, z, r)
      ))
        continue;
      eyes[3 * i] = x;
      eyes[3 * i + 1] = y;
      eyes[3 * i + 2] = z;
      const distance = Math.sqrt(x * x + y * y + z * z) || 1e-30;
      depths[i] = view.parallel ? -z : distance;
      sizes[i] = (2 * view.pixelScale * r) / (view.parallel ? 1 : distance);
      seen[n++] = i;
    }
    const order = seen.subarray(0, n).sort((i, j) => depths[i] - depths[j]);
    this.near.forEach((slots) => (slots.length = 0));
    this.cardCounts.fill(0);
    for (let k = 0; k < n; k++) this.assign(order[k], view);
  }

  assign(i, view) {
    const { tree, sizes } = this;
    const size = sizes[i];
    if (size >= this.meshLow) {
      const patch = this.varies ? this.patch(i, view) : 0;
      const from = tree.mesh_from[patch];
      if (size >= from) {
        let level = 0;
        while (level + 1 < tree.mesh_to.length && size <= tree.mesh_to[level + 1][patch]) level++;
        this.near[level].push(i);
        this.shares[i] = from > 0 ? (size - from) / (from * (tree.fade - 1)) : 1;
      }
    }
    tree.cards.forEach((card, k) => {
      if (1.01 * size >= card.low && 0.99 * size < card.high)
        this.cards[k][this.cardCounts[k]++] = i;
    });
  }

  patch(i, view) {
    const { tree, eyes } = this;
    const toward = view.parallel ? [0, 0, 1] : [-eyes[3 * i], -eyes[3 * i + 1], -eyes[3 * i + 2]];
    const r = view.rotation;
    const world = [0, 1, 2].map(
      (j) => r[3 * j] * toward[0] + r[3 * j + 1] * toward[1] + r[3 * j + 2] * toward[2],
    );
    if (!tree.axes) return patchOf(...world, tree.patch_side, tree.uniforms.ibr_half);
    const a = tree.axes.subarray(9 * i, 9 * i + 9);
    const cofactors = [
      [a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4]],
      [a[5] * a[6] - a[3] * a[8], a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5]],
      [a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]],
    ];
    const det = a[0] * cofactors[0][0] + a[1] * cofactors[1][0] + a[2] * cofactors[2][0];
    const model = cofactors.map(
      (row) => Math.sign(det) * (row[0] * world[0] + row[1] * world[1] + row[2] * world[2]),
    );
    return patchOf(...model, tree.patch_side, tree.uniforms.ibr_half);
  }

  // Centers in eye space and slots of instances as rows of texels; farthest first if reversed.
  entries(slots, count, isReversed, withShares) {
    const rows = Math.max(1, Math.ceil(count / 1024));
    const texels = new Float32Array(4096 * rows);
    for (let k = 0; k < count; k++) {
      const i = slots[isReversed ? count - 1 - k : k];
      texels.set(this.eyes.subarray(3 * i, 3 * i + 3), 4 * k);
      const share = withShares
        ? Math.ceil(Math.max(this.shares[i], 1 / SHARE_STEPS) * SHARE_STEPS) / SHARE_STEPS
        : 1;
      texels[4 * k + 3] = i + (share < 1 ? share : 0);
    }
    return { texels, rows };
  }
}

// Rows of the poses of instances as the shaders read them, without places: entries have these.
export function poseTexels(tree) {
  const count = tree.radii.length;
  const rows = Math.max(1, Math.ceil((3 * count) / 3072));
  const texels = new Float32Array(4 * 3072 * rows);
  for (let i = 0; i < count; i++)
    for (let row = 0; row < 3; row++)
      for (let column = 0; column < 3; column++)
        texels[12 * i + 4 * row + column] = tree.axes
          ? tree.axes[9 * i + 3 * row + column]
          : Number(row === column);
  return { texels, rows };
}

// An image with its mip levels at the right, each tile averaged by itself, as atlas.py has them.
function pyramid({ data, width }, tile) {
  const wide = (3 * width) / 2;
  const pixels = new Uint8Array(4 * wide * width);
  for (let y = 0; y < width; y++)
    pixels.set(data.subarray(4 * y * width, 4 * (y + 1) * width), 4 * y * wide);
  let [image, side, row] = [data, width, 0];
  for (let step = tile; step > 1; step >>= 1) {
    const half = side / 2;
    const halved = new Uint8Array(4 * half * half);
    for (let y = 0; y < half; y++)
      for (let x = 0; x < 4 * half; x++) {
        const at = 8 * y * side + 2 * (x & ~3) + (x & 3);
        halved[4 * y * half + x] =
          (image[at] + image[at + 4] + image[at + 4 * side] + image[at + 4 * side + 4] + 2) >> 2;
      }
    [image, side] = [halved, half];
    for (let y = 0; y < side; y++)
      pixels.set(image.subarray(4 * y * side, 4 * (y + 1) * side), 4 * ((row + y) * wide + width));
    row += side;
  }
  return { pixels, width: wide, height: width };
}

// Images with their mip levels, one or, of clips, one for each pose, in columns and rows.
export function pages(images, tile, [columns, rows]) {
  const made = images.map((image) => pyramid(image, tile));
  if (made.length === 1) return made[0];
  const { width, height } = made[0];
  const pixels = new Uint8Array(4 * width * columns * height * rows);
  made.forEach((page, i) => {
    const at = 4 * width * (height * columns * Math.floor(i / columns) + (i % columns));
    for (let y = 0; y < height; y++)
      pixels.set(
        page.pixels.subarray(4 * width * y, 4 * width * (y + 1)),
        at + 4 * width * columns * y,
      );
  });
  return { pixels, width: width * columns, height: height * rows };
}
