"""Shadows hold still in flight: no floor point jumps where views of a light change."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.makers import MATT
from tests.pictures import plotter

SIZE = (120, 90)
SUN = np.array([1.0, -0.5, 2.0])


def floor_points(pl):
    """Return where the rays of pixels meet the floor z = 0, (h, w, 2)."""
    camera, (width, height) = pl.camera, SIZE
    matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
    elements = [[matrix.GetElement(i, j) for j in range(4)] for i in range(4)]
    inverse = np.linalg.inv(elements)
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    ends = []
    x, y = np.meshgrid(x, y)
    for z in (-1.0, 1.0):
        clip = np.stack([x, y, np.full_like(x, z)], -1)
        ends.append(clip @ inverse[:, :3].T + inverse[:, 3])
    near, far = (e[..., :3] / e[..., 3:] for e in ends)
    return (near - (far - near) * (near / (far - near))[..., 2:])[..., :2]


@pytest.mark.parametrize('kind', ['sun', 'lamp'])
def test_no_floor_point_jumps_in_flight(kind):
    """Squares over a wide floor: what is well inside or outside of their shadows."""
    pl = plotter(SIZE, lighting='none')
    light = pv.Light(position=tuple(300 * SUN), light_type='scene light')
    light.positional, light.cone_angle = kind == 'lamp', 80
    pl.add_light(light)
    pl.add_mesh(pv.Plane(i_size=1000, j_size=1000), **MATT)
    places = np.stack(np.meshgrid([-6, 0, 6], [-6, 0, 6, 40, 300]), -1).reshape(-1, 2)
    for x, y in places:
        pl.add_mesh(pv.Plane(center=(x, y, 1.0), i_size=2, j_size=2), **MATT)
    shadows = pl.ibr.add(pvibr.Shadows())
    pl.show(auto_close=False)
    views, wrong, judged = set(), np.zeros(2), np.zeros(2)
    for t in np.linspace(0, 1, 24):
        eye = np.array([60 * (1 - t) ** 2 + 2, -160 * (1 - t) ** 3 - 3, 90 * (1 - t) ** 3 + 2])
        turn = np.array([4 * np.sin(9 * t), 8 * t, 0.0])
        pl.camera_position = [eye, turn, (0, 0, 1)]
        pl.reset_camera_clipping_range()
        pl.render()
        lit = pl.screenshot().astype(float)[..., 0]
        views.add(len(shadows.views_of(light)))
        points = floor_points(pl)
        ray = SUN[:2] / SUN[2] if kind == 'sun' else None
        at = points + ray if kind == 'sun' else points + (300 * SUN[:2] - points) / (300 * SUN[2])
        away = np.abs(at[..., None, :] - places).max(-1).min(-1) - 1.0
        # Beyond pixels beside edges, and where a square is in between the eye and the floor.
        size = 2 * np.abs(np.gradient(points, axis=(0, 1))).max((0, -1))
        seen = eye + (np.dstack([points, 0 * points[..., :1]]) - eye) * ((eye[2] - 1) / eye[2])
        clear = np.abs(seen[..., None, :2] - places).max(-1).min(-1) > 1 + size
        floor = clear & (np.abs(points).max(-1) < 400) & (points[..., 1] > eye[1])
        for inside, sure in ((True, away < -size), (False, away > size)):
            found = lit[floor & sure]
            judged[int(inside)] += found.size
            wrong[int(inside)] += ((found < 60) != inside).sum()
    assert len(views) > 1
    assert judged[0] > 50_000
    assert judged[1] > 1000
    assert (wrong <= 5e-4 * judged).all()
