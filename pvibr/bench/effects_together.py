"""Image effects together: what they cost beside the sum of each alone, by stage, and in Python."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.bench.rows import Row
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


def scene(size) -> tuple[Any, dict[str, Effect]]:
    """Return a plotter with every image effect, all of them off."""
    pl: Any = pv.Plotter(off_screen=True, window_size=size)
    pl.disable_anti_aliasing()
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
    pl.show(auto_close=False)
    return pl, found


def choose(effects, names):
    """Put some effects on and the others off."""
    for name, effect in effects.items():
        effect.enabled = name in names


def together(size=(1280, 720), rounds=9) -> list[Row]:
    """Return what effects add to a frame: the sum of each alone, and all."""
    pl, effects = scene(size)
    sets = {'none': (), **{name: (name,) for name in effects}, 'all': tuple(effects)}
    best = dict.fromkeys(sets, np.inf)
    for _ in range(rounds):
        for name, chosen in sets.items():
            choose(effects, chosen)
            pl.render_window.Render()  # what was put on is prepared
            best[name] = min(best[name], _seconds(pl.render_window))
    pl.close()
    total = sum(best[name] - best['none'] for name in effects)
    every = best['all'] - best['none']
    rows = [Row(f'alone: {n}', 1e3 * (best[n] - best['none']), 'ms') for n in effects]
    rows.append(Row('all effects together', 1e3 * every, 'ms'))
    return [*rows, Row('all effects together over the sum of each', every / total, 'x', 0.8)]


def stages(size=(1280, 720), rounds=5) -> dict[str, float]:
    """Return what the programs of all effects cost in one frame of all of them."""
    pl, effects = scene(size)
    choose(effects, effects)
    pl.render_window.Render()
    best: dict[str, float] = {}
    for _ in range(rounds):
        with _timed() as spans:
            pl.render_window.Render()
        for name, seconds in spans.items():
            best[name] = min(best.get(name, np.inf), 1e3 * seconds)
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
        changes: list[tuple[Any, str, Any]] = [
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


def python(rounds=100, size=(32, 18)) -> list[Row]:
    """Return the time of the main thread that five effects take of a frame, less GL's share."""
    clock, found = _Clock(), []
    with _replaced(*clock.of_python()):
        pl, effects = scene(size)
        choose(effects, FIVE)
        pl.render_window.Render()
        for _ in range(rounds):
            clock.spent = 0.0
            pl.render_window.Render()
            found.append(clock.spent)
        pl.close()
    return [Row('Python in a frame, five effects', 1e3 * float(np.median(found)), 'ms', 1.0)]


def _seconds(window) -> float:
    start = time.perf_counter()
    window.Render()
    window.WaitForCompletion()
    return time.perf_counter() - start
