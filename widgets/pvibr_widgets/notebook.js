// The panel of a notebook, beside the picture if it has one: anywidget calls `render`.
export default {
  render({ model, el }) {
    const panel = document.createElement('pvibr-panel');
    const answers = new Map();
    // Each view of a widget hears all answers; those of its own have its numbers.
    const view = Math.random().toString(36).slice(2);
    let count = 0;
    const send = (args) =>
      new Promise((resolve) => {
        const id = `${view}.${(count += 1)}`;
        answers.set(id, resolve);
        model.send({ id, args });
      });
    const hear = ({ id, ...answer }) => {
      if (answers.has(id)) answers.get(id)(answer);
      answers.delete(id);
    };
    const show = () => {
      panel.data = model.get('shown');
    };
    panel.send = send;
    model.on('msg:custom', hear);
    model.on('change:shown', show);
    const both = document.createElement('div'); // notebooks style `el`
    both.style.cssText = 'display: flex; flex-wrap: wrap; gap: 8px;';
    el.append(both);
    panel.style.cssText = 'flex: 1 1 300px; overflow: auto; max-height: 40em;';
    const forget = model.get('size').length ? showPicture(model, both, send) : () => {};
    both.append(panel);
    show();
    return () => {
      forget();
      model.off('msg:custom', hear);
      model.off('change:shown', show);
    };
  },
};

// Show the picture, in the ratio of the plotter's window.
function showPicture(model, place, send) {
  const picture = document.createElement('pvibr-picture');
  const [width, height] = model.get('size');
  picture.style.cssText =
    `flex: 3 1 300px; min-width: 0; max-width: ${width}px; align-self: flex-start;` +
    `aspect-ratio: ${width} / ${height};`;
  picture.send = async ([action, x, y, button, keys]) => {
    if (action && action !== 'enter') await send(['point', action, x, y, button, keys]);
    return {}; // the picture comes by itself
  };
  place.append(picture);
  const show = () => picture.show(model.get('picture'));
  model.on('change:frame', show);
  show();
  return () => model.off('change:frame', show);
}
