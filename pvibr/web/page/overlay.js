// Text, scalar bars, axes and labels of subplots as SVG, sharp at each size. Positions of
// annotations are fractions of their viewport from its lower left corner; sizes are in pixels.
import { frameOf, project } from './camera.js';

const SVG = 'http://www.w3.org/2000/svg';
const FONTS = {
  arial: 'Arial, "Liberation Sans", Helvetica, sans-serif',
  courier: '"Courier New", "Liberation Mono", monospace',
  times: '"Times New Roman", "Liberation Serif", serif',
};

function make(name, attributes, parent, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  parent?.append(node);
  return node;
}

export const css = (color) => `rgb(${color.slice(0, 3).map((c) => Math.round(255 * c)).join(' ')})`;

function makeText(parent, look, x, y, anchor, text, extra = {}) {
  const lines = text.split('\n');
  const node = make('text', {
    'x': x, 'y': y, 'text-anchor': anchor, 'fill': css(look.color), 'font-size': look.size,
    'font-family': FONTS[look.family] ?? FONTS.arial,
    'font-weight': look.bold ? 'bold' : 'normal',
    'font-style': look.italic ? 'italic' : 'normal',
    'opacity': look.opacity ?? 1,
    ...extra,
  }, parent, lines.length > 1 ? undefined : text);
  if (look.shadow) node.style.filter = 'drop-shadow(1px 1px 0 rgb(0 0 0 / 0.5))';
  if (lines.length > 1)
    lines.forEach((line, i) =>
      make('tspan', { x, dy: i ? `${1.1 * look.size}` : 0 }, node, line || ' '));
  return node;
}

export class Overlay {
  constructor(svg, subplots) {
    this.svg = svg;
    this.subplots = subplots;
    // Pieces that follow the camera, each with a method (camera, box) => void.
    this.following = [];
  }

  // Lays everything out for a size in CSS pixels.
  layout(width, height) {
    this.svg.replaceChildren();
    this.following = this.subplots.map(() => []);
    this.boxes = this.subplots.map(({ viewport: [a, b, c, d] }) => ({
      x: a * width, y: (1 - d) * height, width: (c - a) * width, height: (d - b) * height,
    }));
    this.subplots.forEach((subplot, i) => {
      const box = this.boxes[i];
      const group = make('svg', { ...box, overflow: 'hidden' }, this.svg);
      for (const annotation of subplot.annotations ?? [])
        KINDS[annotation.kind]?.(annotation, group, box, this.following[i], subplot);
      if (subplot.border) {
        const color = css(subplot.border.color);
        const [w, h] = [box.width, box.height];
        const style = { 'fill': 'none', 'stroke': color, 'stroke-width': 2 * subplot.border.width };
        make('rect', { x: 0, y: 0, width: w, height: h, ...style }, group);
      }
    });
  }

  follow(cameras) {
    this.following.forEach((pieces, i) => pieces.forEach((piece) => piece(cameras[i], this.boxes[i])));
  }
}

