// Instances as cards and as meshes.
import { Cards } from './cards.js';
import { colorOf } from './coloring.js';
import { Levels, pages, poseTexels } from './levels.js';
import { Mesh } from './meshes.js';
import { fill, pixelsOf, texture } from './programs.js';

const NONE = { ibr_tint: [0, 0, 0, 0] };

export class Instances {
  constructor(gl, tree) {
    Object.assign(this, { gl, tree, levels: new Levels(tree) });
    this.count = tree.radii.length;
    const poses = poseTexels(tree);
    this.textures = { ibr_poses: texture(gl, poses.texels, { width: 3072, height: poses.rows }) };
    for (const name of tree.geometry ? ['geometry', 'albedo'] : []) {
      const images = tree[name].map((image) => pixelsOf(gl, image));
      const { pixels, width, height } = pages(images, tree.tile, tree.pages);
      this.textures[`ibr_${name}`] = texture(gl, pixels, { width, height, linear: true });
    }
    if (tree.support) {
      const [height, width] = tree.support.shape;
      this.textures.ibr_support = texture(gl, tree.support, { width, height });
    }
    this.meshes = tree.levels.map((level) => level.map((part) => new Mesh(gl, part)));
    this.rows = Math.max(1, Math.ceil(this.count / 1024));
    this.entries = [...tree.levels, ...tree.cards].map(() =>
      texture(gl, new Float32Array(4096), { width: 1024, height: 1 }),
    );
    this.cards = new Cards(gl);
    this.look(tree.looks);
  }

  look(looks) {
    const { gl } = this;
    this.looks = looks;
    const texels = new Uint8Array(4096 * this.rows);
    if (looks) texels.set(looks);
    const size = { width: 1024, height: this.rows };
    if (this.textures.ibr_looks)
      fill(gl, this.textures.ibr_looks, texels, size.width, size.height);
    else this.textures.ibr_looks = texture(gl, texels, size);
    this.uniforms = {
      ...this.tree.uniforms,
      ...NONE,
      ibr_unit: 1,
      ibr_texels: 3,
      ibr_count: this.count,
      ibr_has_looks: Number(Boolean(looks)),
      ibr_first: 0,
    };
  }

  // Colors instances by values, as a lookup table maps them; hidden ones stay so.
  color(values, coloring) {
    const looks = new Uint8Array(4 * this.count);
    const color = colorOf(coloring);
    for (let i = 0; i < this.count; i++) {
      looks.set(color(values[i]), 4 * i);
      looks[4 * i + 3] = this.looks && this.looks[4 * i + 3] === 0 ? 0 : 255;
    }
    this.look(looks);
  }

  prepare(view) {
    const { tree, levels, looks } = this;
    levels.choose(view, looks ? (i) => looks[4 * i + 3] > 0 : () => true);
    tree.levels.forEach((_, k) =>
      this.upload(k, levels.near[k], levels.near[k].length, false, true),
    );
    tree.cards.forEach((_, k) =>
      this.upload(tree.levels.length + k, levels.cards[k], levels.cardCounts[k], true, false),
    );
  }

  upload(k, slots, count, isReversed, withShares) {
    if (!count) return;
    const { texels, rows } = this.levels.entries(slots, count, isReversed, withShares);
    fill(this.gl, this.entries[k], texels, 1024, rows);
  }

  // What programs of a part of a level read.
  texturesOf(k, j) {
    return { ...this.textures, ...this.meshes[k][j].textures, ibr_entries: this.entries[k] };
  }

  drawMeshes(pass) {
    this.tree.levels.forEach((level, k) => {
      const count = this.levels.near[k].length;
      if (!count) return;
      level.forEach((part, j) => {
        const mesh = this.meshes[k][j];
        const textures = this.texturesOf(k, j);
        const own = { ...part.uniforms, ibr_end: count };
        const program = pass.program(
          part.program,
          [this.uniforms, part.material.uniforms, own],
          textures,
        );
        pass.cull(pass.variant === 'depth' ? {} : part.material);
        mesh.bind(program);
        mesh.draw('faces', count);
      });
    });
    pass.cull({});
  }

  // Draws the cores, the fringes or the solid cards.
  drawCards(pass, name) {
    const { tree, levels } = this;
    const order = tree.cards.map((_, k) => k);
    const kind = name === 'depth' ? 'solid' : name;
    for (const k of name === 'core' ? order.reverse() : order) {
      const [card, count] = [tree.cards[k], levels.cardCounts[k]];
      const nearest = count ? levels.sizes[levels.cards[k][0]] : 0;
      if (!count || card[kind] === null || (name === 'core' && nearest < 0.99 * card.core_size))
        continue;
      const textures = { ...this.textures, ibr_entries: this.entries[tree.levels.length + k] };
      const own = { ...card.uniforms, ...card.parts[name], ibr_end: count };
      const program = pass.program(
        card[kind],
        [this.uniforms, tree.material.uniforms, own],
        textures,
      );
      this.cards.draw(program, count, card.corners);
    }
  }
}
