"""Measure frames of the demo's forest, and of a dense block, while they are dragged."""

from __future__ import annotations

import time
from functools import cache, partial

import numpy as np

import pvibr
from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.timing import seconds
from benchmarks.instances import dense
from pvibr.maths.flip import flip
from pvibr.scenes.landscape import landscape
from pvibr.scenes.stage import scenery

#: Pixels that the mouse goes from one frame to the next.
_STEP = 3
_MOVE, _RELEASE = 'MouseMoveEvent', 'LeftButtonReleaseEvent'
_forest = cache(landscape)  # drawn in several plotters


def _drags(settings, results):
    """Yield the rows of drags at all places, with each limit in turns."""
    scene = _forest(settings.trees)
    mouse = Mouse(_dragged(scene, settings.size))
    plotter = mouse.plotter
    plotter.show(auto_close=False)
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
        yield from _rows(limit, [drags[limit] for drags in found.values()])


def _dense_drags(settings, results):
    """Yield how many frames of a dense block with shadows and occlusion are in time."""
    limit = max(settings.limits)
    with dense.block(settings.dense, dense.PITCH, settings.size) as (plotter, _):
        plotter.ibr.add(pvibr.Shadows())
        plotter.ibr.add(pvibr.AmbientOcclusion())
        plotter.enable_trackball_style()
        plotter.ibr.interactive_frame_ms = limit
        ms = Mouse(plotter).drag(plotter.camera_position, settings.frames)['ms']
    title = f'{settings.dense**3} polyhedra, shadows and occlusion, {_name(limit)}'
    yield Row(f'{title}: first frame', ms[0], 'ms', 2 * limit)
    yield Row(f'{title}: a frame, median', np.median(ms), 'ms', limit)
    in_time = np.mean(np.array(ms) <= 2 * limit)
    yield Row(
        f'{title}: frames within twice the limit', in_time, '', 0.95, True, follows_times=True
    )


def _dragged(scene, size):
    plotter = scenery(scene, 1.0, size, off_screen=True)
    plotter.enable_trackball_style()
    return plotter


def _rows(limit, drags):
    name = _name(limit)
    bars = (limit, 0.5) if limit else (None, None)
    every = np.concatenate([drag['ms'] for drag in drags])
    slowest = max(np.median(drag['ms']) for drag in drags)
    cpu, release = (max(drag[key] for drag in drags) for key in ('processor', 'release'))
    yield Row(f'{name}: a frame, median', np.median(every), 'ms', bars[0])
    yield Row(f'{name}: a frame, median at the slowest place', slowest, 'ms', bars[0])
    yield Row(f'{name}: a frame, 95 of 100 are faster', np.percentile(every, 95), 'ms')
    yield Row(f'{name}: a frame, of all processors, mean at the slowest place', cpu, 'ms')
    yield Row(f'{name}: full picture after the release, slowest', release, 's', bars[1])
    if limit:
        worst = max(drag['flip'] for drag in drags)
        yield Row(f'{name}: quality, least', min(min(drag['quality']) for drag in drags))
        yield Row(f'{name}: FLIP, last moving frame against the full one', worst)


def _name(limit):
    return f'interactive_frame_ms {limit:g}' if limit else 'full quality'


class Mouse:
    """Drags as a hand does: events to the interactor, one at a time."""

    def __init__(self, plotter):
        self.plotter = plotter
        self._window = plotter.render_window
        self._qualities: list[float] = []
        plotter.renderer.AddObserver('EndEvent', self._note)

    def drag(self, camera, frames) -> dict:
        """Turn the view from a camera; return times, qualities, the last error."""
        self.plotter.camera_position = camera
        self.plotter.renderer.ResetCameraClippingRange()
        for _ in range(2):  # at rest, and all of it is on the GPU
            self._window.Render()
        self.press()
        self._qualities.clear()
        spent = time.process_time()
        moves = [partial(self.event, _MOVE, k + 1) for k in range(frames)]
        ms = [1e3 * seconds(self._window, move) for move in moves]
        spent = 1e3 * (time.process_time() - spent) / frames
        qualities, moving = self._qualities.copy(), self._picture()
        release = seconds(self._window, partial(self.event, _RELEASE, frames))
        error = float(flip(moving, self._picture()).mean())
        found = {'ms': ms, 'processor': spent, 'quality': qualities}
        return found | {'release': release, 'flip': error}

    def press(self):
        """Press the left button in the middle of the window."""
        self.event(_MOVE)
        self.event('LeftButtonPressEvent')

    def _note(self, *_):
        self._qualities.append(self.plotter.ibr.quality)

    def event(self, name, k=0):
        """Send an event where the mouse is in a frame of the drag."""
        interactor = self._window.GetInteractor()
        x, y = (n // 2 for n in self._window.GetSize())
        interactor.SetEventInformation(x + _STEP * k, y, 0, 0)
        interactor.InvokeEvent(name)

    def _picture(self):
        return np.asarray(self.plotter.image)[..., :3] / 255.0


def plot(points, figure):
    """Draw the time of each frame, one axis a place."""
    drags = points['drags']
    (axes,) = plots.subplots(figure, 1, len(drags), sharey=True, squeeze=False)
    for place, one in zip(drags, axes, strict=True):
        for limit, drag in drags[place].items():
            one.plot(drag['ms'], '.-', label=_name(limit))
        plots.bar(one, 100, label=None)
        one.set(xlabel='frame of the drag', yscale='log', title=f'at {place:.0%} of the trail')
    axes[0].set_ylabel('ms a frame')


def _drag(settings, size, on):
    """Return a forest that is dragged, with the limit or without."""
    mouse = Mouse(_dragged(_forest(settings.trees), size))
    mouse.plotter.ibr.interactive_frame_ms = settings.limits[-1] if on else 0.0

    def draw(k):
        if k >= 0:
            mouse.event(_MOVE, k + 1)
            return
        if k == -1:
            mouse.press()
        else:
            mouse.event(_RELEASE)
        mouse.plotter.render_window.Render()

    return mouse.plotter, draw


BENCH = Bench(
    parts={'drags': _drags, 'dense block': _dense_drags},
    plot=plot,
    outside={'a drag at 100 ms a frame': _drag},
    settings={
        'size': ((1024, 768), (320, 180)),
        'trees': (10_000, 200),
        'dense': (21, 8),
        'places': (5, 2),
        'frames': (30, 6),
        'limits': ((0.0, 100.0), (0.0, 100.0)),
    },
)
