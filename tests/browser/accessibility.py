"""What screen readers are told of a page, by Chromium's own tree of it."""

from __future__ import annotations

CONTROLS = {
    'button',
    'checkbox',
    'ColorWell',
    'combobox',
    'DisclosureTriangle',
    'slider',
    'textbox',
}
#: What says the state of those that have one.
VALUES = {
    'checkbox': 'checked',
    'ColorWell': 'value',
    'combobox': 'value',
    'DisclosureTriangle': 'expanded',
    'slider': 'value',
}
#: The names of the controls of a part that are seen, and of what the focus is on in it.
CONTROL_NAMES = """part => {
  const named = e => [e.localName, e.ariaLabel || e.labels?.[0]?.innerText || e.innerText];
  const root = document.querySelector(part).shadowRoot;
  const all = [...root.querySelectorAll('input, button, select, summary, textarea')];
  const focused = document.activeElement.matches(part) ? root.activeElement : null;
  const name = e => named(e).join(' ').trim();
  return [all.filter(e => e.checkVisibility()).map(name), focused && name(focused)];
}"""
FOCUS_FIRST = """part => document.querySelector(part).shadowRoot
  .querySelector('input, button, select, summary, textarea').focus()"""


def tree(page, part='pvibr-panel') -> list[dict]:
    """Return the nodes of a part of a page: role, name and properties."""
    session = page.context.new_cdp_session(page)
    session.send('Accessibility.enable')
    asked = {'expression': f'document.querySelector({part!r})'}
    found = session.send('Runtime.evaluate', asked)['result']['objectId']
    nodes = session.send('Accessibility.queryAXTree', {'objectId': found})['nodes']
    session.detach()
    return [_told(node) for node in nodes if not node['ignored']]


def _told(node):
    told = {p['name']: p['value'].get('value') for p in node.get('properties', ())}
    for key in ('role', 'name', 'value', 'description'):
        told[key] = node.get(key, {}).get('value', '')
    return told


def problems(page) -> list[str]:
    """Return what is wrong with the controls of a page: no name, or no value where one is due."""
    found = []
    for node in tree(page):
        if node['role'] in CONTROLS:
            if not node['name'].strip() or node['name'] == '↺':
                found.append(f'nameless {node}')
            if node['role'] in VALUES and node.get(VALUES[node['role']]) in ('', None):
                found.append(f'no value {node}')
    return found


def not_reached(page, part='pvibr-panel') -> list[str]:
    """Return where the focus is not where it should be as Tab goes through a part and back out.

    From its first control Shift and Tab leave it; Tab reaches each control once, in the order in
    which they are there, and leaves it; Shift and Tab come back to the last one.
    """
    page.evaluate(FOCUS_FIRST, part)
    controls, first = page.evaluate(CONTROL_NAMES, part)
    assert first == controls[0]
    found = []
    keys = ['Shift+Tab', *['Tab'] * (len(controls) + 1), 'Shift+Tab']
    for key, expected in zip(keys, [None, *controls, None, controls[-1]], strict=True):
        page.keyboard.press(key)
        focused = page.evaluate(CONTROL_NAMES, part)[1]
        if focused != expected:
            found.append(f'{key}: {focused}, not {expected}')
    return found
