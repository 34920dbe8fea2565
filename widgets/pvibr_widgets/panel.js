// The control panel of notebooks and pages: an element <pvibr-panel> of native controls, so that
// keys, fingers and screen readers know them. `data` is what RemotePanel.shown says; `send` takes
// an action and its arguments, and promises {text, turn}. A sign is shown from when something is
// asked for until `data.done` says that its picture is drawn.
(() => {
  const STYLE = `PANEL_CSS`;
  const ACTING_SLOWLY = 800; // milliseconds until screen readers are told of it

  const make = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (typeof value === 'function') made.addEventListener(key, value);
      else if (value !== undefined) made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  };
  const line = (...children) => make('div', { class: 'line' }, ...children);
  const button = (text, name, click) =>
    make('button', { type: 'button', 'aria-label': name, click }, text);
  const say = (element, text) => {
    if (element.textContent !== text) element.textContent = text;
  };
  const unlessTyping = (input, text) => {
    if (!input.isTyped) input.value = text;
  };

  // What a kind of setting has for controls: elements, and a function that updates them.
  const CONTROLS = {
    switch(row, id, ask) {
      const box = make('input', { id, type: 'checkbox', change: () => ask('set', box.checked) });
      return [
        [box],
        (now) => {
          box.checked = now.value;
        },
      ];
    },
    choice(row, id, ask) {
      const options = row.choices.map((word, i) => make('option', { value: i }, word));
      const select = make(
        'select',
        { id, class: 'wide', change: () => ask('choose', select.value) },
        ...options,
      );
      return [
        [select],
        (now) => {
          select.value = now.choice;
        },
      ];
    },
    color(row, id, ask) {
      const well = make('input', {
        id,
        type: 'color',
        class: 'wide',
        input: () => ask('paint', well.value),
      });
      return [
        [well],
        (now, isBehind) => {
          if (!isBehind) well.value = now.color;
        },
      ];
    },
    number(row, id, ask) {
      const slider = make('input', {
        id,
        type: 'range',
        min: 0,
        class: 'wide',
        input: async () => {
          tell(await ask('move', slider.value));
        },
      });
      const [[field], update] = CONTROLS.text(row, `${id}_text`, ask, `${id}_error`);
      field.className = 'number';
      const tell = (text) => {
        slider.setAttribute('aria-valuetext', text ? `${text} ${row.unit}`.trim() : 'auto');
        if (text) slider.setAttribute('aria-valuenow', text);
        else slider.removeAttribute('aria-valuenow');
        unlessTyping(field, text);
      };
      return [
        [slider, field],
        (now, isBehind) => {
          if (isBehind) return; // a slider must not jump back while it moves
          slider.max = now.last;
          slider.value = now.stop;
          slider.setAttribute('aria-valuemin', now.low);
          slider.setAttribute('aria-valuemax', now.high);
          update(now);
          tell(now.text);
        },
      ];
    },
    text(row, id, ask, error = `${id}_error`) {
      const write = async () => {
        if (!field.isTyped) return;
        field.isTyped = false;
        const text = await ask('write', field.value);
        unlessTyping(field, text);
      };
      const field = make('input', {
        id,
        type: 'text',
        class: 'wide',
        'aria-label': row.label,
        spellcheck: 'false',
        'aria-describedby': error,
        input: () => {
          field.isTyped = true;
        },
        change: write,
        // JupyterLab keeps the change that Enter would be from pages.
        keydown: (event) => {
          if (event.key === 'Enter') write();
        },
      });
      return [
        [field],
        (now) => {
          unlessTyping(field, now.text);
          field.placeholder = now.derived ? 'auto' : '';
          field.setAttribute('aria-invalid', Boolean(now.error));
        },
      ];
    },
  };
  CONTROLS.numbers = CONTROLS.text;

  const makeRow = (panel, group, row) => {
    const ask = (action, ...values) => panel.ask(action, group.id, row.name, ...values);
    const id = `${group.id}_${row.name}`;
    const [controls, update] = CONTROLS[row.kind](row, id, ask);
    const auto = make('input', {
      type: 'checkbox',
      'aria-label': `${row.label} auto`,
      change: () => ask('derive', auto.checked),
    });
    const error = make('div', { id: `${id}_error`, role: 'alert' });
    const made = make(
      'div',
      { title: row.help },
      line(
        make('label', { class: 'name', for: id }, row.label),
        ...controls,
        ...(row.optional ? [make('label', {}, auto, 'auto')] : []),
        button('↺', `Reset ${row.label}`, () => ask('reset')),
      ),
      make('div', { class: 'help' }, row.help),
      error,
    );
    return [
      made,
      (now, isBehind) => {
        update(now, isBehind);
        auto.checked = now.derived;
        say(error, now.error);
      },
    ];
  };

  const makeRows = (panel, group) => {
    const rows = group.rows.map((row) => makeRow(panel, group, row));
    return [
      rows.map(([element]) => element),
      (now, isBehind) => rows.forEach(([, update], i) => update(now.rows[i], isBehind)),
    ];
  };

  const makeGroup = (panel, group) => {
    const ask = (action, ...values) => panel.ask(action, group.id, ...values);
    const title = group.title;
    const on = make('input', {
      type: 'checkbox',
      'aria-label': `${title} on`,
      change: () => ask('switch', on.checked),
    });
    const why = make('span', { role: 'alert' });
    const presets = make('datalist', { id: `${group.id}_presets` });
    const preset = make('input', {
      type: 'text',
      class: 'wide',
      list: presets.id,
      value: 'defaults',
      'aria-label': `Preset of ${title}`,
    });
    const act = (word) =>
      button(word, `${word} preset of ${title}`, () => ask(word.toLowerCase(), preset.value));
    const [rows, update] = makeRows(panel, group);
    const made = make(
      'details',
      {},
      make('summary', {}, title),
      line(
        make('label', {}, on, 'on'),
        why,
        button('Remove', `Remove ${title}`, () => ask('remove')),
      ),
      line(preset, presets, act('Apply'), act('Keep'), act('Forget')),
      make('div', { role: 'group', 'aria-label': title }, ...rows),
    );
    made.open = group.open;
    return [
      made,
      (now, isBehind) => {
        on.checked = now.enabled;
        say(why, now.why);
        presets.replaceChildren(...now.presets.map((name) => make('option', { value: name })));
        update(now, isBehind);
      },
    ];
  };

  class PvibrPanel extends HTMLElement {
    connectedCallback() {
      if (this.root) return;
      this.waiting = this.turn = 0;
      // JupyterLab's shortcuts are not for what is typed here.
      this.setAttribute('data-lm-suppress-shortcuts', 'true');
      this.root = this.attachShadow({ mode: 'open' });
      this.build();
      const given = this.data; // set before this class was known
      delete this.data;
      Object.defineProperty(this, 'data', {
        get: () => this.shown,
        set: (data) => this.show(data),
      });
      if (given) this.show(given);
    }

    build() {
      this.groups = new Map();
      this.sign = make(
        'span',
        { class: 'sign', hidden: '' },
        make('progress', { 'aria-label': 'Drawing' }),
        ' drawing',
      );
      this.message = make('div', { role: 'status' });
      this.code = make('textarea', {
        readonly: '',
        rows: 6,
        'aria-label': 'Python',
        hidden: '',
        focus: () => this.code.select(),
      });
      const help = make('input', {
        type: 'checkbox',
        change: () => this.body.classList.toggle('helps', help.checked),
      });
      const file = make('input', {
        type: 'file',
        accept: '.json,application/json',
        change: () => this.load(file),
      });
      this.own = make('div', { role: 'group', 'aria-label': 'Plotter' });
      this.list = make('div');
      this.body = make(
        'div',
        { class: 'panel', role: 'region', 'aria-label': 'pvibr' },
        line(
          button('Copy as Python', undefined, () => this.copy()),
          button('Reset all', undefined, () => this.ask('reset_all')),
          make('label', {}, help, 'Help'),
          this.sign,
        ),
        line(
          button('Save', 'Save all settings', () => this.save()),
          make('label', { class: 'wide' }, 'Load', file),
        ),
        this.code,
        this.message,
        this.own,
        this.list,
      );
      this.root.append(make('style', {}, STYLE), this.body);
    }

    async ask(...asked) {
      this.waiting += 1;
      this.settle();
      try {
        const { text, turn } = await this.send(asked);
        this.turn = Math.max(this.turn, turn);
        return text;
      } finally {
        this.waiting -= 1;
        this.settle();
      }
    }

    get isBehind() {
      return this.waiting > 0 || this.turn > (this.shown ? this.shown.done : 0);
    }

    // Show the sign at once, tell of it what takes long, and take both away.
    settle() {
      this.sign.hidden = !this.isBehind;
      this.body.setAttribute('aria-busy', this.isBehind);
      if (!this.isBehind) {
        clearTimeout(this.slow);
        this.slow = undefined;
        say(this.message, this.shown.message);
      } else if (!this.slow) {
        this.slow = setTimeout(() => say(this.message, 'drawing …'), ACTING_SLOWLY);
      }
    }

    show(data) {
      this.shown = data;
      if (!data) return;
      this.settle();
      if (this.isBehind && data.message) say(this.message, data.message);
      this.arrange([data.own], this.own, makeRows);
      this.arrange(data.groups, this.list, makeGroup);
    }

    // Keep the groups that are still there, with their focus and what is unfolded.
    arrange(groups, place, maker) {
      const elements = groups.flatMap((group) => {
        const key = JSON.stringify([
          group.id,
          group.title,
          group.rows.map((row) => [row.kind, row.choices]),
        ]);
        const found = this.groups.get(group.id);
        const made = found && found.key === key ? found : { key, view: maker(this, group) };
        this.groups.set(group.id, made);
        made.view[1](group, this.isBehind);
        return made.view[0];
      });
      if (
        elements.length !== place.children.length ||
        elements.some((e, i) => e !== place.children[i])
      ) {
        place.replaceChildren(...elements);
      }
    }

    async copy() {
      this.code.value = await this.ask('code');
      this.code.hidden = false;
      this.code.focus();
    }

    async save() {
      const text = await this.ask('save');
      if (!text) return;
      const url = URL.createObjectURL(new Blob([text], { type: 'application/json' }));
      make('a', { href: url, download: 'pvibr.json' }).click();
      URL.revokeObjectURL(url);
    }

    async load(file) {
      const text = await file.files[0].text();
      file.value = '';
      await this.ask('load', text);
    }
  }

  if (!customElements.get('pvibr-panel')) customElements.define('pvibr-panel', PvibrPanel);
})();
