"""Image effects together: what they cost beside the sum of each alone, by stage, and in Python."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.bench.common.timing import least, plotter, seconds
from pvibr.core.effect import Effect
from pvibr.effects.backgrounds import Sky
from pvibr.effects.bloom import Bloom
from pvibr.effects.depth_of_field import DepthOfField
from pvibr.effects.glow import Afterglow, Glow
from pvibr.effects.outline import Outline
from pvibr.effects.screen import Flash, ImageOverlay, Iris, NightVision, Vignette
from pvibr.effects.tone_mapping import ToneMapping
from pvibr.gl import Quad, Target, Texture
from pvibr.gl.drawer import Drawer
from pvibr.gl.picture import Picture
from pvibr.pipeline import Pipeline

FIVE = ('Glow', 'Bloom', 'ToneMapping', 'Outline', 'Vignette')


def scene(size):
    """Return a plotter with every image effect, all of them off."""
    pl = plotter(size)
    torus = pv.ParametricTorus(ringradius=0.5, crosssectionradius=0.2)
    ring = pl.add_mesh(torus, color='white', smooth_shading=True, specular=1.0)
    cube = pl.add_mesh(pv.Cube(center=(1, 0, 0)), color='red')
    pl.camera_position = [(1.4, -2.2, 1.5), (0, 0, 0), (0, 0, 1)]
    image = np.random.default_rng(0).integers(0, 256, (200, 300, 4), np.uint8)
    effects = (
        Sky(),
        DepthOfField((0, 0, 0)),
        Glow(ring),
        Afterglow(cube),
        Bloom(threshold=0.5),
        ToneMapping(),
        Outline(),
        ImageOverlay(image, opacity=0.5),
        NightVision(intensity=0.5),
        Vignette(),
        Flash(at=0),
        Iris(),
    )
    found: dict[str, Effect] = {}
    for effect in effects:
        found[effect.name] = pl.ibr.add(effect)
        effect.enabled = False
    return pl, found


def choose(effects, names):
    """Put some effects on and the others off."""
    for name, effect in effects.items():
        effect.enabled = name in names


def measure(settings, results):
    """Yield what effects add to a frame: each alone, all, their Python, and their stages."""
    yield from _together(settings.screen, settings.rounds)
    yield _python()
    for name, ms in _stages(settings.screen, settings.rounds).items():
        yield Row(f'stage of all together: {name}', ms, 'ms')


def _together(size, rounds):
    """Yield what effects add to a frame: the sum of each alone, and all."""
    pl, effects = scene(size)
    pl.show(auto_close=False)
    sets = {'none': (), **{name: (name,) for name in effects}, 'all': tuple(effects)}

    def shown(chosen):
        choose(effects, chosen)
        pl.render_window.Render()  # what was put on is prepared
        return seconds(pl.render_window)

    best = least(rounds, {name: partial(shown, chosen) for name, chosen in sets.items()})
    pl.close()
    ms = {name: 1e3 * (found - best['none']) for name, found in best.items()}
    for name in effects:
        yield Row(f'alone: {name}', ms[name], 'ms')
    yield Row('all effects together', ms['all'], 'ms')
    over = ms['all'] / sum(ms[name] for name in effects)
    yield Row('all effects together over the sum of each', over, 'x', 0.8)


def _stages(size, rounds) -> dict[str, float]:
    """Return the ms that the programs of all effects cost in one frame of all of them."""
    pl, effects = scene(size)
    pl.show(auto_close=False)
    choose(effects, effects)
    pl.render_window.Render()
    best: dict[str, float] = {}
    for _ in range(rounds):
        with _timed() as spans:
            pl.render_window.Render()
        for name, spent in spans.items():
            best[name] = min(best.get(name, np.inf), 1e3 * spent)
    pl.close()
    return best


@contextmanager
def _timed() -> Iterator[dict[str, float]]:
    """Time every full-screen program, each waited for."""
    spans: dict[str, float] = {}
    draw = Quad.draw_alone

    def timed(quad, *args, **options):
        quad.window.WaitForCompletion()
        start = time.perf_counter()
        draw(quad, *args, **options)
        quad.window.WaitForCompletion()
        spans[quad.name] = spans.get(quad.name, 0.0) + time.perf_counter() - start

    with _replaced((Quad, 'draw_alone', timed)):
        yield spans


@contextmanager
def _replaced(*changes):
    """Have other methods for a while: tuples of class, name and function."""
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
    for owner, name, function in changes:
        setattr(owner, name, function)
    try:
        yield
    finally:
        for owner, name, function in before:
            setattr(owner, name, function)


class _Clock:
    """The main thread's time within some functions, less that within others that they call."""

    def __init__(self):
        self.spent = 0.0

    def _counted(self, function, sign):
        def counted(*args, **options):
            start = time.thread_time()
            try:
                return function(*args, **options)
            finally:
                self.spent += sign * (time.thread_time() - start)

        return counted

    def of_python(self):
        """Return replacements that count what Python takes, and leave out what GL does."""
        # Where Python hands over to GL, and those of the pipeline that VTK calls.
        gl = (Picture, '_blit'), (Texture, 'download'), (Drawer, 'draw'), (Target, '_clear')
        changes: list[tuple] = [
            (owner, name, self._counted(getattr(owner, name), -1)) for owner, name in gl
        ]
        for name in ('_on_start', '_on_end'):
            changes.append((Pipeline, name, self._counted(getattr(Pipeline, name), 1)))
        start = Quad.__init__

        def started(quad, *args, **options):
            start(quad, *args, **options)
            render, release = quad.helper.Render, quad.helper.ReleaseGraphicsResources
            quad.helper = SimpleNamespace(
                Render=self._counted(render, -1), ReleaseGraphicsResources=release
            )

        return [*changes, (Quad, '__init__', started)]


def _python(rounds=100, size=(32, 18)) -> Row:
    """Return the time of the main thread that five effects take of a frame, less GL's share."""
    clock, found = _Clock(), []
    with _replaced(*clock.of_python()):
        pl, effects = scene(size)
        pl.show(auto_close=False)
        choose(effects, FIVE)
        pl.render_window.Render()
        for _ in range(rounds):
            clock.spent = 0.0
            pl.render_window.Render()
            found.append(clock.spent)
        pl.close()
    return Row('Python in a frame, five effects', 1e3 * np.median(found), 'ms', 1.0)
