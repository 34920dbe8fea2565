"""Pictures are the same without what is hidden, after every movement of the camera."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.points import quadric_occlusion
from tests.marks import slow

COUNT = 20_000
VIEWS = [(0, -7.5, 1), (5, 5, 4), (0.1, 0.2, -6), (-4, 0, 0.3), (0, -1.5, 0), (0.2, 0.1, 0)]


def add(pl, kind):
    rng = np.random.default_rng(0)
    centers = rng.uniform(-1, 1, (COUNT, 3))
    colors = rng.integers(0, 256, (COUNT, 3)).astype(np.uint8)
    if kind == 'spheres':
        return pl.ibr.add_spheres(centers, rng.uniform(0.04, 0.09, COUNT), colors=colors)
    if kind == 'ellipsoids':
        radii = rng.uniform(0.03, 0.1, (COUNT, 3))
        return pl.ibr.add_ellipsoids(centers, radii, rng.normal(size=(COUNT, 4)), colors=colors)
    ends = rng.normal(0, 0.05, (COUNT, 3))
    return pl.ibr.add_cylinders(centers - ends, centers + ends, 0.06, colors=colors)


@pytest.fixture
def always(monkeypatch):
    """Have occlusion looked for however few blocks there are, until told otherwise."""
    monkeypatch.setattr(quadric_occlusion, '_LEAST', 8)
    monkeypatch.setattr(quadric_occlusion, '_PAUSE', 0)
    return lambda share: monkeypatch.setattr(quadric_occlusion, '_WORTH', share)


MODES = (None, False), (None, True), ('msaa', False), ('ssaa', False)
#: Each kind and each mode at least once.
QUICK = {'spheres': MODES[::2], 'ellipsoids': MODES[1::2], 'cylinders': MODES[2:3]}


@pytest.mark.sampled
@pytest.mark.parametrize(
    ('kind', 'smooth', 'parallel'),
    [slow(kind, *mode, when=mode not in QUICK[kind]) for kind in QUICK for mode in MODES],
)
def test_nothing_that_is_seen_is_left_out(kind, smooth, parallel, see, always):
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    pl.disable_anti_aliasing()
    if smooth:
        pl.enable_anti_aliasing(smooth)
    things = add(pl, kind)
    pl.camera.parallel_projection = parallel
    pl.camera.parallel_scale = 1.3
    hidden = 0
    for eye in VIEWS[: 3 if smooth else 6]:
        pl.camera.position, pl.camera.focal_point, pl.camera.up = eye, (0, 0, 0), (0, 0.1, 1)
        pl.renderer.ResetCameraClippingRange()
        always(1.0)
        picture, far = see.grab(pl), see.depths(pl)
        hidden = max(hidden, things.report()['hidden'])
        always(0.0)
        things._content_key = None
        assert (see.grab(pl) == picture).all()
        assert things.report()['hidden'] == 0
        assert np.array_equal(see.depths(pl), far, equal_nan=True)
    assert hidden > (-1 if smooth == 'ssaa' else COUNT // 10)


def test_other_sizes_and_subplots(see, always):
    always(1.0)
    pl = pv.Plotter(off_screen=True, window_size=(240, 100), shape=(1, 2))
    pl.disable_anti_aliasing()
    pl.subplot(0, 1)
    things = add(pl, 'spheres')
    for size in [(240, 100), (300, 260), (160, 80)]:
        pl.window_size = size
        picture = see.grab(pl)
        assert things.report()['hidden'] > 0
        always(0.0)
        things._content_key = None
        assert (see.grab(pl) == picture).all()
        always(1.0)
    held = things.report()['bytes']
    things.remove()
    assert things.report()['bytes'] == 0 < held
    pl.ibr.add(things)
    see.grab(pl)
    assert things.report()['hidden'] > 0


def test_what_becomes_invisible_hides_nothing(see, always):
    always(1.0)
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    things = add(pl, 'spheres')
    see.grab(pl)
    assert things.report()['hidden'] > 0
    things.visible = things.points[:, 1] > 0.8
    behind = see.grab(pl)
    things.radius = np.where(things.visible, things.radius, 0.0)
    assert (see.grab(pl) == behind).all()


def test_tries_in_vain_are_seldom(see, monkeypatch):
    monkeypatch.setattr(quadric_occlusion, '_LEAST', 8)
    monkeypatch.setattr(quadric_occlusion, '_LAYERS', 0.01)
    tries = []
    draw = quadric_occlusion.Occlusion._draw
    monkeypatch.setattr(
        quadric_occlusion.Occlusion, '_draw', lambda *a: (tries.append(1), draw(*a))[1]
    )
    pl = pv.Plotter(off_screen=True, window_size=(100, 80))
    add(pl, 'spheres')
    for k in range(quadric_occlusion._PAUSE):
        pl.camera.azimuth = k
        see.grab(pl)
    assert len(tries) == 1
