// Axes around scenes, as vtkCubeAxesActor places them, and axes between two points.
import { add, frameOf, project } from './camera.js';

const TICK = 4; // pixels
const GAP = 4;
const FLAT = 1e-9;

const cornerOf = (bounds, sides) => sides.map((side, i) => bounds[2 * i + side]);

// Whether a face of the bounds looks toward the eye.
function faces(bounds, camera, axis, side) {
  const sign = side ? 1 : -1;
  if (camera.parallel_projection) return sign * frameOf(camera).back[axis] > FLAT;
  return sign * (camera.position[axis] - bounds[2 * axis + side]) > 0;
}

function sidesOf([axis, one, other]) {
  const sides = [0, 0, 0];
  sides[(axis + 1) % 3] = one;
  sides[(axis + 2) % 3] = other;
  return sides;
}

const ALL = [0, 1, 2].flatMap((axis) =>
  [0, 1].flatMap((one) => [0, 1].map((other) => [axis, one, other])),
);

// The edges at which axes are: each is its axis and the sides of the other two.
function chosenEdges({ bounds, edges }, camera) {
  if (edges === 'all') return ALL;
  if (edges === 'outer') {
    const isOutline = ([axis, one, other]) =>
      faces(bounds, camera, (axis + 1) % 3, one) !== faces(bounds, camera, (axis + 2) % 3, other);
    // Of the two outlines along an axis, the one that is lower, or left.
    const height = (edge) => {
      const middle = cornerOf(bounds, sidesOf(edge));
      middle[edge[0]] = (bounds[2 * edge[0]] + bounds[2 * edge[0] + 1]) / 2;
      const { x, y } = project(camera, 1, middle);
      return x + 1.5 * y;
    };
    const lowest = (axis) =>
      ALL.filter((edge) => edge[0] === axis && isOutline(edge)).sort(
        (a, b) => height(a) - height(b),
      )[0];
    return [0, 1, 2].map(lowest).filter(Boolean);
  }
  const corners = ALL.slice(0, 4).flatMap(([, one, other]) => [
    [0, one, other],
    [1, one, other],
  ]);
  const depth = (sides) => project(camera, 1, cornerOf(bounds, sides)).depth;
  const byDepth = [...corners].sort((a, b) => depth(a) - depth(b));
  const corner = { closest: byDepth[0], furthest: byDepth.at(-1), origin: [0, 0, 0] }[edges];
  return [0, 1, 2].map((axis) => [axis, corner[(axis + 1) % 3], corner[(axis + 2) % 3]]);
}

// Shows the lines of edges and grids that a camera calls for.
export function showLines(subplot, camera) {
  for (const cube of subplot.annotations ?? []) {
    if (cube.kind !== 'cube_axes') continue;
    const chosen = chosenEdges(cube, camera).map(String);
    for (const thing of subplot.things) {
      if (thing.cube?.edge) thing.visible = chosen.includes(String(thing.cube.edge));
      if (!thing.cube?.face) continue;
      const isFront = faces(cube.bounds, camera, ...thing.cube.face);
      thing.visible = cube.grid === 'all' || (cube.grid === 'closest') === isFront;
    }
  }
}

// The axes of an annotation as ends, shares of ticks, and labels; the middle of the whole.
export function placedAxes(annotation, camera) {
  if (annotation.kind === 'ruler') {
    const { ends } = annotation;
    return { middle: null, axes: [{ ...annotation, ends }] };
  }
  const { bounds, axes } = annotation;
  const placed = chosenEdges(annotation, camera)
    .filter(([axis]) => axes[axis].visible)
    .map((edge) => {
      const [low, high] = [bounds[2 * edge[0]], bounds[2 * edge[0] + 1]];
      const ends = [0, 1].map((side) => {
        const sides = sidesOf(edge);
        sides[edge[0]] = side;
        return cornerOf(bounds, sides);
      });
      const ticks = axes[edge[0]].ticks.map((x) => (x - low) / (high - low || 1));
      return { ...axes[edge[0]], ends, ticks };
    });
  return { middle: [0, 1, 2].map((i) => (bounds[2 * i] + bounds[2 * i + 1]) / 2), axes: placed };
}

// Where the parts of an axis are in a box of pixels: ticks, labels with their anchors, the title.
export function layoutOf({ ends, ticks, labels, title, text }, middle, camera, box) {
  const at = (point) => {
    const { x, y, depth } = project(camera, box.width / box.height, point);
    return { x: x * box.width, y: (1 - y) * box.height, depth };
  };
  const [a, b] = ends.map(at);
  if (a.depth <= 0 || b.depth <= 0) return null;
  const length = Math.hypot(b.x - a.x, b.y - a.y);
  if (length < 1) return null;
  let normal = [-(b.y - a.y) / length, (b.x - a.x) / length];
  const center = middle && at(middle);
  const away = (m) =>
    normal[0] * ((a.x + b.x) / 2 - m.x) + normal[1] * ((a.y + b.y) / 2 - m.y);
  if (center && away(center) < 0) normal = normal.map((x) => -x);
  const [nx, ny] = normal;
  const anchor = Math.abs(nx) < 0.35 ? 'middle' : nx < 0 ? 'end' : 'start';
  const label = (place, distance) => ({
    x: place.x + distance * nx,
    y: place.y + distance * ny + 0.35 * text.size,
    anchor,
  });
  const distance = TICK + GAP + 0.4 * text.size * Math.abs(ny);
  const longest = Math.max(0, ...labels.map((s) => s.length));
  const beyond = 0.6 * text.size * longest * Math.abs(nx) + 1.3 * text.size * Math.abs(ny);
  const direction = add(ends[1], ends[0], -1);
  const places = ticks.map((t) => at(add(ends[0], direction, t)));
  return {
    line: [a.x, a.y, b.x, b.y],
    ticks: places.map(({ x, y }) => [x, y, x + TICK * nx, y + TICK * ny]),
    labels: places.map((place) => label(place, distance)),
    title: title && label({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 }, distance + beyond + GAP),
  };
}
