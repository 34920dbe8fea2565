// The page: reads the scene, draws it when something changes, and says what fails.
import { showLines } from './axes.js';
import { reset } from './camera.js';
import { readScene, DamagedError } from './container.js';
import { Controls } from './controls.js';
import { Overlay } from './overlay.js';
import { Panel } from './panel.js';
import { Renderer } from './renderer.js';
import { Timeline } from './timeline.js';

const NO_WEBGL =
  'This page draws with WebGL 2, which this browser does not offer. Switch on hardware ' +
  'acceleration in its settings, or open the page in another browser.';
const REST_MS = 250;
const FRAME_MS = 50;
const QUALITIES = [1, 0.7, 0.5, 0.35, 0.25]; // shares of the pixels of each side
const KEYS = 'arrow keys turn, + and - zoom, r resets, v is the isometric view';

function say(text) {
  const message = document.getElementById('message');
  message.hidden = !text;
  message.textContent = text;
}

class View {
  constructor(scene, parent) {
    this.scene = scene;
    this.subplots = scene.subplots;
    this.element = document.createElement('div');
    this.element.className = 'view';
    this.element.tabIndex = 0;
    this.element.setAttribute('role', 'application');
    this.element.setAttribute('aria-label', `${document.title}: ${KEYS}`);
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('aria-hidden', 'true');
    this.svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    this.status = document.createElement('p');
    this.status.className = 'status';
    this.status.setAttribute('role', 'status');
    this.element.append(this.canvas, this.svg);
    parent.append(this.element, this.status);
    this.begin();
  }

  begin() {
    const { scene } = this;
    // Linked subplots have the same camera: one object, so that each moves the others.
    const first = this.subplots.map(({ camera }) => structuredClone(camera));
    this.cameras = this.subplots.map(({ link }, i) => first[link ?? i]);
    this.initial = structuredClone(this.cameras);
    this.quality = 1;
    this.overlay = new Overlay(this.svg, scene);
    this.controls = new Controls(this);
    this.frames = 0;
    this.sample = 0; // of those whose mean is drawn at rest
    this.draws = () => this.frame();
    if (scene.clock) this.timeline = new Timeline(this);
    if (location.hash !== '#bare') {
      this.panel = new Panel(this, this.element.parentElement);
      this.timeline?.show(this.element.parentElement);
    }
    this.canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      this.lost = true;
      say(
        'The graphics of this page were taken away by the browser. They return by themselves, ' +
          'or reload the page.',
      );
    });
    this.canvas.addEventListener('webglcontextrestored', () => {
      this.lost = false;
      say('');
      this.connect();
    });
    this.connect();
    new ResizeObserver(() => this.resized()).observe(this.element);
    this.watchRatio();
  }

  connect() {
    const options = { antialias: false, depth: false, preserveDrawingBuffer: true };
    const gl = this.canvas.getContext('webgl2', options);
    if (!gl) throw new Error(NO_WEBGL);
    this.gl = gl;
    this.renderer = new Renderer(gl, this.scene);
    for (const thing of this.subplots.flatMap(({ things }) => things))
      if (thing.recolored) this.renderer.setScalars(...thing.recolored);
    this.changed();
  }

  // A window that moves to another screen has another ratio of device pixels.
  watchRatio() {
    const query = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    const changed = () => {
      this.resized();
      this.watchRatio();
    };
    query.addEventListener('change', changed, { once: true });
  }

  resized() {
    const { clientWidth, clientHeight } = this.element;
    if (!clientWidth || !clientHeight) return;
    [this.canvas.width, this.canvas.height] = [clientWidth, clientHeight].map((side) =>
      Math.max(1, Math.round(side * devicePixelRatio)),
    );
    this.svg.setAttribute('viewBox', `0 0 ${clientWidth} ${clientHeight}`);
    this.overlay.layout(clientWidth, clientHeight);
    this.sample = 0;
    this.frame(); // now: a canvas of another size is empty until it is drawn
  }

  changed() {
    this.sample = 0;
    this.request();
  }

  request() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(this.draws);
  }

  // Whether the picture is whole: no frame is waited for.
  get settled() {
    return !this.waiting && !this.resting;
  }

  frame() {
    this.waiting = false;
    if (this.lost || !this.canvas.width) return;
    this.adapt();
    this.subplots.forEach((subplot, i) => showLines(subplot, this.cameras[i]));
    this.timeline?.tick();
    try {
      const size = [this.canvas.width, this.canvas.height];
      const quality = this.resting ? this.quality : 1;
      const sample = this.isStill ? this.sample : null;
      this.renderer.draw(this.cameras, size, quality, this.timeline?.time, sample);
    } catch (error) {
      this.lost = true;
      say(`This page could not be drawn: ${error.message}`);
      throw error;
    }
    const { refused } = this.renderer;
    if (refused.size) say(`This browser cannot draw ${[...refused].join(', ')}.`);
    this.follow();
    this.frames += 1;
    if (this.timeline?.playing) this.moved();
    if (!this.isStill || this.sample + 1 >= this.scene.samples) return;
    this.sample += 1;
    this.request();
  }

  // Whether the mean of several pictures is drawn.
  get isStill() {
    return this.scene.samples > 1 && !this.resting && !this.timeline?.playing;
  }

  // Labels follow the camera, at once, and again when it is known which are hidden.
  follow() {
    this.overlay.follow(this.cameras);
    if (!this.renderer.labels.every((labels) => labels.answered()))
      requestAnimationFrame(() => this.lost || this.follow());
  }

  // While the view moves, pictures have fewer pixels if that keeps the time of a frame.
  adapt() {
    const now = performance.now();
    if (this.resting && now - this.last < 4 * REST_MS) {
      const exact = this.quality * Math.sqrt(FRAME_MS / Math.max(now - this.last, 1));
      const lower = QUALITIES.find((quality) => quality <= exact) ?? QUALITIES.at(-1);
      if (lower < this.quality || exact > 1.3 * this.quality) this.quality = lower;
    }
    this.last = now;
  }

  // The view has moved: the next picture at rest is whole again.
  moved() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.resting = null;
      this.changed();
    }, REST_MS);
    this.changed();
  }

  clicked(subplot, x, y) {
    const { clientWidth, clientHeight } = this.element;
    const hit = this.renderer.pick(subplot, x / clientWidth, y / clientHeight);
    if (!hit) return (this.status.textContent = '');
    const values = Object.entries(hit.values).map(([name, value]) => `${name} ${shown(value)}`);
    return (this.status.textContent = [`${hit.name} ${hit.index}`, ...values].join(', '));
  }

  reset() {
    this.cameras.forEach((camera, i) => {
      Object.assign(camera, structuredClone(this.initial[i]));
      if (camera.position.every((x, k) => x === camera.focal_point[k]))
        reset(camera, this.subplots[i].bounds, this.canvas.width / this.canvas.height);
    });
    this.changed();
  }

  rangeOf(thing, name) {
    let [low, high] = [Infinity, -Infinity];
    for (const value of thing.scalars[name]) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return low < high ? [low, high] : [low - 0.5, low + 0.5];
  }

  recolor(thing, name, range, cmap) {
    const table = this.scene.colormaps?.[cmap] ?? thing.coloring?.table;
    thing.recolored = [thing, name, range, table];
    this.renderer.setScalars(thing, name, range, table);
    for (const bar of this.subplots.flatMap(({ annotations }) => annotations ?? []))
      if (bar.kind === 'bar' && bar.thing === thing.name) relabel(bar, thing.coloring, name, table);
    this.overlay.layout(this.element.clientWidth, this.element.clientHeight);
    this.changed();
  }
}