const KINDS = {
  text(look, group, box) {
    const [x, y] = [look.x * box.width, (1 - look.y) * box.height];
    const rows = look.text.split('\n').length;
    // Baselines as FreeType has them for Arial: ascenders 0.73, descenders 0.21 of the size.
    const first = { top: 0.78, middle: 0.36, bottom: -0.22 }[look.baseline ?? 'bottom'] * look.size;
    const rise = { top: 0, middle: 0.55, bottom: 1.1 }[look.baseline ?? 'bottom'];
    const extra = look.rotate ? { transform: `rotate(${-look.rotate} ${x} ${y})` } : {};
    makeText(group, look, x, y + first - rise * (rows - 1) * look.size, look.anchor ?? 'start',
      look.text, extra);
  },

  bar(bar, group, box) {
    const label = `${bar.title || 'Scalar bar'}: ${bar.labels.map((l) => l.text).join(', ')}`;
    const node = make('g', { 'role': 'img', 'aria-label': label }, group);
    const [left, bottom, w, h] = bar.rect;
    const x = left * box.width;
    const y = (1 - bottom - h) * box.height;
    const [width, height] = [w * box.width, h * box.height];
    if (bar.background) {
      const [a, b, c, d] = bar.frame;
      const frame = { x: a * box.width, y: (1 - b - d) * box.height };
      Object.assign(frame, { width: c * box.width, height: d * box.height, fill: css(bar.background) });
      make('rect', frame, node);
    }
    drawColors(bar, node, x, y, width, height);
    for (const { at, text } of bar.labels) {
      if (bar.horizontal)
        makeText(node, bar.label, x + at * width, bar.label_y * box.height, 'middle', text);
      else {
        const middle = y + (1 - at) * height + 0.36 * bar.label.size;
        makeText(node, bar.label, bar.label_x * box.width, middle, 'start', text);
      }
    }
    if (bar.title)
      makeText(node, bar.titles, bar.title_x * box.width, bar.title_y * box.height, 'middle', bar.title);
    for (const extra of bar.extras ?? []) {
      const [a, b, c, d] = extra.rect;
      make('rect', {
        x: a * box.width, y: (1 - b - d) * box.height, width: c * box.width, height: d * box.height,
        fill: css(extra.color),
      }, node);
      if (extra.text)
        makeText(node, bar.label, extra.x * box.width, extra.y * box.height, extra.anchor, extra.text);
    }
  },

  axes(axes, group, box, following) {
    const [left, bottom, w, h] = axes.rect;
    const center = [(left + w / 2) * box.width, (1 - bottom - h / 2) * box.height];
    const radius = 0.3 * Math.min(w * box.width, h * box.height);
    const names = axes.labels.join(', ');
    const node = make('g', { 'role': 'img', 'aria-label': `Orientation of ${names}` }, group);
    const arms = axes.labels.map((label, i) => {
      const arm = make('g', {}, node);
      const color = css(axes.colors[i]);
      const line = make('line', { 'stroke': color, 'stroke-width': 3, 'stroke-linecap': 'round' }, arm);
      const head = make('polygon', { fill: color }, arm);
      const text = makeText(arm, axes.text, 0, 0, 'middle', label);
      return { arm, line, head, text };
    });
    following.push((camera) => {
      const { right, up, back } = frameOf(camera);
      const order = [0, 1, 2].sort((a, b) => back[a] - back[b]);
      for (const i of order) {
        const { arm, line, head, text } = arms[i];
        const [dx, dy] = [right[i], -up[i]];
        const at = (t, side = 0) =>
          [center[0] + radius * (t * dx - side * dy), center[1] + radius * (t * dy + side * dx)];
        const [x2, y2] = at(0.8);
        const ends = { x1: center[0], y1: center[1], x2, y2 };
        for (const [key, value] of Object.entries(ends)) line.setAttribute(key, value);
        head.setAttribute('points', [at(1), at(0.7, 0.1), at(0.7, -0.1)].join(' '));
        const [tx, ty] = at(1.3);
        text.setAttribute('x', tx);
        text.setAttribute('y', ty + 0.35 * axes.text.size);
        node.append(arm);
      }
    });
  },

  labels(set, group, box, following, subplot) {
    const node = make('g', { 'role': 'list', 'aria-label': 'Labels of points' }, group);
    const items = set.texts.map((text, i) => {
      const item = make('g', { role: 'listitem' }, node);
      const frame = set.fill ? make('rect', { fill: css(set.fill), opacity: set.fill_opacity }, item) : null;
      const label = makeText(item, set.text, 0, 0, set.anchor ?? 'start', text);
      const width = frame ? label.getComputedTextLength() : 0;
      return { item, label, frame, width, point: [...set.points.subarray(3 * i, 3 * i + 3)] };
    });
    following.push((camera) => {
      for (const { item, label, frame, width, point } of items) {
        const place = project(camera, box.width / box.height, point);
        const [x, y] = [place.x * box.width, (1 - place.y) * box.height];
        item.style.display = place.depth > 0 ? '' : 'none';
        label.setAttribute('x', x + (frame ? set.margin : 0));
        label.setAttribute('y', y - (frame ? set.margin : 0) - 0.1 * set.text.size);
        if (!frame) continue;
        const height = set.text.size + 2 * set.margin;
        const rect = { x, y: y - height, width: width + 2 * set.margin, height };
        for (const [key, value] of Object.entries(rect)) frame.setAttribute(key, value);
      }
    });
    void subplot;
  },

  bounds(grid, group, box, following) {
    const node = make('g', { 'role': 'img', 'aria-label': grid.label }, group);
    following.push((camera) => drawBounds(grid, node, box, camera));
  },
};

