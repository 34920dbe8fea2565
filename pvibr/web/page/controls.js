// Mouse, touch and keys, as vtkInteractorStyleTrackballCamera acts on them, in CSS pixels.
import { dolly, isometric, pan, reset, roll, rotate } from './camera.js';

const MOTION_FACTOR = 10;
const CLICK_PIXELS = 4;

export class Controls {
  // `view` has: element, subplots, cameras, and the methods moved(), clicked(subplot, x, y).
  constructor(view) {
    this.view = view;
    this.pointers = new Map();
    this.subplot = 0;
    const { element } = view;
    element.addEventListener('pointerdown', (event) => this.down(event));
    element.addEventListener('pointermove', (event) => this.move(event));
    for (const name of ['pointerup', 'pointercancel'])
      element.addEventListener(name, (event) => this.up(event));
    element.addEventListener('wheel', (event) => this.wheel(event), { passive: false });
    element.addEventListener('contextmenu', (event) => event.preventDefault());
    element.addEventListener('keydown', (event) => this.key(event));
  }

  // The position of an event, from the lower left corner, and the size of the whole view.
  place(event) {
    const box = this.view.element.getBoundingClientRect();
    return {
      x: event.clientX - box.left,
      y: box.bottom - event.clientY,
      width: box.width,
      height: box.height,
    };
  }

  find({ x, y, width, height }) {
    const [u, v] = [x / width, y / height];
    const inside = ({ viewport: [a, b, c, d] }) => u >= a && u <= c && v >= b && v <= d;
    const found = this.view.subplots.findLastIndex(inside);
    return Math.max(found, 0);
  }

  get camera() {
    return this.view.cameras[this.subplot];
  }

  // The center and the height of a subplot, and its aspect.
  box(place) {
    const [a, b, c, d] = this.view.subplots[this.subplot].viewport;
    const [width, height] = [(c - a) * place.width, (d - b) * place.height];
    const center = [((a + c) / 2) * place.width, ((b + d) / 2) * place.height];
    return { center, height, aspect: width / height };
  }

  down(event) {
    const place = this.place(event);
    this.view.element.focus({ preventScroll: true });
    if (!this.pointers.size) {
      this.subplot = this.find(place);
      this.travelled = 0;
      this.button = event.button;
    }
    this.view.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, place);
    if (event.button === 1) event.preventDefault();
  }

  up(event) {
    const place = this.pointers.get(event.pointerId);
    const last = this.pointers.size === 1;
    this.pointers.delete(event.pointerId);
    if (place && last && event.type === 'pointerup' && this.button === 0)
      if (this.travelled < CLICK_PIXELS) this.view.clicked(this.subplot, place.x, place.y);
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const place = this.place(event);
    const [dx, dy] = [place.x - before.x, place.y - before.y];
    if (!dx && !dy) return;
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
    this.travelled += Math.hypot(dx, dy) + (others.length ? CLICK_PIXELS : 0);
    if (this.travelled < CLICK_PIXELS && event.pointerType !== 'mouse') return;
    if (others.length) this.pinch(before, place, others[0][1]);
    else this.drag(event, before, place);
    this.pointers.set(event.pointerId, place);
    this.view.moved();
  }

  drag(event, before, place) {
    const [dx, dy] = [place.x - before.x, place.y - before.y];
    const { center, height } = this.box(place);
    const right = this.button === 2 || (this.button === 0 && event.shiftKey && event.ctrlKey);
    if (right) dolly(this.camera, 1.1 ** ((MOTION_FACTOR * dy) / center[1]));
    else if (this.button === 1 || event.shiftKey) pan(this.camera, dx, dy, height);
    else if (event.ctrlKey) {
      const angle = ({ x, y }) => (Math.atan2(y - center[1], x - center[0]) * 180) / Math.PI;
      roll(this.camera, angle(place) - angle(before));
    } else {
      const factor = -20 * MOTION_FACTOR;
      rotate(this.camera, (factor * dx) / place.width, (factor * dy) / place.height);
    }
  }

  // Two fingers: their distance zooms, their middle pans, their angle rolls.
  pinch(before, place, other) {
    const vector = (p) => [p.x - other.x, p.y - other.y];
    const [a, b] = [vector(before), vector(place)];
    const { height } = this.box(place);
    dolly(this.camera, Math.max(Math.hypot(...b), 1) / Math.max(Math.hypot(...a), 1));
    pan(this.camera, (place.x - before.x) / 2, (place.y - before.y) / 2, height);
    const turn = Math.atan2(b[1], b[0]) - Math.atan2(a[1], a[0]);
    roll(this.camera, (Math.atan2(Math.sin(turn), Math.cos(turn)) * 180) / Math.PI);
  }

  wheel(event) {
    event.preventDefault();
    const place = this.place(event);
    if (!this.pointers.size) this.subplot = this.find(place);
    // A notch is 100 or 120 pixels, or 3 lines; touch pads send many small steps.
    const notches = event.deltaMode ? event.deltaY / 3 : event.deltaY / 100;
    dolly(this.camera, 1.1 ** (-0.2 * MOTION_FACTOR * Math.max(-3, Math.min(3, notches))));
    this.view.moved();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== this.view.element)
      return;
    const { aspect, height } = this.box(this.place({ clientX: 0, clientY: 0 }));
    const { bounds } = this.view.subplots[this.subplot];
    const step = 5;
    const turns = { ArrowLeft: [step, 0], ArrowRight: [-step, 0] };
    Object.assign(turns, { ArrowUp: [0, -step], ArrowDown: [0, step] });
    const turn = turns[event.key];
    if (turn && event.shiftKey) pan(this.camera, -turn[0] * 4, -turn[1] * 4, height);
    else if (turn) rotate(this.camera, ...turn);
    else if (event.key === '+' || event.key === '=') dolly(this.camera, 1.1);
    else if (event.key === '-') dolly(this.camera, 1 / 1.1);
    else if (event.key === 'r') reset(this.camera, bounds, aspect);
    else if (event.key === 'v') isometric(this.camera, bounds, aspect);
    else if (event.key === ' ' && this.view.timeline) this.view.timeline.toggle();
    else return;
    event.preventDefault();
    this.view.moved();
  }
}
