// What programs of VTK read of a camera and of lights. Matrices are by columns, as WebGL has them.
import { frameOf, add, unit } from './camera.js';

const radians = (degrees) => (degrees * Math.PI) / 180;

export function multiply(a, b) {
  const c = new Array(16).fill(0);
  for (let j = 0; j < 4; j++)
    for (let i = 0; i < 4; i++)
      for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

export const times = (m, p) =>
  [0, 1, 2].map((i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);

// The inverse transpose of the upper left of a matrix.
export function normalMatrix(m) {
  const [a, b, c] = [m.slice(0, 3), m.slice(4, 7), m.slice(8, 11)];
  const cross = (u, v) => [
    u[1] * v[2] - u[2] * v[1],
    u[2] * v[0] - u[0] * v[2],
    u[0] * v[1] - u[1] * v[0],
  ];
  const rows = [cross(b, c), cross(c, a), cross(a, b)];
  const det = a[0] * rows[0][0] + a[1] * rows[0][1] + a[2] * rows[0][2] || 1;
  return rows.flat().map((x) => x / det);
}

// The inverse of a matrix, by Gauss and Jordan with pivots.
export function inverse(m) {
  const rows = [0, 1, 2, 3].map((i) => [
    ...[0, 1, 2, 3].map((j) => m[4 * j + i]),
    ...[0, 1, 2, 3].map((j) => Number(i === j)),
  ]);
  for (let k = 0; k < 4; k++) {
    let pivot = k;
    for (let i = k + 1; i < 4; i++)
      if (Math.abs(rows[i][k]) > Math.abs(rows[pivot][k])) pivot = i;
    [rows[k], rows[pivot]] = [rows[pivot], rows[k]];
    const scale = rows[k][k];
    rows[k] = rows[k].map((x) => x / scale);
    for (let i = 0; i < 4; i++)
      if (i !== k) {
        const share = rows[i][k];
        rows[i] = rows[i].map((x, j) => x - share * rows[k][j]);
      }
  }
  return [0, 1, 2, 3].flatMap((j) => rows.map((row) => row[4 + j]));
}

// The view of a camera in a viewport of pixels.
export function viewOf(camera, width, height) {
  const { right, up, back, distance } = frameOf(camera);
  const eye = camera.position;
  const [near, far] = camera.clipping_range;
  const parallel = camera.parallel_projection;
  const [cx, cy] = camera.window_center ?? [0, 0];
  const half = parallel ? camera.parallel_scale : Math.tan(radians(camera.view_angle) / 2);
  const along = (axis) => -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
  const axes = [0, 1, 2].flatMap((i) => [right[i], up[i], back[i], 0]);
  const eyeFromWorld = [...axes, along(right), along(up), along(back), 1];
  const [sx, sy] = [height / (half * width), 1 / half];
  const [sum, gap] = [far + near, far - near];
  const clipFromEye = parallel
    ? [sx, 0, 0, 0, 0, sy, 0, 0, 0, 0, -2 / gap, 0, -cx, -cy, -sum / gap, 1]
    : [sx, 0, 0, 0, 0, sy, 0, 0, cx, cy, -sum / gap, -1, 0, 0, (-2 * far * near) / gap, 0];
  const values = { eyeFromWorld, clipFromEye, near, far, parallel, width, height, distance };
  const tangent = Math.tan(radians(camera.view_angle) / 2);
  return new View({ ...values, tangent, center: [cx, cy] });
}

// VTK's matrices and pvibr's uniforms of a view, from a camera or a light.
export class View {
  constructor(values) {
    Object.assign(this, values);
    const { height, parallel } = this;
    const [m, e] = [this.clipFromEye, this.eyeFromWorld];
    this.pixelScale = (height * m[5]) / 2;
    this.rotation = [e[0], e[1], e[2], e[4], e[5], e[6], e[8], e[9], e[10]];
    this.uniforms = {
      cameraParallel: Number(parallel),
      ibr_parallel: Number(parallel),
      ibr_pixel_scale: this.pixelScale,
      ibr_eye_from_world: this.rotation,
      ibr_clip_from_eye: m,
      ibr_clip_depth: [m[10], m[14], m[11], m[15]],
      ibr_fades: 1,
      ibr_dither: 0,
      ibr_error: 1,
      PrimitiveIDOffset: 0,
    };
    this.planes = this.sidePlanes();
  }

  // Planes of the sides of the frustum in eye space, inside positive.
  sidePlanes() {
    const m = this.clipFromEye;
    const row = (i) => [m[i], m[4 + i], m[8 + i], m[12 + i]];
    return [0, 1].flatMap((i) =>
      [1, -1].map((sign) => {
        const plane = row(3).map((w, k) => w + sign * row(i)[k]);
        const length = Math.hypot(plane[0], plane[1], plane[2]);
        return plane.map((x) => x / length);
      }),
    );
  }

  // The uniforms of lights, numbered as VTK numbers those that are on.
  lightUniforms(lights) {
    const uniforms = {};
    const fromScene = (p) => times(this.eyeFromWorld, p);
    const fromCamera = (p) => [p[0], p[1], p[2] - 1].map((x) => x * this.distance);
    lights.forEach((light, i) => {
      const place = light.kind === 'camera' ? fromCamera : fromScene;
      let [position, direction] = [
        [0, 0, 0],
        [0, 0, -1],
      ];
      if (light.kind !== 'head') {
        position = place(light.position);
        direction = unit(add(place(light.focal_point), position, -1));
      }
      uniforms[`lightColor${i}`] = light.color;
      uniforms[`lightDirectionVC${i}`] = direction;
      uniforms[`lightPositionVC${i}`] = position;
      uniforms[`lightHalfAngleVC${i}`] = unit(add([0, 0, 1], direction, -1));
      uniforms[`lightPositional${i}`] = light.positional;
      uniforms[`lightConeAngle${i}`] = light.cone;
      uniforms[`lightExponent${i}`] = light.exponent;
      uniforms[`lightAttenuation${i}`] = light.attenuation;
    });
    return uniforms;
  }
}