const shown = (x) => (typeof x === 'number' ? String(Number(x.toPrecision(6))) : String(x));

// A bar after its colors have changed: as many labels as before, over the new range.
function relabel(bar, { range, log }, name, table) {
  if (bar.title) bar.title.text = name;
  if (table) bar.colors = table;
  const count = bar.labels.length;
  const digits = Math.max(
    0,
    2 - Math.floor(Math.log10((range[1] - range[0]) / Math.max(count - 1, 1))),
  );
  const [low, high] = range;
  bar.labels.forEach((label) => {
    const value = log && low > 0 ? low * (high / low) ** label.at : low + label.at * (high - low);
    label.text =
      digits > 6 || Math.abs(value) >= 1e6
        ? value.toExponential(2)
        : value.toFixed(Math.min(digits, 6));
  });
}

async function main() {
  if (!window.WebGL2RenderingContext) return say(NO_WEBGL);
  if (!window.DecompressionStream)
    return say('This browser is too old for this page: it has no DecompressionStream.');
  say('Loading …');
  try {
    const scene = await readScene(document);
    window.pvibr = new View(scene, document.getElementById('page'));
    say('');
    document.documentElement.dataset.state = 'drawn';
  } catch (error) {
    document.documentElement.dataset.state = 'failed';
    if (error instanceof DamagedError)
      return say(`This page is damaged: ${error.message}. Get it again from where it came from.`);
    say(error.message === NO_WEBGL ? NO_WEBGL : `This page cannot be shown: ${error.message}`);
    if (error.message !== NO_WEBGL) throw error;
  }
}

if (document.readyState === 'loading') addEventListener('DOMContentLoaded', main);
else main();
