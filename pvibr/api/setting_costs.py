"""What samples, lights, effects and things add to the time of a frame, measured without each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np

from pvibr.core.arguments import checked_whole
from pvibr.core.progress import baking
from pvibr.things.thing import Thing

_MOST_FRAMES = 1000  # of each, which takes minutes
_TURN = 0.05  # degrees between frames: what is kept while nothing changes does not count
_NOISE = 0.05  # of a frame: a setting that costs less is no advice


@dataclass(frozen=True)
class Cost:
    """What one setting, effect or thing adds to a frame."""

    name: str
    #: Milliseconds by which a frame without it is shorter.
    ms: float
    #: What a user writes to do without it; empty for things, which are the scene.
    remedy: str = ''


@dataclass(frozen=True)
class Costs:
    """The milliseconds of a frame of the moving view, and of its parts; prints as a table."""

    frame_ms: float
    parts: tuple[Cost, ...]

    @property
    def advice(self) -> str:
        """The one change that shortens a frame most, empty if none helps."""
        settings = [part for part in self.parts if part.remedy]
        best = max(settings, key=lambda part: part.ms, default=None)
        if best is None or best.ms < _NOISE * self.frame_ms:
            return ''
        return f'{best.remedy} saves {best.ms:.0f} of {self.frame_ms:.0f} ms ({best.name})'

    def __str__(self) -> str:
        lines = [f'{self.frame_ms:8.1f} ms  a frame while the view moves, at full quality']
        for part in sorted(self.parts, key=lambda part: -part.ms):
            without = f'  without: {part.remedy}' if part.remedy else ''
            lines.append(f'{part.ms:8.1f} ms  {part.name}{without}')
        advice = self.advice
        return '\n'.join([*lines, f'most helpful: {advice}'] if advice else lines)


@dataclass(frozen=True)
class _Part:
    name: str
    remedy: str
    #: Takes it out, if False, or puts it back.
    switch: Callable[[bool], object]


def costs(self, frames=2) -> Costs:
    """Measure what samples, lights, effects and things cost, by frames without each.

    Draws some dozens of frames of the active subplot's window, which turn by a fraction of a
    degree; a window shows none of them. The last result stands in :meth:`report`.

    Parameters
    ----------
    frames : int
        Frames measured with and without each, after one that is not; more are more accurate.

    Returns
    -------
    Costs
        ``frame_ms``; ``parts``, each with ``name``, ``ms`` and ``remedy``; and ``advice``, the one
        change that helps most. It prints as a table.

    Raises
    ------
    ValueError
        If `frames` is not a whole number from 1 to 1000.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> _ = pl.ibr.add(pvibr.AmbientOcclusion())
    >>> 'AmbientOcclusion' in [part.name for part in pl.ibr.costs().parts]
    True
    >>> pl.close()
    """
    self._check_open()
    frames = checked_whole('frames', frames, 1, _MOST_FRAMES)
    self.wait()
    renderer = self.pipeline.renderer
    parts = _parts(self, renderer)
    pairs = []
    with self._adaptive_quality.full(), _unseen(renderer), baking(None) as advance:
        for k, part in enumerate(parts):
            with_it = _frame_ms(renderer, frames)
            part.switch(False)
            try:
                pairs.append((with_it, _frame_ms(renderer, frames)))
            finally:
                part.switch(True)
            advance((k + 1) / len(parts))
        whole_ms = float(np.median([p[0] for p in pairs] or [_frame_ms(renderer, frames)]))
    costs_of_parts = (
        Cost(part.name, before - after, part.remedy)
        for part, (before, after) in zip(parts, pairs, strict=True)
    )
    measured = self._costs[self.pipeline] = Costs(whole_ms, tuple(costs_of_parts))
    return measured


def _parts(ibr, renderer) -> list[_Part]:
    """Return what a frame may be drawn without."""
    window, parts = renderer.GetRenderWindow(), []
    samples = window.GetMultiSamples()
    if samples > 1:
        parts.append(
            _Part(
                f'{samples} samples a pixel',
                'pl.disable_anti_aliasing()',
                lambda on: window.SetMultiSamples(samples if on else 0),
            )
        )
    lights = [light for light in renderer.GetLights() if light.GetSwitch()]
    if len(lights) > 1:
        parts.append(
            _Part(
                f'{len(lights)} lights in place of one',
                'pl.remove_all_lights(); pl.add_light(pv.Light())',
                lambda on: [light.SetSwitch(on) for light in lights[1:]],
            )
        )
    for name, method in (('SSAO', 'disable_ssao'), ('DepthPeeling', 'disable_depth_peeling')):
        if getattr(renderer, f'GetUse{name}')():
            parts.append(
                _Part(f"VTK's {name}", f'pl.{method}()', getattr(renderer, f'SetUse{name}'))
            )
    for effect in ibr.pipeline.effects:
        if isinstance(effect, Thing):
            if effect.visibility:
                parts.append(_Part(effect.name, '', effect.SetVisibility))
        elif effect.enabled:
            remedy = f"pl.ibr['{effect.name}'].enabled = False"
            parts.append(_Part(effect.name, remedy, partial(setattr, effect, 'enabled')))
    return parts


@contextmanager
def _unseen(renderer) -> Iterator[None]:
    """Draw frames that no window shows, and leave the camera as it was."""
    window, camera = renderer.GetRenderWindow(), renderer.GetActiveCamera()
    view = camera.GetPosition(), camera.GetClippingRange()
    swaps_buffers = window.GetSwapBuffers()
    window.SetSwapBuffers(0)
    try:
        yield
    finally:
        camera.SetPosition(view[0])
        camera.SetClippingRange(view[1])
        window.SetSwapBuffers(swaps_buffers)
        window.Render()


def _frame_ms(renderer, frames) -> float:
    """Return the median time of frames of a turning camera."""
    window, camera, times = renderer.GetRenderWindow(), renderer.GetActiveCamera(), []
    for k in range(frames + 1):
        camera.Azimuth(_TURN if k % 2 else -_TURN)
        start = perf_counter()
        window.Render()
        window.WaitForCompletion()
        times.append(1e3 * (perf_counter() - start))
    return float(np.median(times[1:]))
