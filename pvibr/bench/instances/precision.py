"""The same picture far from the origin, and of very small and very large things."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.capture.offscreen import Stage

#: Offsets in sizes of the scene, and scales.
OFFSETS, SCALES = (1e6, 1e9), (1e-9, 1e9)
SIZE = (320, 180)


def measure(settings, results):
    """Yield mean differences from the picture at the origin."""
    truth = _picture(0.0, 1.0)
    for offset in OFFSETS[: settings.extremes]:
        yield _row(f'at {offset:g} of its size', _picture(offset, 1.0), truth)
    for scale in SCALES[: settings.extremes]:
        yield _row(f'{scale:g} as large', _picture(0.0, scale), truth)


def _row(name, picture, truth):
    away = 255 * np.abs(picture - truth).mean()
    return Row(f'precision: {name}, mean difference', away, '/255', 1)


def _picture(offset, scale):
    rng = np.random.default_rng(5)
    size = 12.0 * scale
    shift = np.array([1.0, -0.7, 0.3]) * offset * size
    places = np.stack(np.meshgrid(*[np.arange(-4.0, 5.0)] * 2, [0.0]), -1).reshape(-1, 3)
    places = (places + rng.uniform(-0.2, 0.2, places.shape)) * scale + shift
    mesh = pv.ParametricTorus(0.3, 0.12, u_res=100, v_res=60)
    mesh.points = mesh.points.astype(float) * scale
    with Stage(SIZE, view_angle=30.0) as stage:
        stage.plotter.ibr.add_instances(mesh, places, max_error=1.0, progress=False)
        eye = shift + np.array([3.0, -14.0, 9.0]) * scale
        stage.look([tuple(eye), tuple(shift), (0, 0, 1)])
        return stage.picture()
