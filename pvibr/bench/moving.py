"""``pvibr bench moving``: the demo's forest dragged by the mouse, with and without a budget."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from pvibr.bench.plot import save, several_axes
from pvibr.bench.rows import Row
from pvibr.bench.runs import run
from pvibr.maths.image_error import flip
from pvibr.scenes.landscape import landscape
from pvibr.scenes.scenery import scenery

#: Pixels that the mouse goes from one frame to the next.
_STEP = 3


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    size: tuple[int, int] = (1280, 720)
    trees: int = 10_000
    places: int = 5
    frames: int = 30
    limits: tuple[float, ...] = (0.0, 100.0)


QUICK = Settings(size=(320, 180), trees=200, places=2, frames=6)


def measure(out, *, quick=False) -> list:
    """Drag, print and write the table and the plot, and return the rows."""
    return run('moving', {'drags': _drags}, QUICK if quick else Settings(), plot, out, quick=quick)


def plot(results, path):
    """Draw the time of each frame, one axis a place."""
    drags = results.points['drags']
    figure, all_axes = several_axes((4 * len(drags), 4), 1, len(drags), sharey=True, squeeze=False)
    for place, axes in zip(drags, all_axes[0], strict=True):
        for limit, drag in drags[place].items():
            axes.plot(drag['ms'], '.-', label=_name(limit))
        axes.axhline(100, color='0.5', ls='--')
        axes.set(xlabel='frame of the drag', yscale='log', title=f'at {place:.0%} of the trail')
    all_axes[0][0].set_ylabel('ms a frame')
    all_axes[0][0].legend(fontsize='x-small')
    save(figure, 'moving', results, path)


def _drags(settings, results):
    """Add the drags at all places, with each limit in turns."""
    scene = landscape(settings.trees)
    plotter = scenery(scene, 1.0, settings.size, off_screen=True)
    plotter.enable_trackball_style()
    plotter.show(auto_close=False)
    mouse = _Mouse(plotter)
    shares = (np.arange(settings.places) + 0.5) / settings.places
    mouse.drag(scene.path(1, shares[0], shares[0])[0], 3)  # shaders are compiled
    found: dict = {}
    for share in shares.tolist():
        camera = scene.path(1, share, share)[0]
        found[share] = {}
        for limit in settings.limits:
            plotter.ibr.interactive_frame_ms = limit
            found[share][limit] = mouse.drag(camera, settings.frames)
    results.settings['samples'] = plotter.render_window.GetMultiSamples()
    plotter.close()
    results.points['drags'] = found
    for limit in settings.limits:
        results.rows += _rows(limit, [drags[limit] for drags in found.values()])


def _rows(limit, drags):
    name = _name(limit)
    bars = (limit, 0.5) if limit else (None, None)
    every = np.concatenate([drag['ms'] for drag in drags])
    rows = [
        Row(f'{name}: a frame, median', np.median(every), 'ms', bars[0]),
        Row(
            f'{name}: a frame, median at the slowest place',
            max(np.median(drag['ms']) for drag in drags),
            'ms',
            bars[0],
        ),
        Row(f'{name}: a frame, 95 of 100 are faster', np.percentile(every, 95), 'ms'),
        Row(
            f'{name}: a frame, of all processors, mean at the slowest place',
            max(drag['processor'] for drag in drags),
            'ms',
        ),
        Row(
            f'{name}: full picture after the release, slowest',
            max(drag['release'] for drag in drags),
            's',
            bars[1],
        ),
    ]
    if limit:
        rows += [
            Row(f'{name}: quality, least', min(min(drag['quality']) for drag in drags)),
            Row(
                f'{name}: FLIP, last moving frame against the full one',
                max(drag['flip'] for drag in drags),
            ),
        ]
    return rows


def _name(limit):
    return f'interactive_frame_ms {limit:g}' if limit else 'full quality'


class _Mouse:
    """Drags as a hand does: events to the interactor, one at a time."""

    def __init__(self, plotter):
        self._plotter = plotter
        self._window = plotter.render_window
        self._qualities: list[float] = []
        plotter.renderer.AddObserver('EndEvent', self._note)

    def drag(self, camera, frames) -> dict:
        """Turn the view from a camera; return times, qualities, the last error."""
        self._plotter.camera_position = camera
        self._plotter.renderer.ResetCameraClippingRange()
        for _ in range(2):  # at rest, and all of it is on the GPU
            self._seconds(self._window.Render)
        x, y = (n // 2 for n in self._window.GetSize())
        self._event('MouseMoveEvent', x, y)
        self._event('LeftButtonPressEvent', x, y)
        self._qualities.clear()
        moves = [('MouseMoveEvent', x + _STEP * (k + 1), y) for k in range(frames)]
        spent = time.process_time()
        ms = [1e3 * self._seconds(self._event, *move) for move in moves]
        spent = 1e3 * (time.process_time() - spent) / frames
        qualities, moving = self._qualities.copy(), self._picture()
        release = self._seconds(self._event, 'LeftButtonReleaseEvent', x + _STEP * frames, y)
        error = float(flip(moving, self._picture()).mean())
        found = {'ms': ms, 'processor': spent, 'quality': qualities}
        return found | {'release': release, 'flip': error}

    def _note(self, *_):
        self._qualities.append(self._plotter.ibr.quality)

    def _event(self, name, x, y):
        interactor = self._window.GetInteractor()
        interactor.SetEventInformation(x, y, 0, 0)
        interactor.InvokeEvent(name)

    def _seconds(self, call, *args) -> float:
        start = time.perf_counter()
        call(*args)
        self._window.WaitForCompletion()
        return time.perf_counter() - start

    def _picture(self):
        return np.asarray(self._plotter.image)[..., :3] / 255.0
