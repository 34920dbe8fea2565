// Shadow maps of one light: the depth of all casters in its views, and what receivers read of it.
import { VERTEX, cover, target as depthTarget } from './targets.js';
import { View, inverse, multiply, times } from './views.js';

const TEXTURE = [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0.5, 0.5, 1];

// The columns of a uniform of receivers, as shadow_maps.py has them.
function inShader(view, size, worldFromEye) {
  const m = multiply(
    TEXTURE,
    multiply(view.clipFromEye, multiply(view.eyeFromWorld, worldFromEye)),
  );
  const [x, y, z, w] = [0, 1, 2, 3].map((i) => [m[i], m[4 + i], m[8 + i], m[12 + i]]);
  if (view.parallel) {
    const [a, b, c] = [x, y, z].map((row) => Math.hypot(row[0], row[1], row[2]));
    const axis = (row, length) => [row[0] / length, row[1] / length, row[2] / length, length];
    return [...axis(x, a), ...axis(y, b), x[3], y[3], c, z[3], view.near, view.far, ...size];
  }
  const clip = view.clipFromEye;
  const rows = [x.map((t, i) => t - 0.5 * w[i]), y.map((t, i) => t - 0.5 * w[i]), w];
  const last = [clip[0] / 2, (1 - clip[10]) / 2, clip[14] / 2];
  const columns = rows.flatMap((row, i) => [row[0], row[1], row[2], last[i]]);
  return [...columns, view.near, view.far, ...size];
}

// The depth of all casters in some views, as tiles of a texture; drawn again once it is stale.
export class DepthMap {
  constructor(gl, { views, columns, rows, resolution }) {
    Object.assign(this, { gl, columns, stale: true });
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.resolution = Math.min(resolution, Math.floor(side / Math.max(columns, rows)));
    const [width, height] = [this.resolution, this.resolution];
    this.views = views.map(
      ({ eye_from_world: eyeFromWorld, clip_from_eye: clipFromEye, near, far, parallel }) =>
        new View({ eyeFromWorld, clipFromEye, near, far, parallel, width, height, distance: 1 }),
    );
    const target = { width: columns * width, height: rows * height, depthTexture: true };
    const made = depthTarget(gl, [], { ...target, depth: gl.DEPTH_COMPONENT32F });
    Object.assign(this, { texture: made.depth, frame: made.frame });
  }

  // Draws the views if they are stale; `draw(view)` draws all casters.
  update(draw) {
    if (!this.stale) return;
    this.stale = false;
    const { gl, resolution, columns } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.views.forEach((view, k) => {
      const [column, row] = [k % columns, Math.floor(k / columns)];
      gl.viewport(column * resolution, row * resolution, resolution, resolution);
      draw(view);
    });
    this.nearest?.update();
  }
}

// Pyramids of the nearest depth, level by level as nearest.py has them.
class Nearest {
  constructor(gl, programs, map, { columns, rows, nearest }) {
    const side = 2 ** Math.max(Math.ceil(Math.log2(map.resolution / 4)), 1);
    const [width, height] = [columns * (side + side / 2), rows * side];
    const options = { depth: null };
    this.whole = depthTarget(gl, [gl.R32F], { ...options, width, height });
    this.level = depthTarget(gl, [gl.R32F], { ...options, width: side, height: side });
    const passes = nearest.map((fragment) => programs.of({ vertex: VERTEX, fragment }));
    Object.assign(this, { gl, map, columns, side, passes, texture: this.whole.textures[0] });
  }

  update() {
    const { gl, map, side, columns, passes } = this;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    map.views.forEach((_, k) => {
      const [column, row] = [k % columns, Math.floor(k / columns)];
      const [left, bottom] = [column * (side + side / 2), row * side];
      let [corner, count] = [[column * map.resolution, row * map.resolution], map.resolution];
      for (let n = side, level = 0; n >= 1; n /= 2, level++) {
        const [x, y] = level ? [left + side, bottom + side - 2 * n] : [left, bottom];
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.level.frame);
        gl.viewport(0, 0, n, n);
        const source = level ? this.texture : map.texture;
        cover(gl, passes[Math.min(level, 1)], [{ corner, side: count, size: n }], { source });
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.level.frame);
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.whole.frame);
        gl.blitFramebuffer(0, 0, n, n, x, y, x + n, y + n, gl.COLOR_BUFFER_BIT, gl.NEAREST);
        [corner, count] = [[x, y], n];
      }
    });
    gl.enable(gl.DEPTH_TEST);
  }
}

export class Shadows {
  constructor(gl, tree, programs) {
    this.tree = tree;
    this.map = new DepthMap(gl, tree);
    this.maps = [this.map];
    this.textures = { [`ibr_shadow_map_${tree.light}`]: this.map.texture };
    if (!tree.nearest) return;
    this.map.nearest = new Nearest(gl, programs, this.map, tree);
    this.textures[`ibr_shadow_near_${tree.light}`] = this.map.nearest.texture;
  }

  uniforms(view) {
    const { tree } = this;
    const worldFromEye = inverse(view.eyeFromWorld);
    const matrices = this.map.views.flatMap((light, k) => inShader(light, tree.sizes[k], worldFromEye));
    const m = view.eyeFromWorld;
    const [x, y, z, w] = tree.place;
    const place = w ? times(m, [x, y, z]) : times([...m.slice(0, 12), 0, 0, 0, 1], [x, y, z]);
    return {
      ...tree.uniforms,
      ibr_shadow_view: matrices,
      [`ibr_shadow_place_${tree.light}`]: place,
      [`ibr_shadow_size_${tree.light}`]: this.map.resolution,
    };
  }
}

// What places receivers in view space: see Frame.pixel_from_view.
export function receiverUniforms({ clipFromEye: c, parallel }) {
  const row = (i) => [c[i], c[4 + i], c[8 + i], c[12 + i]];
  const rows = [row(0), row(1), row(parallel ? 2 : 3), [0, 0, 0, 1]];
  const columns = [0, 1, 2, 3].flatMap((j) => rows.map((values) => values[j]));
  return {
    ibr_view_from_clip: inverse(columns),
    ibr_ahead: parallel ? [1, 0] : [0, 1],
    ibr_scale: 1,
  };
}
