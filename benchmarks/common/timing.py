"""Times and pictures of frames, and times of other jobs."""

from __future__ import annotations

import time

import numpy as np

from pvibr.cli.timing import spent
from pvibr.maths.flip import flip
from pvibr.scenes.stage import Stage


def seconds(window, job=None) -> float:
    """Return the wall-clock seconds of a GPU job, by default a frame."""
    return spent(window, job)[1]


def python_ms(stage) -> float:
    """Return the milliseconds that Python took in the last frame."""
    return sum(row['ms'] for row in stage.plotter.ibr.report().as_dict()['rows'])


def timed(job):
    """Return the result and the seconds of a CPU job."""
    start = time.perf_counter()
    result = job()
    return result, time.perf_counter() - start


def least(rounds, jobs) -> dict:
    """Return the least seconds of each job; jobs take turns and return their time."""
    best = dict.fromkeys(jobs, np.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            best[name] = min(best[name], job())
    return best


def least_ms(size, fill, cameras) -> float:
    """Return the least milliseconds of a frame while the camera moves, except the first."""
    with Stage(size) as stage:
        fill(stage.plotter)
        frame_seconds = stage.seconds(cameras)[1:]
        for actor in list(stage.renderer.GetActors()):  # other windows may share mappers
            actor.ReleaseGraphicsResources(stage.window)
    return 1e3 * frame_seconds.min()


def warm_up(stage, substitute, cameras):
    """Draw some cameras with the substitute and without."""
    for enabled in (False, True):
        substitute.enabled = enabled
        for camera in cameras:
            stage.look(camera)
            stage.draw()


def beside_full(stage, substitute, cameras, every, note) -> dict[str, float]:
    """Return mean milliseconds of frames on both clocks, each `every`-th also without substitute.

    `note` is called after each frame with whether it used the substitute.
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
    """Return the pictures from some cameras."""
    images = []
    for camera in cameras:
        stage.look(camera)
        images.append(stage.picture())
    return images


def mean_flip(pictures, references) -> float:
    """Return the mean FLIP of pairs of pictures."""
    return float(np.mean([flip(a, b).mean() for a, b in zip(pictures, references, strict=True)]))
