"""A dense block of polyhedra: what hides within it, and what it saves not to draw that."""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from unittest.mock import patch

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from benchmarks.common.harness import Row
from benchmarks.common.whole_frames import told
from pvibr.cli.timing import spent
from pvibr.core.costs import Backoff
from pvibr.instances.hidden_blocks import HiddenBlocks
from pvibr.scenes.stage import MULTI_SAMPLES

#: Distance of neighbours over the radius of the polyhedra.
PITCH = 1.7
_LOOSE = 20.0  # the same, where hardly any is hidden


def measure(settings, results):
    """Yield rows of the dense block, and what looking in vain costs in a loose one."""
    side = settings.dense
    with block(side, PITCH, settings.size) as (plotter, things):
        for samples in MULTI_SAMPLES:
            plotter.render_window.SetMultiSamples(samples)
            yield from _frames(plotter, settings, f'dense block, {samples} samples', 0.8)
        with patch.object(Backoff, 'waits', lambda _: False):
            missing, share = _missing(plotter, things, settings), _found(plotter, things)
        yield Row('dense block: pixels missing', missing, 'px', 0)
        yield Row('dense block: share of what is hidden that is not drawn', share, '', 0.7, True)
    with block(side, _LOOSE, settings.size) as (plotter, _):
        plotter.render_window.SetMultiSamples(MULTI_SAMPLES[0])
        yield from _frames(plotter, settings, 'loose block', 1.02)


def _frames(plotter, settings, title, bar):
    """Yield times of frames without what is hidden, and with all drawn."""
    times: dict = {'with': [], 'without': []}
    for k in range(-2, settings.dense_frames):
        for name, frames in times.items():
            plotter.camera.azimuth = 7 * k
            with _drawing_all(name == 'without'):
                seconds = spent(plotter.render_window, plotter.render_window.Render)
            if k >= 0:
                frames.append(seconds)
    for name, value, unit in told(times):
        limit = bar if name.startswith('with over') and name.endswith('CPU') else None
        yield Row(f'{title}: {name}', value, unit, limit)


def _missing(plotter, things, settings) -> int:
    """Return how many pixels differ from those with all drawn, of a camera that jumps."""
    rng, missing = np.random.default_rng(settings.dense), 0
    reach = 0.9 * settings.dense * PITCH
    for _ in range(settings.dense_views):
        way = rng.normal(size=3)
        eye = way / np.linalg.norm(way) * reach * rng.uniform(0.2, 3)
        plotter.camera_position = [eye.tolist(), rng.normal(0, 3, 3).tolist(), (0.1, 0.2, 1)]
        plotter.renderer.ResetCameraClippingRange()
        pictures = []
        for draws_all in (False, True):
            with _drawing_all(draws_all):
                things.visible = things.visible  # chooses anew what is drawn
                plotter.render()
                pictures.append(plotter.screenshot(return_img=True).astype(int))
        missing += int((pictures[0] != pictures[1]).any(-1).sum())
    return missing


def _found(plotter, things) -> float:
    """Return how much of what is seen nowhere was not drawn, by pictures of their numbers."""
    plotter.render_window.SetMultiSamples(0)
    plotter.view_isometric()
    plotter.render()
    hidden_count = things.report()['hidden']
    # Random, so that edges, which mix them, are rarely the number of another.
    numbers = np.random.default_rng(0).choice(1 << 24, len(things), replace=False)
    digits = numbers >> 16, numbers >> 8 & 255, numbers & 255
    things.colors = np.stack(digits, 1).astype(np.uint8)
    for actor in things.actors():
        actor.GetProperty().LightingOff()
    plotter.render()
    picture = plotter.screenshot(return_img=True).astype(int)
    seen = np.unique(picture @ [1 << 16, 1 << 8, 1])
    return hidden_count / (len(things) - np.isin(numbers, seen).sum())


def _drawing_all(is_on):
    """Return a context that draws what is hidden, too."""
    return patch.object(HiddenBlocks, 'cull', lambda *a: a[-1]) if is_on else nullcontext()


@contextmanager
def block(side, pitch, size):
    """Yield a plotter of side**3 polyhedra as instances, as PyVista draws it."""
    rng = np.random.default_rng(side)
    poses = np.tile(np.eye(4), (side**3, 1, 1))
    poses[:, :3, :3] = Rotation.random(side**3, random_state=side).as_matrix()
    places = np.stack(np.unravel_index(np.arange(side**3), (side,) * 3), 1) - (side - 1) / 2
    poses[:, :3, 3] = pitch * (places + rng.normal(0, 0.03, places.shape))
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    things = plotter.ibr.add_instances(_polyhedron(rng), poses, progress=False)
    plotter.show(auto_close=False)
    yield plotter, things
    plotter.close()


def _polyhedron(rng) -> pv.PolyData:
    """Return a polyhedron of about two thousand triangles and 20 corners."""
    corners = rng.normal(size=(20, 3))
    corners /= np.linalg.norm(corners, axis=1)[:, None]
    hull = pv.PolyData(corners).delaunay_3d().extract_surface(algorithm='dataset_surface')
    return hull.triangulate().subdivide(3, 'linear').clean()