// The colors of a bar, as one gradient or as patches of a table.
function drawColors(bar, node, x, y, width, height) {
  const count = bar.colors.length / 4;
  for (let i = 0; i < count; i++) {
    const [r, g, b, a] = bar.colors.subarray(4 * i, 4 * i + 4);
    const rect = bar.horizontal
      ? { x: x + (i / count) * width, y, width: width / count + (i < count - 1 ? 0.5 : 0), height }
      : { x, y: y + (1 - (i + 1) / count) * height, width, height: height / count + (i ? 0.5 : 0) };
    const fill = { 'fill': `rgb(${r} ${g} ${b})`, 'fill-opacity': a / 255, 'shape-rendering': 'crispEdges' };
    make('rect', { ...rect, ...fill }, node);
  }
}

const EDGES = [0, 1, 2].flatMap((axis) =>
  [0, 1, 2, 3].map((k) => ({ axis, low: k & 1, high: k >> 1 })));

// Each axis is named along the edge of the box that is outermost in the picture.
function drawBounds(grid, node, box, camera) {
  node.replaceChildren();
  const aspect = box.width / box.height;
  const at = (point) => {
    const place = project(camera, aspect, point);
    return { x: place.x * box.width, y: (1 - place.y) * box.height, depth: place.depth };
  };
  const { bounds } = grid;
  const center = at([0, 2, 4].map((i) => (bounds[i] + bounds[i + 1]) / 2));
  grid.axes.forEach((axis) => {
    const edges = EDGES.filter((edge) => edge.axis === axis.axis).map((edge) => {
      const others = [0, 1, 2].filter((k) => k !== edge.axis);
      const point = (t) => {
        const p = [0, 0, 0];
        p[edge.axis] = bounds[2 * edge.axis] + t * (bounds[2 * edge.axis + 1] - bounds[2 * edge.axis]);
        p[others[0]] = bounds[2 * others[0] + edge.low];
        p[others[1]] = bounds[2 * others[1] + edge.high];
        return p;
      };
      return { point, a: at(point(0)), b: at(point(1)), m: at(point(0.5)) };
    });
    if (edges.some(({ a, b }) => a.depth <= 0 || b.depth <= 0)) return;
    const outer = ({ m }) => (axis.axis === 2 ? -m.x : m.y);
    const edge = edges.reduce((best, e) => (outer(e) > outer(best) ? e : best));
    const color = css(grid.text.color);
    make('line', { x1: edge.a.x, y1: edge.a.y, x2: edge.b.x, y2: edge.b.y, stroke: color }, node);
    const away = [edge.m.x - center.x, edge.m.y - center.y];
    const length = Math.hypot(...away) || 1;
    const out = away.map((d) => d / length);
    for (const { at: t, text } of axis.labels) {
      const p = at(edge.point(t));
      const tick = { x1: p.x, y1: p.y, x2: p.x + 5 * out[0], y2: p.y + 5 * out[1], stroke: color };
      make('line', tick, node);
      const anchor = out[0] < -0.4 ? 'end' : out[0] > 0.4 ? 'start' : 'middle';
      const drop = 0.36 * grid.text.size;
      makeText(node, grid.text, p.x + 10 * out[0], p.y + 14 * out[1] + drop, anchor, text);
    }
    const far = 3.2 * grid.text.size;
    makeText(node, grid.text, edge.m.x + far * out[0], edge.m.y + far * out[1], 'middle', axis.title);
  });
}
