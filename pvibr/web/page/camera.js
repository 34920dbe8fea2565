// Cameras as VTK has them, and what its trackball style does to them. All vectors are arrays of 3.

export const add = (a, b, scale = 1) => a.map((x, i) => x + scale * b[i]);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const norm = (a) => Math.hypot(...a);
export const unit = (a) => a.map((x) => x / (norm(a) || 1));
const radians = (degrees) => (degrees * Math.PI) / 180;

// A vector turned about an axis, by Rodrigues' formula.
function turned(v, axis, degrees) {
  const [k, c, s] = [unit(axis), Math.cos(radians(degrees)), Math.sin(radians(degrees))];
  const across = cross(k, v);
  return v.map((x, i) => x * c + across[i] * s + k[i] * dot(k, v) * (1 - c));
}

// Right, up and backward of the eye, and its distance to the focal point.
export function frameOf(camera) {
  const back = add(camera.position, camera.focal_point, -1);
  const right = unit(cross(camera.up, back));
  return { right, up: unit(cross(back, right)), back: unit(back), distance: norm(back) };
}

const orbit = (camera, axis, degrees) => {
  const offset = add(camera.position, camera.focal_point, -1);
  camera.position = add(camera.focal_point, turned(offset, axis, degrees));
};
const orthogonalizeUp = (camera) => (camera.up = frameOf(camera).up);

// vtkCamera::Azimuth and Elevation, as Rotate of the trackball style calls them.
export function rotate(camera, azimuth, elevation) {
  orbit(camera, camera.up, azimuth);
  orbit(
    camera,
    frameOf(camera).right.map((x) => -x),
    elevation,
  );
  orthogonalizeUp(camera);
}

export function roll(camera, degrees) {
  camera.up = turned(camera.up, add(camera.focal_point, camera.position, -1), degrees);
  orthogonalizeUp(camera);
}

export function dolly(camera, factor) {
  if (camera.parallel_projection) camera.parallel_scale /= factor;
  else {
    const offset = add(camera.position, camera.focal_point, -1);
    camera.position = add(camera.focal_point, offset, 1 / factor);
  }
}

// Half of the height that is seen at a distance.
function halfHeight(camera, distance) {
  if (camera.parallel_projection) return camera.parallel_scale;
  return distance * Math.tan(radians(camera.view_angle) / 2);
}

// Moves by pixels of a viewport of a height: what is under the pointer stays there.
export function pan(camera, dx, dy, height) {
  const { right, up, distance } = frameOf(camera);
  const perPixel = (2 * halfHeight(camera, distance)) / height;
  const motion = right.map((x, i) => -perPixel * (dx * x + dy * up[i]));
  camera.position = add(camera.position, motion);
  camera.focal_point = add(camera.focal_point, motion);
}

// vtkRenderer::ResetCamera.
export function reset(camera, bounds, aspect) {
  const sides = [bounds[1] - bounds[0], bounds[3] - bounds[2], bounds[5] - bounds[4]];
  const radius = 0.5 * (norm(sides) || 1);
  const half = radians(camera.view_angle) / 2;
  const angle = aspect >= 1 ? half : Math.atan(Math.tan(half) * aspect);
  const { back } = frameOf(camera);
  if (Math.abs(dot(camera.up, back)) > 0.999)
    camera.up = [-camera.up[2], camera.up[0], camera.up[1]];
  camera.focal_point = [0, 2, 4].map((i) => (bounds[i] + bounds[i + 1]) / 2);
  camera.position = add(camera.focal_point, back, radius / Math.sin(angle));
  camera.parallel_scale = aspect >= 1 ? radius : radius / aspect;
  resetClippingRange(camera, bounds);
}

// vtkRenderer::ResetCameraClippingRange; the near plane is at least a share of the far one.
export function resetClippingRange(camera, bounds, least = 0.001) {
  if (!(bounds[0] <= bounds[1])) return;
  const { back } = frameOf(camera);
  let [near, far] = [Infinity, 1e-18];
  for (let corner = 0; corner < 8; corner++) {
    const point = [0, 1, 2].map((i) => bounds[2 * i + ((corner >> i) & 1)]);
    const depth = dot(back, add(camera.position, point, -1));
    [near, far] = [Math.min(near, depth), Math.max(far, depth)];
  }
  const gap = camera.parallel_projection
    ? 0.1 * camera.parallel_scale
    : 0.2 * Math.tan(radians(camera.view_angle) / 2) * far;
  if (far - near < gap) {
    const missing = gap - far + near;
    [near, far] = [near - missing / 2, far + missing / 2];
  }
  near = Math.max(near, 0);
  near = 0.99 * near - 0.5 * (far - near);
  far = 1.01 * far + 0.5 * (far - near);
  if (near >= far) near = 0.01 * far;
  camera.clipping_range = [Math.max(near, least * far), far];
}

// PyVista's view_isometric, keeping no distance: the scene is framed again.
export function isometric(camera, bounds, aspect) {
  camera.position = add(camera.focal_point, [1, 1, 1]);
  camera.up = [0, 0, 1];
  reset(camera, bounds, aspect);
}

// Where a point is in a viewport: x and y from 0 to 1, from its lower left corner, and its depth.
export function project(camera, aspect, point) {
  const { right, up, back } = frameOf(camera);
  const offset = add(point, camera.position, -1);
  const depth = -dot(back, offset);
  const half = halfHeight(camera, depth);
  const [cx, cy] = camera.window_center ?? [0, 0];
  const x = dot(right, offset) / (half * aspect) - cx;
  const y = dot(up, offset) / half - cy;
  return { x: (x + 1) / 2, y: (y + 1) / 2, depth };
}
