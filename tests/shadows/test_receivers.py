"""What receivers of shadows are told of a light's views, and how they read maps."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.common.light_scenes import light_at
from pvibr.maths.views import look_along, orthographic, perspective
from pvibr.shadows import shadows
from pvibr.shadows.shadow_maps import in_shader


@pytest.mark.parametrize('parallel', [True, False])
@pytest.mark.parametrize('seed', [1, 2])
def test_views_are_told_as_their_matrices_have_it(parallel, seed):
    rng = np.random.default_rng(seed)
    at, ahead = rng.normal(size=3), rng.normal(size=3)
    if parallel:
        axes = look_along((0, 0, 0), ahead)[:3, :3]
        view = orthographic(axes, axes @ at - [1, 2, 9], axes @ at + [2, 1, 1])
    else:
        view = perspective(at, ahead, 0.7, 0.2, 12.0)
    world_from_view = np.linalg.inv(look_along(rng.normal(size=3), rng.normal(size=3)))
    eye_from_world = np.linalg.inv(world_from_view)
    back = -view.view_from_world[2, :3]
    toward = -eye_from_world[:3, :3] @ back
    x, y, z, last = in_shader(view, world_from_view).T
    matrix = view.texture_from_world() @ world_from_view
    normal = rng.normal(size=3)
    light = eye_from_world @ [*at, 1]
    for point in rng.normal(size=(5, 3)) + toward * -3 + light[:3]:
        q = matrix @ [*point, 1]
        if parallel:
            place = [point @ x[:3] * x[3] + z[0], point @ y[:3] * y[3] + z[1]]
            place.append(-(point @ toward) * z[2] + z[3])
            slope = np.array([x[:3] @ normal / x[3], y[:3] @ normal / y[3]]) * z[2]
            slope /= normal @ toward
        else:
            off = point - light[:3]
            w = z[:3] @ off
            place = [0.5 + x[:3] @ off / w, 0.5 + y[:3] @ off / w, y[3] + z[3] / w]
            slope = np.array([x[:3] @ normal, y[:3] @ normal]) * -z[3] / x[3] ** 2
            slope /= normal @ -off
        np.testing.assert_allclose(place, q[:3] / q[3], atol=1e-9)
        # A step on the plane changes depth as the slopes say.
        step = np.cross(normal, rng.normal(size=3)) * 1e-6
        moved = matrix @ [*(point + step), 1]
        change = moved[:3] / moved[3] - q[:3] / q[3]
        assert change[2] == pytest.approx(slope @ change[:2], rel=1e-3)
    assert tuple(last[:2]) == (view.near, view.far)


def test_four_texels_at_once_are_those_one_by_one(monkeypatch):
    pl = pv.Plotter(off_screen=True, window_size=(120, 90), lighting='none')
    pl.add_light(pv.Light(position=(1, 2, 3), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=9, j_size=9), color='white')
    pl.add_mesh(pv.Sphere(center=(0, 0, 1)), color='white')
    pl.ibr.add(pvibr.Shadows(resolution=64))
    pl.show(auto_close=False)
    found = [pl.screenshot()]
    monkeypatch.setattr(shadows, '_GATHER', '//VTK::System::Dec\n')
    shadows.receiver_feature.cache_clear()
    pl.camera.Modified()
    pl.render()
    found.append(pl.screenshot())
    shadows.receiver_feature.cache_clear()
    assert np.ptp(found[0].astype(int), axis=(0, 1)).max() > 100
    assert np.abs(found[0].astype(int) - found[1]).max() <= 1


@pytest.mark.parametrize('away', [3.0, 0.4, 0.15])
def test_a_lamp_near_a_billboard_lights_it(away):
    pl = pv.Plotter(off_screen=True, window_size=(60, 60), lighting='none')
    pl.add_light(light_at((0, -away, 0.2), (0, 0, 0.2), cone=90.0))
    image = np.full((8, 8, 4), 255, np.uint8)
    pl.ibr.add_billboards([(0, 0, 0)], image, size=2.0, lighting=True)
    pl.camera_position = [(0, -6, 2), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    lit = pl.screenshot(return_img=True)[30, 30].astype(int)
    pl.ibr.add(pvibr.Shadows())
    pl.render()
    shadowed = pl.screenshot(return_img=True)[30, 30]
    assert lit.min() > 50
    assert np.abs(shadowed - lit).max() <= 1
