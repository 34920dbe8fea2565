"""The text of a page within a size, and a page in a notebook's frame."""

from __future__ import annotations

import html

from pvibr.core.arguments import checked_number
from pvibr.core.errors import warn
from pvibr.web.container import Container, Image, written

#: Halvings of tiles, and qualities of colours as WebP, tried in turn until a page is small enough.
_STEPS = ((0, 90), (1, 90), (2, 90), (2, 75), (2, 50), (2, 30))
_MEGABYTE = 1_000_000


def page_text(scene, title, megabytes=None) -> str:
    """Return the text of a page of at most some megabytes.

    Raises ValueError if even the smallest tiles are too large.
    """
    if megabytes is not None:
        checked_number('megabytes', megabytes, 0.01, 10_000)
    for halvings, quality in _STEPS:
        text = written(_with_tiles(scene, halvings), Container(quality=quality), title)
        if megabytes is None or len(text) <= megabytes * _MEGABYTE:
            if (halvings, quality) != _STEPS[0]:
                warn(
                    f'megabytes={megabytes:g}: tiles of images have 1/{2**halvings} of their side'
                    f'{f", colours quality {quality} of 100" if quality < _STEPS[0][1] else ""}'
                )
            return text
    raise ValueError(
        f'megabytes must be at least {len(text) / _MEGABYTE:.3g} for this scene, got '
        f'{megabytes:g}: use lighter meshes, or fewer instances'
    )


def _with_tiles(value, halvings):
    """Return a scene whose sets of instances have smaller tiles."""
    if not halvings:
        return value
    subplots = []
    for subplot in value['subplots']:
        things = [_smaller(thing, halvings) for thing in subplot['things']]
        subplots.append({**subplot, 'things': things})
    return {**value, 'subplots': subplots}


def _smaller(thing, halvings):
    if 'tile' not in thing:
        return thing
    thing = {**thing, 'tile': thing['tile'] >> halvings}
    thing['uniforms'] = {**thing['uniforms'], 'ibr_tile': thing['tile']}
    for name in ('geometry', 'albedo'):
        pixels = thing[name].pixels
        for _ in range(halvings):
            height, width = (side // 2 for side in pixels.shape[:2])
            blocks = pixels.reshape(height, 2, width, 2, -1).astype('u2')
            pixels = ((blocks.sum((1, 3)) + 2) >> 2).astype('u1')
        thing[name] = Image(pixels, thing[name].lossless)
    return thing


class WebPage:
    """A page that a notebook shows in a frame."""

    def __init__(self, text, height):
        self.text, self.height = text, height

    def _repr_html_(self) -> str:
        # Only scripts are allowed: the page asks no host, and sees nothing of the notebook.
        return (
            f'<iframe sandbox="allow-scripts" title="3D scene" srcdoc="{html.escape(self.text)}" '
            f'style="width: 100%; height: {self.height}px; border: 0"></iframe>'
        )
