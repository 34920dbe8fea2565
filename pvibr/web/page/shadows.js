// Shadow maps of one light: the depth of all casters in its views, and what receivers read of it.
import { View, inverse, multiply, times } from './views.js';

const TEXTURE = [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0.5, 0.5, 1];

// The columns of a uniform of receivers, as shadow_maps.py has them.
function inShader(view, worldFromEye) {
  const m = multiply(
    TEXTURE,
    multiply(view.clipFromEye, multiply(view.eyeFromWorld, worldFromEye)),
  );
  const [x, y, z, w] = [0, 1, 2, 3].map((i) => [m[i], m[4 + i], m[8 + i], m[12 + i]]);
  if (view.parallel) {
    const [a, b, c] = [x, y, z].map((row) => Math.hypot(row[0], row[1], row[2]));
    const axis = (row, length) => [row[0] / length, row[1] / length, row[2] / length, length];
    return [...axis(x, a), ...axis(y, b), x[3], y[3], c, z[3], view.near, view.far, 0, 0];
  }
  const clip = view.clipFromEye;
  const rows = [x.map((t, i) => t - 0.5 * w[i]), y.map((t, i) => t - 0.5 * w[i]), w];
  const last = [clip[0] / 2, (1 - clip[10]) / 2, clip[14] / 2];
  const columns = rows.flatMap((row, i) => [row[0], row[1], row[2], last[i]]);
  return [...columns, view.near, view.far, 0, 0];
}

export class Shadows {
  constructor(gl, tree) {
    Object.assign(this, { gl, tree, stale: true });
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const { columns, rows } = tree;
    this.resolution = Math.min(tree.resolution, Math.floor(side / Math.max(columns, rows)));
    this.views = tree.views.map(
      (view) =>
        new View({
          eyeFromWorld: view.eye_from_world,
          clipFromEye: view.clip_from_eye,
          near: view.near,
          far: view.far,
          parallel: view.parallel,
          distance: 1,
          width: this.resolution,
          height: this.resolution,
        }),
    );
    this.map = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    const size = [columns * this.resolution, rows * this.resolution];
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT32F, ...size);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    const place = [gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D];
    gl.framebufferTexture2D(...place, this.map, 0);
    gl.drawBuffers([gl.NONE]);
    this.textures = { [`ibr_shadow_map_${tree.light}`]: this.map };
  }

  // Draws the maps if they are stale; `draw(view)` draws all casters.
  update(draw) {
    if (!this.stale) return;
    this.stale = false;
    const { gl, resolution, tree } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.views.forEach((view, k) => {
      const [column, row] = [k % tree.columns, Math.floor(k / tree.columns)];
      gl.viewport(column * resolution, row * resolution, resolution, resolution);
      draw(view);
    });
  }

  uniforms(view) {
    const { tree } = this;
    const worldFromEye = inverse(view.eyeFromWorld);
    const matrices = this.views.flatMap((light) => inShader(light, worldFromEye));
    const m = view.eyeFromWorld;
    const [x, y, z, w] = tree.place;
    const place = w ? times(m, [x, y, z]) : times([...m.slice(0, 12), 0, 0, 0, 1], [x, y, z]);
    return {
      ...tree.uniforms,
      ibr_shadow_view: matrices,
      [`ibr_shadow_place_${tree.light}`]: place,
      [`ibr_shadow_size_${tree.light}`]: this.resolution,
      ...receiverUniforms(view),
    };
  }
}

// What places receivers in view space: see Frame.pixel_from_view.
function receiverUniforms({ clipFromEye: c, parallel }) {
  const row = (i) => [c[i], c[4 + i], c[8 + i], c[12 + i]];
  const rows = [row(0), row(1), row(parallel ? 2 : 3), [0, 0, 0, 1]];
  const columns = [0, 1, 2, 3].flatMap((j) => rows.map((values) => values[j]));
  return {
    ibr_view_from_clip: inverse(columns),
    ibr_ahead: parallel ? [1, 0] : [0, 1],
    ibr_scale: 1,
  };
}
