// Text, scalar bars, axes and labels of subplots as SVG, sharp at each size. Positions of
// annotations are fractions of their viewport from its lower left corner; sizes are in pixels.
import { layoutOf, placedAxes } from './axes.js';
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

function makeText(parent, look, x, y, anchor, text, extra = {}) {
  const lines = text.split('\n');
  const node = make(
    'text',
    {
      'x': x,
      'y': y,
      'text-anchor': anchor,
      'fill': look.color,
      'font-size': look.size,
      'font-family': FONTS[look.family] ?? FONTS.arial,
      'font-weight': look.bold ? 'bold' : 'normal',
      'font-style': look.italic ? 'italic' : 'normal',
      'opacity': look.opacity ?? 1,
      ...extra,
    },
    parent,
    lines.length > 1 ? undefined : text,
  );
  if (look.shadow) node.style.filter = 'drop-shadow(1px 1px 0 rgb(0 0 0 / 0.5))';
  if (lines.length > 1)
    lines.forEach((line, i) =>
      make('tspan', { x, dy: i ? `${1.1 * look.size}` : 0 }, node, line || ' '),
    );
  return node;
}

export class Overlay {
  constructor(svg, { subplots, seams = [] }) {
    Object.assign(this, { svg, subplots, seams });
    // Pieces that follow the camera, each with a method (camera, box) => void.
    this.following = [];
  }

  // Lays everything out for a size in CSS pixels.
  layout(width, height) {
    this.svg.replaceChildren();
    this.following = this.subplots.map(() => []);
    this.boxes = this.subplots.map(({ viewport: [a, b, c, d] }) => ({
      x: a * width,
      y: (1 - d) * height,
      width: (c - a) * width,
      height: (d - b) * height,
    }));
    this.subplots.forEach((subplot, i) => {
      const box = this.boxes[i];
      const group = make('svg', { ...box, overflow: 'hidden' }, this.svg);
      for (const annotation of subplot.annotations ?? [])
        KINDS[annotation.kind]?.(annotation, group, box, this.following[i]);
      if (subplot.border) {
        const color = subplot.border.color;
        const [w, h] = [box.width, box.height];
        const style = {
          'fill': 'none',
          'stroke': color,
          'stroke-width': 2 * subplot.border.width,
        };
        make('rect', { x: 0, y: 0, width: w, height: h, ...style }, group);
      }
    });
    for (const { lines, color, width: thickness } of this.seams)
      for (const [a, b, c, d] of lines) {
        const ends = { x1: a * width, y1: (1 - b) * height, x2: c * width, y2: (1 - d) * height };
        make('line', { ...ends, 'stroke': color, 'stroke-width': thickness }, this.svg);
      }
  }

  follow(cameras) {
    this.following.forEach((pieces, i) =>
      pieces.forEach((piece) => piece(cameras[i], this.boxes[i])),
    );
  }
}

// A text whose last line has its baseline at a place; `down` pixels below it for one line.
function drawText(look, group, box) {
  const [x, y] = [look.x * box.width, look.y * box.height];
  const rows = look.text.split('\n').length;
  const first = y + 0.95 * look.down - (look.down ? 0 : 1.1 * look.size * (rows - 1));
  const extra = look.rotate ? { transform: `rotate(${look.rotate} ${x} ${y})` } : {};
  makeText(group, look, x, first, look.anchor, look.text, extra);
}

