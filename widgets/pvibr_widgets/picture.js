// The picture of a plotter: an element <pvibr-picture>. `send` takes what is done (an action, place,
// button, keys held, the element's size, and `has`), and promises {has, picture}; `frame` changes
// when there is another picture to ask for. One question at a time: moves wait for the last picture.
(() => {
  class PvibrPicture extends HTMLElement {
    constructor() {
      super();
      this.waiting = [];
      this.has = null;
      this.image = document.createElement('img');
      Object.assign(this.image, {
        alt: 'Scene: arrow keys turn it, + and - zoom',
        tabIndex: 0,
        draggable: false,
        hidden: true, // until there is a picture
      });
      this.image.setAttribute('role', 'application');
      this.image.setAttribute('aria-label', this.image.alt);
      this.image.setAttribute('data-lm-suppress-shortcuts', 'true'); // of JupyterLab
      this.image.style.cssText =
        'width: 100%; height: 100%; object-fit: contain; touch-action: none; user-select: none;';
      this.listen();
      this.resized = new ResizeObserver(() => this.ask(''));
    }

    connectedCallback() {
      delete this.frame; // set before this class was known
      Object.defineProperty(this, 'frame', { configurable: true, set: () => this.ask('') });
      this.append(this.image);
      this.resized.observe(this);
    }

    disconnectedCallback() {
      this.resized.disconnect();
    }

    listen() {
      const { image } = this;
      const keys = {
        ArrowLeft: 'left',
        ArrowRight: 'right',
        ArrowUp: 'up',
        ArrowDown: 'down',
        '+': 'in',
        '-': 'out',
      };
      const move = (event) => this.ask('move', event);
      image.onpointerdown = (event) => {
        image.setPointerCapture(event.pointerId);
        image.onpointermove = move;
        this.ask('press', event);
      };
      image.onpointerup = image.onpointercancel = (event) => {
        image.onpointermove = null;
        this.ask('release', event);
      };
      image.oncontextmenu = (event) => event.preventDefault();
      image.onwheel = (event) => {
        event.preventDefault();
        this.ask(event.deltaY < 0 ? 'in' : 'out', event);
      };
      image.onkeydown = (event) => {
        if (!(event.key in keys)) return;
        event.preventDefault();
        this.ask(keys[event.key]);
      };
      image.onpointerenter = image.onfocus = () => this.ask('enter');
    }

    async ask(action, event) {
      const box = this.getBoundingClientRect();
      const size = [box.width, box.height].map((n) => Math.round(n * devicePixelRatio));
      if (!this.send || !Math.min(...size)) return;
      const at = event
        ? [(event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height]
        : [0.5, 0.5];
      const held = (event?.shiftKey ? 's' : '') + (event?.ctrlKey ? 'c' : '');
      if (['move', ''].includes(action) && this.waiting.at(-1)?.[0] === action) this.waiting.pop();
      this.waiting.push([action, ...at, Math.max(event?.button ?? 0, 0), held, ...size]);
      if (this.isAsking) return;
      this.isAsking = true;
      try {
        while (this.waiting.length) {
          const { has, picture } = await this.send([...this.waiting.shift(), this.has]);
          if (picture) this.show(picture);
          this.has = has;
        }
      } finally {
        this.isAsking = false;
      }
    }

    show(bytes) {
      const url = URL.createObjectURL(new Blob([bytes], { type: 'image/jpeg' }));
      this.image.onload = this.image.onerror = () => {
        this.image.hidden = false;
        URL.revokeObjectURL(url);
      };
      this.image.src = url;
    }
  }

  if (!customElements.get('pvibr-picture')) customElements.define('pvibr-picture', PvibrPicture);
})();
