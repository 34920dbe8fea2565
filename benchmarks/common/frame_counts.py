"""Count what frames of some scenes ask of Python and of a GPU, beside what they asked last.

``python -m benchmarks.common.frame_counts`` prints both, and keeps the new numbers in the file
beside this module: commit it, so that a cost that was added is seen in the change that adds it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median_low

import numpy as np
import pyvista as pv
from rich.console import Console
from rich.table import Table

import pvibr
from pvibr.gl.driver import VARIABLE
from pvibr.scenes.walker import walker

#: Numbers by what moves and scene, as of the last time that they were kept.
FILE = Path(__file__).with_suffix('.json')
_BALL = pv.Sphere(theta_resolution=24, phi_resolution=20)
_WARM_FRAMES, _FRAMES = 5, 3


def _places(count, spread):
    return np.random.default_rng(4).uniform(-spread, spread, (count, 3)) * (1, 1, 0.1)


def _look(plotter, distance):
    plotter.camera_position = [
        np.multiply(distance, (0.73, -0.65, 0.32)).tolist(),
        (0, 0, 0),
        (0, 0, 1),
    ]


def _sets(set_count, item_count, plotter):
    for k in range(set_count):
        places = np.add(_places(item_count, 50.0), (0, 0, k))
        plotter.ibr.add_instances(_BALL, places, bake=True)
    _look(plotter, 125.0)


def _crowd(plotter):
    crowd = plotter.ibr.add_animated(walker(600), _places(400, 12.0) * (1, 1, 0))
    crowd.times = np.linspace(0, 2, 400)
    crowd.force_level = 'mesh'
    _look(plotter, 30.0)


def _impostors(plotter):
    actors = [plotter.add_mesh(_BALL.translate(at)) for at in _places(30, 12.0)]
    plotter.ibr.add_impostor(actors, only_if_faster=False)
    _look(plotter, 44.0)


def _spheres(plotter):
    plotter.ibr.add_spheres(_places(5_000, 50.0), 0.5)
    _look(plotter, 125.0)


def _effect(name, plotter, **settings):
    for at in _places(10, 12.0):
        plotter.add_mesh(_BALL.translate(at), color='white', specular=1.0)
    plotter.ibr.add(getattr(pvibr, name)(**settings))
    _look(plotter, 44.0)


#: What fills a plotter with each scene.
SCENES: dict[str, Callable] = {
    '10 000 instances': partial(_sets, 1, 10_000),
    '25 sets of 100': partial(_sets, 25, 100),
    'crowd of 400': _crowd,
    '30 impostors': _impostors,
    '5 000 spheres': _spheres,
    'bloom': partial(_effect, 'Bloom', threshold=0.5),
    'tone mapping': partial(_effect, 'ToneMapping', auto=True),
    'outline': partial(_effect, 'Outline'),
    'occlusion': partial(_effect, 'AmbientOcclusion'),
    'depth of field': partial(_effect, 'DepthOfField'),
    'hard shadows': partial(_effect, 'Shadows', method='hard'),
    'soft shadows': partial(_effect, 'Shadows', method='pcss'),
}


def counted(name) -> dict[str, dict[str, int]]:
    """Return what frames of a scene ask for, by what moves in them; nothing is time's doing."""
    with _as_hardware():
        plotter = pv.Plotter(off_screen=True, window_size=[300, 200])
        SCENES[name](plotter)
        plotter.show(auto_close=False)

        def turn():
            plotter.camera.Azimuth(0.5)
            plotter.render()

        def play():
            plotter.ibr.time += 0.05
            plotter.render()

        moves = {'camera': turn, 'nothing': plotter.render}
        if name == 'crowd of 400':
            moves = {'time': play} | moves
        found = {what: _counts(plotter, draw) for what, draw in moves.items()}
        plotter.close()
    return found


@contextmanager
def _as_hardware():
    """Let pvibr choose as on a GPU within the block."""
    previous = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = 'hardware'
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if previous is not None:
            os.environ[VARIABLE] = previous


def _counts(plotter, draw) -> dict[str, int]:
    """Return the medians of what some frames ask for."""
    for _ in range(_WARM_FRAMES):
        draw()
    frames = []
    for _ in range(_FRAMES):
        calls = calls_in(draw)
        frames.append({'Python calls': calls} | vars(plotter.ibr.report().counts))
    return {what: median_low(frame[what] for frame in frames) for what in frames[0]}


def calls_in(job) -> int:
    """Return how many functions of Python and built-ins a job calls."""
    call_count = 0

    def note(_frame, event, _function):
        nonlocal call_count
        call_count += event in ('call', 'c_call')

    sys.setprofile(note)
    try:
        job()
    finally:
        sys.setprofile(None)
    return call_count


def kept() -> dict[str, dict[str, dict[str, int]]]:
    """Return the numbers that were kept last, by scene and by what moves."""
    return json.loads(FILE.read_text(encoding='utf-8')) if FILE.exists() else {}


def _cell(before, now) -> str:
    return f'{now:,}' if before == now else f'{before:,} > {now:,}'


def main():
    """Print the numbers kept last and those of now, and keep these."""
    last, now = kept(), {name: counted(name) for name in SCENES}
    numbers = next(iter(next(iter(now.values())).values()))
    table = Table('scene', 'what moves', *(what.replace('_', ' ') for what in numbers))
    for name, moves in now.items():
        for what, counts in moves.items():
            before = last.get(name, {}).get(what, {})
            cells = [_cell(before.get(key, 0), value) for key, value in counts.items()]
            table.add_row(name, what, *cells)
    Console(width=130).print(table)
    FILE.write_text(json.dumps(now, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
