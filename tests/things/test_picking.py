"""Picking: the instance under a pixel, as rays against the meshes themselves find it."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.core import _vtk
from pvibr.things.picking import pixel_ray

SIZE = (160, 120)
CAMERA = {'eye': (9, -7, 5), 'focus': (0, 0, 0.2), 'angle': 30}


def poses(move=(0, 0, 0), scale=1.0):
    """Return matrices turned, stretched and mirrored, some behind others."""
    rng = np.random.default_rng(3)
    out = np.tile(np.eye(4), (14, 1, 1))
    stretch = rng.uniform(0.5, 1.5, (14, 1, 3)) * np.sign(rng.uniform(-0.4, 1, (14, 1, 1)))
    out[:, :3, :3] = Rotation.random(14, random_state=3).as_matrix() * stretch
    out[:, :3, 3] = rng.uniform(-2, 2, (14, 3)) * [1, 1, 0.6]
    out[:, :3] *= scale
    out[:, :3, 3] += move
    return out


def reference(bean, matrices, renderer, pixels):
    """Return index (or -1) and distance along the ray for each pixel, in float64.

    Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
    """
    rays = [pixel_ray(renderer, x, y) for x, y in pixels]
    start, toward = (np.array(a)[:, None] for a in zip(*rays, strict=True))
    best, which = np.full(len(rays), np.inf), np.full(len(rays), -1)
    for i, matrix in enumerate(matrices):
        corners = (bean.points @ matrix[:3, :3].T + matrix[:3, 3])[bean.regular_faces]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.cross(toward, two)
        with np.errstate(divide='ignore', invalid='ignore'):
            scale = 1 / (across * one).sum(2)
            away = start - corners[:, 0]
            u = (away * across).sum(2) * scale
            other = np.cross(away, one)
            v = (toward * other).sum(2) * scale
            t = (two * other).sum(2) * scale
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        first = np.where(met, t, np.inf).min(1)
        which[first < best], best = i, np.minimum(best, first)
    return which, best


PIXELS = [(x, y) for x in range(3, SIZE[0], 11) for y in range(2, SIZE[1], 9)]
PLACES = {
    'here': ((0, 0, 0), 1.0, {}),
    'parallel': ((0, 0, 0), 1.0, {'parallel': 3.0}),
    'far from the origin': ((1e6, 5e6, 200.0), 1.0, {}),
    'tiny': ((0, 0, 0), 1e-6, {}),
    'huge': ((0, 0, 0), 1e6, {}),
}


def placed(move, scale, extra):
    camera = CAMERA | extra
    for key in ('eye', 'focus'):
        camera[key] = np.multiply(camera[key], scale) + move
    if 'parallel' in camera:
        camera['parallel'] *= scale
    return camera


@pytest.mark.parametrize(('move', 'scale', 'extra'), PLACES.values(), ids=PLACES)
def test_what_rays_find(scenes, see, bean, move, scale, extra):
    matrices = poses(move, scale)
    kwargs = {'size': SIZE, 'camera': placed(move, scale, extra), 'color': 'tan'}
    pl, things = scenes.instances(bean, matrices, **kwargs)
    see.grab(pl)
    which, away = reference(bean, matrices, pl.renderer, PIXELS)
    hits = [things.pick(x, y) for x, y in PIXELS]
    found = np.array([-1 if h is None else h.index for h in hits])
    assert len(set(which.tolist())) > 10
    # A ray along an outline may go either way.
    assert (found != which).mean() <= 0.01
    for hit, i, distance, pixel in zip(hits, which, away, PIXELS, strict=True):
        if hit is not None and hit.index == i:
            start, toward = pixel_ray(pl.renderer, *pixel)
            assert hit.distance == pytest.approx(distance, rel=1e-5, abs=1e-5 * scale)
            np.testing.assert_allclose(
                hit.point, start + distance * toward, rtol=1e-9, atol=1e-4 * scale
            )


@pytest.mark.parametrize('level', ['splat', 'parallax', 'blended', 'mesh'])
def test_every_instance_where_it_is_drawn(scenes, see, bean, level):
    """The pick does not depend on the level, and agrees with the picture."""
    matrices = poses()
    kwargs = {'size': SIZE, 'camera': CAMERA, 'lighting': False, 'color': 'white'}
    pl, things = scenes.instances(bean, matrices, level=level, **kwargs)
    pl.set_background('black')
    things.colors = np.array([[16 * (i + 1), 0, 0] for i in range(14)], np.uint8)
    picture = see.grab(pl)
    shown = np.rint(picture[..., 0] * 255 / 16).astype(int) - 1
    picked = np.array([[-1 if (h := things.pick(x, y)) is None else h.index for x, y in PIXELS]])
    drawn = np.array([[shown[SIZE[1] - 1 - y, x] for x, y in PIXELS]])
    assert (picked != drawn).mean() < (0.35 if level == 'splat' else 0.06)


def test_what_counts(scenes, see, bean):
    pl, things = scenes.instances(bean, poses(), size=SIZE, camera=CAMERA, color='tan')
    see.grab(pl)
    x, y = next(p for p in PIXELS if things.pick(*p) is not None)
    first = things.pick(x, y)
    assert pl.ibr.pick(x, y) == first
    things.update([first.index], visible=False)
    second = things.pick(x, y)
    assert second is None or second.index != first.index
    things.visible = True
    things.visibility = False
    assert things.pick(x, y) is None
    things.visibility = True
    things.pickable = False
    assert pl.ibr.pick(x, y) is None
    things.pickable = True
    things.remove()
    assert things.pick(x, y) is None


def test_picking_leaves_the_picture(scenes, see, bean):
    pl, things = scenes.instances(bean, poses(), size=SIZE, camera=CAMERA, color='tan')
    before = see.grab(pl)
    for x, y in PIXELS[:20]:
        things.pick(x, y)
    np.testing.assert_array_equal(see.grab(pl), before)
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)
    selector.SetArea(0, 0, SIZE[0] - 1, SIZE[1] - 1)
    selector.Select()
    np.testing.assert_array_equal(see.grab(pl), before)


def test_enable_mesh_picking(scenes, see, bean):
    """The mouse on a card gives the actor of an instance, which knows its index."""
    pl, things = scenes.instances(
        bean, poses(), size=SIZE, camera=CAMERA, level='mesh', color='tan'
    )
    assert things.instance_of(pv.Actor()) is None
    seen = []
    pl.enable_mesh_picking(seen.append, use_actor=True, show=False, show_message=False)
    see.grab(pl)
    x, y = next(p for p in PIXELS if things.pick(*p) is not None)
    pl.iren.interactor.SetEventInformation(x, y)
    pl.iren.picker.Pick(x, y, 0, pl.renderer)
    actor = pl.iren.picker.GetActor() or (seen[0] if seen else None)
    assert things.instance_of(actor) == things.pick(x, y).index
