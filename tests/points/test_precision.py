"""Quadrics are what rays in double precision say: under samples, beside giants, of any ratio."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import pyvista as pv

from pvibr.points.quadric_rays import cast, inner, meet_cylinders, meet_ellipsoids, meet_spheres
from pvibr.things.frame import Frame
from tests.marks import slow

pytestmark = pytest.mark.sampled

SIZE = 200, 150
EARTH = 6.4e6
PLAIN = {'color': 'white', 'ambient': 1.0, 'lighting': False}
CAPS = 'flat', 'round', None


def plotter(samples=0):
    pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
    pl.set_background('black')
    pl.disable_anti_aliasing()
    if samples:
        pl.enable_anti_aliasing('msaa', multi_samples=samples)
    return pl


def add(pl, kind, points, sizes, axes, **look):
    """Add items; return what rays meet them with."""
    if kind == 'spheres':
        pl.ibr.add_spheres(points, sizes[:, 0], **look)
        return meet_spheres, points, sizes[:, 0]
    if kind == 'ellipsoids':
        made = pl.ibr.add_ellipsoids(points, sizes, axes, **look)
        return meet_ellipsoids, points, made.axes()
    halves = axes[:, 0] * sizes[:, 1:2]
    pl.ibr.add_cylinders(points - halves, points + halves, sizes[:, 0], caps=kind, **look)
    return partial(meet_cylinders, caps=kind), points, halves, sizes[:, 0]


def turns(rng, count):
    return np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]


@pytest.mark.parametrize(('samples', 'opacity', 'seed'), [(4, 1.0, 0), (8, 1.0, 5), (8, 0.999, 1)])
@pytest.mark.parametrize('kind', ['spheres', 'ellipsoids', 'flat', 'round'])
def test_no_sample_of_a_pixel_that_is_met_is_missing(kind, opacity, samples, seed, see):
    pl, rng = plotter(samples), np.random.default_rng(seed)
    sizes = rng.uniform(0.01, 0.15, (60, 3)) * ([0.2, 3, 1] if kind in CAPS else 1)
    things = add(pl, kind, rng.uniform(-1, 1, (60, 3)), sizes, turns(rng, 60), **PLAIN)
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0.3, -6, 1), (0, 0, 0), (0, 0, 1)
    picture = see.grab(pl)[..., 0]
    met = cast(Frame.of(pl.renderer), *things)[0] >= 0
    assert met.sum() > 300
    assert picture[met].min() > 0.99


def beside(kind, rng):
    """Return a giant beneath the origin, and small things ahead."""
    sizes = rng.uniform(1, 3, (31, 3))
    points = np.vstack([[0.0, 0, -EARTH], np.add(rng.uniform(-20, 20, (30, 3)), (0, 60, 10))])
    axes = turns(rng, 31)
    sizes[0], axes[0] = EARTH * np.array([1, 1, 1]), np.eye(3)[[1, 0, 2]]
    if kind == 'ellipsoids':
        sizes[0] *= 0.9, 1.1, 1.0
    return points, sizes, axes


def compare(pl, things, see):
    """Check the depths of the first thing, and which pixels are covered."""
    found = see.depths(pl)
    ids, depth, _ = cast(Frame.of(pl.renderer), *things)
    assert ((ids >= 0) != np.isfinite(found)).mean() < 1e-3
    giant = (ids % len(things[1]) == 0) & (ids >= 0) & np.isfinite(found)
    # A depth buffer of 24 bits is as exact as this.
    frame = Frame.of(pl.renderer)
    steps = np.full_like(depth, (frame.far - frame.near) * 2.0**-22)
    if not frame.parallel:
        steps = depth**2 * steps / (frame.near * frame.far)
    assert giant.sum() > 1000
    assert (np.abs(found - depth)[giant] < 1e-5 * depth[giant] + steps[giant]).all()


@pytest.mark.parametrize('height', [2.0, 50.0])
@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('kind', ['spheres', 'ellipsoids', *CAPS])
def test_a_giant_beside_the_eye(kind, parallel, height, see):
    pl = plotter()
    things = add(pl, kind, *beside(kind, np.random.default_rng(3)), **PLAIN)
    stand_by(pl, height, parallel)
    picture = see.grab(pl)
    compare(pl, things, see)
    pl.ibr.clear()
    add(pl, kind, *beside(kind, np.random.default_rng(3)), **PLAIN, opacity=0.5)
    stand_by(pl, height, parallel)
    assert ((see.grab(pl) > 0) != (picture > 0)).mean() < 1e-3


def stand_by(pl, height, parallel):
    pl.camera.position, pl.camera.focal_point = (0, 0, height), (0, 100, height - 40)
    pl.camera.up, pl.camera.clipping_range = (0, 0, 1), (0.5, 2e3)
    pl.camera.parallel_projection, pl.camera.parallel_scale = parallel, 60.0


THIN = (1, 1, 1e-4), (1, 1e-4, 1e-4), (1, 0.01, 1e-4)


@pytest.mark.parametrize(
    ('thin', 'away', 'seed', 'parallel'),
    [
        slow(thin, *place, parallel, when=(k + (place[1] == 1) + parallel) % 2)
        for k, thin in enumerate(THIN)
        for place in ((4.0, 2), (0.3, 1))
        for parallel in (False, True)
    ],
)
def test_ellipsoids_as_thin_as_may_be(away, thin, parallel, seed, see):
    # From afar they are thinner than a pixel and drawn as thick, from nearby those of 40 are seen.
    rng = np.random.default_rng(seed)
    pl = plotter()
    sizes = np.outer(rng.uniform(20, 40, 20), thin)
    points = rng.uniform(-0.2, 0.2, (20, 3)) * away
    things = add(pl, 'ellipsoids', points, sizes, turns(rng, 20), **PLAIN)
    for eye in rng.normal(size=(3, 3)):
        pl.camera.position, pl.camera.focal_point = away * eye / np.linalg.norm(eye), (0, 0, 0)
        pl.camera.parallel_projection, pl.camera.parallel_scale = parallel, 0.3 * away
        pl.camera.clipping_range = 0.1 * away, 5 * away
        drawn = see.grab(pl)[..., 0] > 0
        found = see.depths(pl)
        ids, depth, _ = cast(Frame.of(pl.renderer), *things)
        seen = inner(ids) & (ids >= 0)
        assert ((ids >= 0) & ~drawn).sum() <= 2
        if away < 1:
            assert (np.abs(found - depth) < 1e-4 * depth)[seen].mean() > 0.999
            assert seen.sum() > 1000
            assert ((ids < 0) & drawn).sum() <= 2
