// The time of what plays: a button, a slider and a speed.
import { lengthOf, playersOf } from './figures.js';

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const LONGEST_STEP = 1; // second that a slow frame may add

export class Timeline {
  // `view` has: scene, moved().
  constructor(view) {
    this.view = view;
    this.players = playersOf(view.scene);
    this.start = this.time = view.scene.clock.time;
    this.speed = 1;
    this.playing = false;
    this.measure();
  }

  measure() {
    this.length = lengthOf(this.players);
    this.sync();
  }

  // Shows the controls in an element.
  show(parent) {
    const element = (name, properties) => Object.assign(document.createElement(name), properties);
    this.bar = element('div', { className: 'timeline' });
    this.bar.setAttribute('role', 'group');
    this.bar.setAttribute('aria-label', 'Animation');
    this.button = element('button', { type: 'button' });
    this.button.onclick = () => this.toggle();
    this.slider = element('input', { type: 'range', step: 'any' });
    this.slider.setAttribute('aria-label', 'Time');
    this.slider.oninput = () => this.set(Number(this.slider.value));
    this.label = element('span', { className: 'time' });
    this.speeds = element('select', {});
    this.speeds.setAttribute('aria-label', 'Speed');
    this.speeds.append(...SPEEDS.map((speed) => new Option(`${speed}×`, speed)));
    this.speeds.value = '1';
    this.speeds.onchange = () => (this.speed = Number(this.speeds.value));
    this.bar.append(this.button, this.slider, this.label, this.speeds);
    this.bar.onkeydown = (event) => {
      if (event.key !== ' ' || event.target !== this.slider) return;
      event.preventDefault();
      this.toggle();
    };
    parent.append(this.bar);
    this.sync();
  }

  sync() {
    if (!this.bar) return;
    const { slider, start, length, time } = this;
    [slider.min, slider.max, slider.value] = [start, start + length, time];
    const text = `${time.toFixed(2)} s`;
    slider.setAttribute('aria-valuetext', text);
    this.label.textContent = text;
    this.button.textContent = this.playing ? 'Pause' : 'Play';
  }

  set(time) {
    this.time = time;
    this.sync();
    this.view.moved();
  }

  toggle() {
    this.playing = !this.playing;
    this.last = performance.now();
    this.sync();
    this.view.moved();
  }

  // Goes on to the time of a frame, and from the end to the start.
  tick() {
    if (!this.playing) return;
    const now = performance.now();
    this.time += this.speed * Math.min((now - this.last) / 1000, LONGEST_STEP);
    this.last = now;
    while (this.time > this.start + this.length) this.time -= this.length;
    this.sync();
  }

  // Plays a clip by all members of a player.
  choose(player, clip) {
    player.clip.fill(clip);
    this.measure();
    this.view.moved();
  }
}
