"""CPU and wall-clock time of frames."""

from __future__ import annotations

import time

import numpy as np

#: The two clocks: time of all processors, and wall-clock time.
CLOCKS = 'CPU', 'wall'


def spent(window, job=None) -> tuple[float, float]:
    """Return the seconds of a GPU job, by default a frame, on both clocks.

    On a software renderer, CPU time is the less sensitive to other load.
    """
    window.WaitForCompletion()
    wall, cpu = time.perf_counter(), time.process_time()
    (job or window.Render)()
    window.WaitForCompletion()
    return time.process_time() - cpu, time.perf_counter() - wall


def frame_at(stage, camera) -> tuple[float, float]:
    """Return the seconds of a frame from a camera, on both clocks."""
    stage.look(camera)
    return spent(stage.window)


def medians_ms(times) -> dict[str, float]:
    """Return the median milliseconds on both clocks."""
    return dict(zip(CLOCKS, (1e3 * np.median(times, axis=0)).tolist(), strict=True))
