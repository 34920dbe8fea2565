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
#: What the focus is on, in shadow trees too.
FOCUSED = """() => {
  let found = document.activeElement;
  while (found && found.shadowRoot && found.shadowRoot.activeElement)
    found = found.shadowRoot.activeElement;
  return found;
}"""


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
    """Return what is wrong with the controls of a page: no name, or sliders without a value."""
    found = []
    for node in tree(page):
        if node['role'] in CONTROLS:
            if not node['name'].strip() or node['name'] == '↺':
                found.append(f'nameless {node}')
            if node['role'] == 'slider' and node['value'] == '':
                found.append(f'no value {node}')
    return found


def reached(page, most=400) -> list[str]:
    """Return the names of what Tab reaches, in order, until it is where it began."""
    names: list[str] = []
    first = None
    for _ in range(most):
        page.keyboard.press('Tab')
        focused = page.evaluate_handle(FOCUSED)
        name = focused.evaluate(
            'e => [e.tagName, e.type || "", e.ariaLabel || e.labels?.[0]?.innerText'
            ' || e.innerText || "", e.id].join(" ")'
        )
        if name == first:
            break
        first = first or name
        names.append(name)
    return names
