"""The text of a page within a size, and a page in a notebook's frame."""

from __future__ import annotations

import html

import numpy as np

from pvibr.core.arguments import checked_number
from pvibr.core.errors import warn
from pvibr.web.container import Container, Frames, Image, halved, written

#: Every so-many-th frame of clips, whether only the clips shown are kept, halvings of tiles, and
#: qualities of colours as WebP, tried in turn until a page is small enough.
_STEPS = (
    *((1, False, 0, 90), (2, False, 0, 90), (4, False, 0, 90), (4, True, 0, 90)),
    *((4, True, 1, 90), (4, True, 2, 90), (4, True, 2, 75), (4, True, 2, 50), (4, True, 2, 30)),
)
_MEGABYTE = 1_000_000


def page_text(scene, title, megabytes=None) -> str:
    """Return the text of a page of at most some megabytes.

    Raises ValueError if even the smallest tiles are too large.
    """
    if megabytes is not None:
        checked_number('megabytes', megabytes, 0.01, 10_000)
    players = list(_players(scene))
    plays, clips = bool(players), max((len(player['clips']) for player in players), default=0)
    for step in _STEPS if plays else (_STEPS[0], *_STEPS[4:]):
        every, only_shown, halvings, quality = step
        smaller = _with_frames(scene, every, only_shown) if plays else scene
        text = written(_with_tiles(smaller, halvings), Container(quality=quality), title)
        if megabytes is None or len(text) <= megabytes * _MEGABYTE:
            if step != _STEPS[0]:
                warn(f'megabytes={megabytes:g}: {"; ".join(_said(clips, *step))}')
            return text
    raise ValueError(
        f'megabytes must be at least {len(text) / _MEGABYTE:.3g} for this scene, got '
        f'{megabytes:g}: use lighter meshes, or fewer instances'
    )


def _said(clips, every, only_shown, halvings, quality) -> list[str]:
    """Return what a page has less of, if what plays has so many clips."""
    said = [f'clips have one of {every} frames'] if clips else []
    said += ['only the clips that are shown are in it'] if clips > 1 and only_shown else []
    said += [f'tiles of images have 1/{2**halvings} of their side'] if halvings else []
    return said + ([f'colours have quality {quality} of 100'] if quality < _STEPS[0][-1] else [])


def _players(scene):
    """Yield what plays in a scene: figures, and crowds of things."""
    for subplot in scene['subplots']:
        yield from subplot.get('figures', ())
        yield from (thing['plays'] for thing in subplot['things'] if 'plays' in thing)


def _with_frames(scene, every, only_shown):
    """Return a scene whose clips have fewer frames, and whose figures may have one clip only."""
    subplots = []
    for subplot in scene['subplots']:
        things = [
            t | {'plays': _fewer(t['plays'], every)} if 'plays' in t else t
            for t in subplot['things']
        ]
        figures = [_fewer(figure, every, only_shown) for figure in subplot.get('figures', ())]
        subplots.append({**subplot, 'things': things, 'figures': figures})
    return {**scene, 'subplots': subplots}


def _fewer(player, every, only_shown=False) -> dict:
    """Return what plays, of every so-many-th frame."""
    clips = [_thinned(clip, every) for clip in player['clips']]
    if not only_shown:
        return {**player, 'clips': clips}
    return {**player, 'clips': [clips[player['clip'][0]]], 'clip': np.zeros(1, np.uint16)}


def _thinned(clip, every) -> dict:
    """Return a clip of every so-many-th frame, the last one included."""
    frames = {name: clip[name].values for name in ('axes', 'places')}
    step = every if (frames['places'].shape[1] - 1) % every == 0 else 1
    frames = {name: Frames(values[:, ::step]) for name, values in frames.items()}
    return clip | frames | {'weights': clip['weights'][::step]}


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
        thing[name] = [_halved(image, halvings) for image in thing[name]]
    return thing


def _halved(image, times) -> Image:
    pixels = image.pixels
    for _ in range(times):
        pixels = halved(pixels)
    return Image(pixels, image.lossless)


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
