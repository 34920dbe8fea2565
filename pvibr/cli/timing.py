"""The time of frames and of other jobs, and pictures."""

from __future__ import annotations

import time

import numpy as np

from pvibr.capture.offscreen import Stage
from pvibr.maths.flip import flip

#: The two clocks: the time of all processors together, and that on the wall.
CLOCKS = 'CPU', 'wall'


def spent(window, job=None) -> tuple[float, float]:
    """Return the seconds of a job on the GPU, by default of a frame: of the processors, and wall.

    Without a GPU the processors' time is what others on the machine change least.
    """
    window.WaitForCompletion()
    wall, cpu = time.perf_counter(), time.process_time()
    (job or window.Render)()
    window.WaitForCompletion()
    return time.process_time() - cpu, time.perf_counter() - wall


def frame_at(stage, camera) -> tuple[float, float]:
    """Return the seconds of a frame from a camera, of both clocks."""
    stage.look(camera)
    return spent(stage.window)


def seconds(window, job=None) -> float:
    """Return the seconds of a job on the GPU on the wall; by default of a frame."""
    return spent(window, job)[1]


def medians_ms(times) -> dict[str, float]:
    """Return the median ms of both clocks."""
    return dict(zip(CLOCKS, (1e3 * np.median(times, axis=0)).tolist(), strict=True))


def python_ms(stage) -> float:
    """Return the ms that Python took of the last frame."""
    return sum(row['ms'] for row in stage.plotter.ibr.report().as_dict()['rows'])


def timed(job):
    """Return the result of a job on the CPU, and its seconds."""
    start = time.perf_counter()
    found = job()
    return found, time.perf_counter() - start


def least(rounds, jobs) -> dict:
    """Return the least seconds of each of some jobs, which take turns and time themselves."""
    best = dict.fromkeys(jobs, np.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            best[name] = min(best[name], job())
    return best


def least_ms(size, put, cameras) -> float:
    """Return the least ms of a frame while the camera moves; the first does not count."""
    with Stage(size) as stage:
        put(stage.plotter)
        found = stage.seconds(cameras)[1:]
        for actor in list(stage.renderer.GetActors()):  # their mappers may be shown elsewhere
            actor.ReleaseGraphicsResources(stage.window)
    return 1e3 * found.min()


def warm_up(stage, substitute, cameras):
    """Draw in full and with a substitute at some cameras."""
    for enabled in (False, True):
        substitute.enabled = enabled
        for camera in cameras:
            stage.look(camera)
            stage.draw()


def beside_full(stage, substitute, cameras, every, note) -> dict[str, float]:
    """Return the mean ms of frames, also of the processors; one of so many is drawn in full too.

    After each frame, `note` is called with whether it used the substitute.
    """
    times: dict[bool, list] = {True: [], False: []}
    for k, camera in enumerate(cameras):
        for enabled in (True, False) if k % every == every - 1 else (True,):
            substitute.enabled = enabled
            stage.look(camera)
            times[enabled].append(spent(stage.window))
            note(enabled)
        substitute.enabled = True
    means = 1e3 * np.concatenate([np.mean(times[enabled], axis=0) for enabled in (True, False)])
    return dict(zip(('cpu', 'ms', 'full_cpu', 'full_ms'), means.tolist(), strict=True))


def pictures(stage, cameras) -> list:
    """Return the pictures that some cameras take."""
    found = []
    for camera in cameras:
        stage.look(camera)
        found.append(stage.picture())
    return found


def mean_flip(pictures, references) -> float:
    """Return the mean of FLIP over pairs of pictures."""
    return float(np.mean([flip(a, b).mean() for a, b in zip(pictures, references, strict=True)]))
