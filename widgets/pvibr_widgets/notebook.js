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

// Show the picture; mouse, wheel and arrow keys turn the view, one move per frame.
function showPicture(model, place, send) {
  const image = document.createElement('img');
  Object.assign(image, {
    alt: 'Scene: arrow keys turn it, + and - zoom',
    tabIndex: 0,
    draggable: false,
  });
  image.setAttribute('role', 'application');
  image.setAttribute('aria-label', image.alt);
  image.setAttribute('data-lm-suppress-shortcuts', 'true');
  const [width, height] = model.get('size');
  image.style.cssText =
    `flex: 3 1 300px; min-width: 0; max-width: ${width}px; touch-action: none;` +
    `aspect-ratio: ${width} / ${height}; align-self: flex-start; user-select: none;`;
  place.append(image);
  let [url, moving, next] = ['', false, null];
  const show = () => {
    URL.revokeObjectURL(url);
    url = URL.createObjectURL(new Blob([model.get('picture')]));
    image.src = url;
  };
  const placeOf = (event) => {
    const box = image.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height];
  };
  const move = async (event) => {
    next = placeOf(event);
    if (moving) return;
    moving = true;
    while (next) {
      const at = next;
      next = null;
      await send(['point', 'move', ...at]);
    }
    moving = false;
  };
  image.onpointerdown = (event) => {
    image.setPointerCapture(event.pointerId);
    image.onpointermove = move;
    send(['point', 'press', ...placeOf(event)]);
  };
  image.onpointerup = image.onpointercancel = (event) => {
    image.onpointermove = null;
    next = null;
    send(['point', 'release', ...placeOf(event)]);
  };
  image.onwheel = (event) => {
    event.preventDefault();
    send(['point', event.deltaY < 0 ? 'in' : 'out', ...placeOf(event)]);
  };
  const keys = {
    ArrowLeft: 'left',
    ArrowRight: 'right',
    ArrowUp: 'up',
    ArrowDown: 'down',
    '+': 'in',
    '-': 'out',
  };
  image.onkeydown = (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    send(['point', keys[event.key], 0.5, 0.5]);
  };
  model.on('change:frame', show);
  show();
  return () => {
    model.off('change:frame', show);
    URL.revokeObjectURL(url);
  };
}
