"""Whole frames of a real plotter, with a capability and without it, drawn by turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace

import numpy as np
import pyvista as pv

from pvibr.cli.timing import CLOCKS, medians_ms, spent
from pvibr.scenes.stage import MULTI_SAMPLES

#: Builds the scene of some settings in a plotter of a window size, with the capability or without
#: it, and returns the plotter and a function that draws the frame of a number.
Maker = Callable[
    [SimpleNamespace, tuple[int, int], bool], tuple[pv.Plotter, Callable[[int], object]]
]
#: The window and the number of pairs of frames, in full and for ``--quick``.
EXTENTS = ((1024, 768), 15), ((320, 180), 2)


def real_plotter(size, actors=()):
    """Return an off-screen plotter of actors as PyVista makes it."""
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    for actor in actors:
        plotter.add_actor(actor, reset_camera=False)
    return plotter


def turning(plotter, degrees=0.2) -> Callable[[int], object]:
    """Return a function that draws a frame of a camera that turns around its focal point."""
    start = plotter.camera.position, plotter.camera.focal_point, plotter.camera.up

    def draw(k):
        plotter.camera_position = start
        plotter.camera.Azimuth(degrees * k)
        plotter.renderer.ResetCameraClippingRange()
        plotter.render_window.Render()

    return draw


def median_seconds(plotter, draw, frames) -> float:
    """Return the median processor time of frames, and close the plotter."""
    plotter.show(auto_close=False)
    times = [spent(plotter.render_window, partial(draw, k))[0] for k in range(-2, frames)]
    plotter.close()
    return float(np.median(times[2:]))  # the first two upload, compile and settle


def measured(make, settings, size, pairs) -> dict[int, dict[str, list[tuple[float, float]]]]:
    """Return the seconds of frames with and without, in pairs, by multisamples; of both clocks."""
    both = {name: make(settings, size, name == 'with') for name in ('with', 'without')}
    found: dict[int, dict[str, list[tuple[float, float]]]] = {}
    for samples in MULTI_SAMPLES:
        for plotter, _ in both.values():
            plotter.render_window.SetMultiSamples(samples)
            plotter.show(auto_close=False)
        times = found[samples] = {name: [] for name in both}
        for k in range(-2, pairs):
            for name, (plotter, draw) in both.items():
                frame = spent(plotter.render_window, partial(draw, k))
                if k >= 0:  # the first two upload, compile and settle
                    times[name].append(frame)
    for plotter, _ in both.values():
        plotter.close()
    return found


def told(times) -> Iterator[tuple[str, float, str]]:
    """Yield names, values and units: medians, the paired ratio and the spread of it."""
    ratios = np.percentile(np.divide(times['with'], times['without']), [25, 50, 75], axis=0)
    medians = {name: medians_ms(by_clock) for name, by_clock in times.items()}
    for clock, (low, ratio, high) in zip(CLOCKS, ratios.T, strict=True):
        for name in ('with', 'without'):
            yield f'{name}, {clock}', medians[name][clock], 'ms'
        yield f'with over without, {clock}', ratio, 'x'
        yield f'interquartile range of that, {clock}', high - low, 'x'
