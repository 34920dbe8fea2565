"""Image effects together: what they cost beside the sum of each alone, by stage, and in Python."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import least
from pvibr.api.pipeline import Pipeline
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
from pvibr.scenes.stage import Stage

VIEW = [(1.4, -2.2, 1.5), (0, 0, 0), (0, 0, 1)]
FIVE = ('Glow', 'Bloom', 'ToneMapping', 'Outline', 'Vignette')


def fill(pl) -> dict[str, Effect]:
    """Show two meshes with every image effect, all of them off; return the effects."""
    torus = pv.ParametricTorus(ringradius=0.5, crosssectionradius=0.2)
    ring = pl.add_mesh(torus, color='white', smooth_shading=True, specular=1.0)
    cube = pl.add_mesh(pv.Cube(center=(1, 0, 0)), color='red')
    pl.camera_position = VIEW
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
    return found


@contextmanager
def _stage(size):
    """Show everything in a window; yield it and the effects."""
    with Stage(size) as stage:
        effects = fill(stage.plotter)
        stage.look(VIEW)
        yield stage, effects


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

    def shown(chosen):
        choose(effects, chosen)
        stage.draw()  # what was put on is prepared
        return stage.draw()

    with _stage(size) as (stage, effects):
        sets = {'none': (), **{name: (name,) for name in effects}, 'all': tuple(effects)}
        best = least(rounds, {name: partial(shown, chosen) for name, chosen in sets.items()})
    ms = {name: 1e3 * (found - best['none']) for name, found in best.items()}
    for name in effects:
        yield Row(f'alone: {name}', ms[name], 'ms')
    yield Row('all effects together', ms['all'], 'ms')
    over = ms['all'] / sum(ms[name] for name in effects)
    yield Row('all effects together over the sum of each', over, 'x', 0.8)


def _stages(size, rounds) -> dict[str, float]:
    """Return the ms that the programs of all effects cost in one frame of all of them."""
    best: dict[str, float] = {}
    with _stage(size) as (stage, effects):
        choose(effects, effects)
        stage.draw()
        for _ in range(rounds):
            with _timed() as spans:
                stage.draw()
            for name, spent in spans.items():
                best[name] = min(best.get(name, np.inf), 1e3 * spent)
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

    with patch.object(Quad, 'draw_alone', timed):
        yield spans


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

    @contextmanager
    def of_python(self):
        """Count what Python takes for a while, and leave out what GL does."""
        # Where Python hands over to GL, and the methods of the pipeline that VTK calls.
        parts = [(Picture, '_blit', -1), (Texture, 'download', -1), (Drawer, 'draw', -1)]
        parts += [(Target, '_clear', -1), (Pipeline, '_on_start', 1), (Pipeline, '_on_end', 1)]
        start = Quad.__init__

        def started(quad, *args, **options):
            start(quad, *args, **options)
            render, release = quad.helper.Render, quad.helper.ReleaseGraphicsResources
            counted = self._counted(render, -1)
            quad.helper = SimpleNamespace(Render=counted, ReleaseGraphicsResources=release)

        with ExitStack() as stack:
            stack.enter_context(patch.object(Quad, '__init__', started))
            for owner, name, sign in parts:
                function = self._counted(getattr(owner, name), sign)
                stack.enter_context(patch.object(owner, name, function))
            yield


def _python(rounds=100, size=(32, 18)) -> Row:
    """Return the time of the main thread that five effects take of a frame, less GL's share."""
    clock, found = _Clock(), []
    with clock.of_python(), _stage(size) as (stage, effects):
        choose(effects, FIVE)
        stage.draw()
        for _ in range(rounds):
            clock.spent = 0.0
            stage.window.Render()
            found.append(clock.spent)
    return Row('Python in a frame, five effects', 1e3 * np.median(found), 'ms', 1.0)
