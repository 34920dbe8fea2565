// The settings that a viewer changes: scalars, colors and range of each thing.

function element(name, properties = {}, ...children) {
  const node = document.createElement(name);
  Object.assign(node, properties);
  node.append(...children);
  return node;
}

const labelled = (text, control) =>
  element('label', {}, element('span', { textContent: text }), control);

export class Panel {
  // `view` has: scene, recolor(thing, name, range, cmap), rangeOf(thing, name), reset().
  constructor(view, parent) {
    this.view = view;
    const colored = new Map(); // sets of several meshes are several things of one name
    view.scene.subplots.forEach(({ things }, subplot) => {
      for (const thing of things)
        if (thing.scalars) colored.set(`${subplot} ${thing.name}`, thing);
    });
    const rows = [...colored.values()].map((thing) =>
      this.colors(thing, Object.keys(thing.scalars)),
    );
    rows.push(...(view.timeline?.players ?? []).map((player) => this.clips(player)));
    const help = element('p', {
      className: 'help',
      textContent:
        'Drag turns, wheel or right drag zooms, Shift and drag moves, Ctrl and drag rolls; ' +
        'a click says what it hits. Keys: arrows, + and -, r resets, v isometric view.' +
        (view.timeline ? ' Space plays and pauses.' : ''),
    });
    const reset = element('button', { type: 'button', textContent: 'Reset view' });
    reset.onclick = () => view.reset();
    this.details = element(
      'details',
      { className: 'panel' },
      element('summary', { textContent: 'Settings' }),
      ...rows,
      reset,
      help,
    );
    parent.append(this.details);
  }

  clips(player) {
    const names = player.clips.map(({ name }, i) => new Option(name || `clip ${i + 1}`, i));
    const clip = element('select', {}, ...names);
    clip.value = player.clip.every((k) => k === player.clip[0]) ? player.clip[0] : '';
    clip.onchange = () => this.view.timeline.choose(player, Number(clip.value));
    const legend = element('legend', { textContent: player.name || 'Figure' });
    return element('fieldset', {}, legend, labelled('Clip', clip));
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
    const show = ([a, b]) =>
      ([low.value, high.value] = [a, b].map((x) => Number(x.toPrecision(6))));
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
    const fields = [
      ['Scalars', scalars],
      ['Colors', cmap],
      ['From', low],
      ['To', high],
    ];
    return element(
      'fieldset',
      {},
      element('legend', { textContent: thing.name || thing.kind }),
      ...fields.map(([text, control]) => labelled(text, control)),
    );
  }
}
