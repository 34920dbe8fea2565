// Images projected on surfaces: their depth maps, and what receivers read of them.
import { texture } from './programs.js';
import { DepthMap } from './shadows.js';
import { inverse, multiply, times } from './views.js';

const NUMBERS = 24; // of a slide, see slide.py
const PLACE = 15; // the first of the four numbers of its position or direction

export class Projector {
  constructor(gl, tree) {
    this.tree = tree;
    this.textures = {};
    this.maps = [];
    tree.slides.forEach(({ image, view, resolution }, k) => {
      this.textures[`${tree.prefix}_picture_${k}`] = texture(gl, image, {
        linear: true,
        mipmap: true,
      });
      if (!view) return;
      const map = new DepthMap(gl, { views: [view], columns: 1, rows: 1, resolution });
      this.textures[`${tree.prefix}_depth_${k}`] = map.texture;
      this.maps.push(map);
    });
  }

  uniforms(view) {
    const { prefix, matrices, numbers, settings } = this.tree;
    const worldFromEye = inverse(view.eyeFromWorld);
    const placed = [...numbers];
    for (let at = PLACE; at < numbers.length; at += NUMBERS) {
      const [x, y, z, w] = numbers.slice(at, at + 4);
      const m = view.eyeFromWorld.map((value, i) => (i > 11 && i < 15 ? value * w : value));
      placed.splice(at, 3, ...times(m, [x, y, z]));
    }
    return {
      [`${prefix}_matrix`]: matrices.flatMap((matrix) => multiply(matrix, worldFromEye)),
      [`${prefix}_number`]: placed,
      [`${prefix}_set`]: settings,
    };
  }
}