const KINDS = {
  text: drawText,
  cube_axes: drawAxes,
  ruler: drawAxes,

  legend({ rect: [left, bottom, w, h], fill, fill_opacity, border, symbols }, group, box) {
    const x = left * box.width;
    const y = (1 - bottom - h) * box.height;
    const size = { width: w * box.width, height: h * box.height };
    const look = { 'fill': fill ?? 'none', 'fill-opacity': fill_opacity };
    if (fill || border) make('rect', { x, y, ...size, ...look, stroke: border ?? 'none' }, group);
    for (const { points, color } of symbols) {
      const places = points.map((share, i) => share * (i % 2 ? box.height : box.width));
      make('polygon', { points: places.join(' '), fill: color }, group);
    }
  },

  bar(bar, group, box) {
    const values = bar.labels.map(({ text }) => text).join(', ');
    const label = `${bar.title?.text || 'Scalar bar'}: ${values}`;
    const node = make('g', { 'role': 'img', 'aria-label': label }, group);
    const [left, bottom, w, h] = bar.rect;
    const [width, height] = [w * box.width, h * box.height];
    drawColors(bar, node, left * box.width, (1 - bottom - h) * box.height, width, height);
    drawSwatches(bar, node, left * box.width, (1 - bottom - h) * box.height, width, height);
    for (const text of [...bar.labels, bar.title]) if (text) drawText(text, node, box);
  },

  axes(axes, group, box, following) {
    const [left, bottom, w, h] = axes.rect;
    const center = [(left + w / 2) * box.width, (1 - bottom - h / 2) * box.height];
    const radius = 0.3 * Math.min(w * box.width, h * box.height);
    const names = axes.labels.join(', ');
    const node = make('g', { 'role': 'img', 'aria-label': `Orientation of ${names}` }, group);
    const arms = axes.labels.map((label, i) => {
      const arm = make('g', {}, node);
      const color = axes.colors[i];
      const line = make(
        'line',
        { 'stroke': color, 'stroke-width': 3, 'stroke-linecap': 'round' },
        arm,
      );
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
        const at = (t, side = 0) => [
          center[0] + radius * (t * dx - side * dy),
          center[1] + radius * (t * dy + side * dx),
        ];
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

  labels(set, group, box, following) {
    const node = make('g', { 'role': 'list', 'aria-label': 'Labels of points' }, group);
    const items = set.texts.map((text, i) => {
      const item = make('g', { role: 'listitem' }, node);
      const frame = set.fill
        ? make('rect', { fill: set.fill, opacity: set.fill_opacity }, item)
        : null;
      const label = makeText(item, set.text, 0, 0, set.anchor ?? 'start', text);
      const width = frame ? label.getComputedTextLength() : 0;
      return { item, label, frame, width, point: [...set.points.subarray(3 * i, 3 * i + 3)] };
    });
    following.push((camera) => {
      items.forEach(({ item, label, frame, width, point }, i) => {
        const place = project(camera, box.width / box.height, point);
        const [x, y] = [place.x * box.width, (1 - place.y) * box.height];
        item.style.display = place.depth > 0 && !set.hidden?.[i] ? '' : 'none';
        label.setAttribute('x', x);
        label.setAttribute('y', y);
        if (!frame) return;
        const height = 0.75 * set.text.size + 2 * set.margin;
        const corner = { x: x - set.margin, y: y - height + set.margin, rx: set.rounded };
        const rect = { ...corner, width: width + 2 * set.margin, height };
        for (const [key, value] of Object.entries(rect)) frame.setAttribute(key, value);
      });
    });
  },
};

// Axes are laid out anew at each frame: a camera that turns moves them to other edges.
function drawAxes(annotation, group, box, following) {
  const node = make('g', { 'role': 'img', 'aria-label': titlesOf(annotation) }, group);
  following.push((camera) => {
    node.replaceChildren();
    const { middle, axes } = placedAxes(annotation, camera);
    for (const axis of axes) {
      const layout = layoutOf(axis, middle, camera, box);
      if (!layout) continue;
      const lines = annotation.kind === 'ruler' ? [layout.line, ...layout.ticks] : layout.ticks;
      for (const [x1, y1, x2, y2] of lines)
        make('line', { x1, y1, x2, y2, stroke: axis.color }, node);
      const write = (place, text, look) =>
        text && place && makeText(node, look, place.x, place.y, place.anchor, text);
      axis.labels.forEach((text, i) => write(layout.labels[i], text, axis.text));
      write(layout.title, axis.title, axis.text);
    }
  });
}

function titlesOf({ kind, title, axes }) {
  if (kind === 'ruler') return title || 'Ruler';
  const titles = axes.filter(({ visible }) => visible).map((axis) => axis.title);
  return `Axes: ${titles.filter(Boolean).join(', ')}`;
}

// Squares of the colors below and above a bar, beyond its ends.
function drawSwatches({ swatches, horizontal }, node, x, y, width, height) {
  const side = horizontal ? height : width;
  const [below, above] = horizontal
    ? [
        [x - side, y],
        [x + width + side / 2, y],
      ]
    : [
        [x, y + height + side / 4],
        [x, y - 1.25 * side],
      ];
  [below, above].forEach(([left, top], i) => {
    const square = { x: left, y: top, width: side, height: side, fill: swatches[i] };
    if (swatches[i]) make('rect', square, node);
  });
}

// The colors of a bar, as one gradient or as patches of a table.
function drawColors(bar, node, x, y, width, height) {
  const count = bar.colors.length / 4;
  for (let i = 0; i < count; i++) {
    const [r, g, b, a] = bar.colors.subarray(4 * i, 4 * i + 4);
    const rect = bar.horizontal
      ? { x: x + (i / count) * width, y, width: width / count + (i < count - 1 ? 0.5 : 0), height }
      : {
          x,
          y: y + (1 - (i + 1) / count) * height,
          width,
          height: height / count + (i ? 0.5 : 0),
        };
    const fill = {
      'fill': `rgb(${r} ${g} ${b})`,
      'fill-opacity': a / 255,
      'shape-rendering': 'crispEdges',
    };
    make('rect', { ...rect, ...fill }, node);
  }
}
