// The settings that a viewer changes: scalars, colors and range of each set, clips, and time.

function element(name, properties = {}, ...children) {
  const node = document.createElement(name);
  Object.assign(node, properties);
  node.append(...children);
  return node;
}

const labelled = (text, control) => element('label', {}, element('span', { textContent: text }), control);

export class Panel {
  // `view` has: scene, recolor(thing, name, range, cmap), play(thing, clip), reset(), time, playing.
  constructor(view, parent) {
    this.view = view;
    const rows = view.scene.subplots.flatMap(({ things }) => things ?? []).flatMap((thing) => this.rows(thing));
    const help = element('p', {
      className: 'help',
      textContent:
        'Drag turns, wheel or right drag zooms, Shift and drag moves, Ctrl and drag rolls; a click ' +
        'says what it hits. Keys: arrows, + and -, r resets, v isometric view, w wireframe, s surface.',
    });
    const reset = element('button', { type: 'button', textContent: 'Reset view' });
    reset.onclick = () => view.reset();
    this.details = element('details', { className: 'panel' },
      element('summary', { textContent: 'Settings' }), ...rows, reset, help);
    parent.append(this.details);
    if (view.duration) this.timeline(parent);
  }

  rows(thing) {
    const rows = [];
    const names = Object.keys(thing.scalars ?? {});
    if (names.length) rows.push(this.colors(thing, names));
    if (thing.clips?.length > 1) {
      const select = element('select', {}, ...thing.clips.map((clip) => new Option(clip.name)));
      select.value = thing.clip ?? thing.clips[0].name;
      select.onchange = () => this.view.play(thing, select.value);
      rows.push(element('fieldset', {}, element('legend', { textContent: thing.name }),
        labelled('Clip', select)));
    }
    return rows;
  }

  colors(thing, names) {
    const { scene } = this.view;
    const scalars = element('select', {}, ...names.map((name) => new Option(name)));
    scalars.value = thing.coloring?.name ?? names[0];
    const own = thing.coloring?.cmap ?? 'as drawn';
    const maps = [...new Set([own, ...Object.keys(scene.colormaps ?? {})])];
    const cmap = element('select', {}, ...maps.map((name) => new Option(name)));
    cmap.value = own;
    const number = () => element('input', { type: 'number', step: 'any' });
    const [low, high] = [number(), number()];
    const show = ([a, b]) => ([low.value, high.value] = [a, b].map((x) => Number(x.toPrecision(6))));
    show(thing.coloring?.range ?? this.view.rangeOf(thing, scalars.value));
    const apply = () => {
      const range = [Number(low.value), Number(high.value)];
      const right = low.value !== '' && high.value !== '' && range[0] < range[1];
      high.setCustomValidity(right ? '' : 'The range must rise.');
      if (high.reportValidity()) this.view.recolor(thing, scalars.value, range, cmap.value);
    };
    scalars.onchange = () => {
      show(this.view.rangeOf(thing, scalars.value));
      apply();
    };
    cmap.onchange = low.onchange = high.onchange = apply;
    const fields = [['Scalars', scalars], ['Colors', cmap], ['From', low], ['To', high]];
    return element('fieldset', {}, element('legend', { textContent: thing.name || thing.kind }),
      ...fields.map(([text, control]) => labelled(text, control)));
  }

  timeline(parent) {
    const { view } = this;
    this.button = element('button', { type: 'button', className: 'play' });
    this.button.onclick = () => view.toggle();
    this.slider = element('input', { type: 'range', min: 0, max: view.duration, step: 'any' });
    this.slider.setAttribute('aria-label', 'Time in seconds');
    this.slider.oninput = () => view.seek(Number(this.slider.value));
    this.seconds = element('output', {});
    parent.append(element('div', { className: 'timeline' }, this.button, this.slider, this.seconds));
    this.update();
  }

  update() {
    if (!this.button) return;
    const { time, playing } = this.view;
    this.button.textContent = playing ? '⏸' : '▶';
    this.button.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    this.slider.value = time;
    this.slider.setAttribute('aria-valuetext', `${time.toFixed(2)} s`);
    this.seconds.textContent = `${time.toFixed(2)} s`;
  }
}
