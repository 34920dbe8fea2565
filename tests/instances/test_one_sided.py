"""Closed surfaces are drawn without the side that nobody sees: the picture stays as it is."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.instances.one_sided import OneSided
from tests.instances.test_enclosing_surfaces import eight as figure_eight

SIZE = (120, 90)
CAMERA = {'eye': (7, -8, 6), 'focus': (0, 0, 0), 'angle': 32}
INSIDE = {'eye': (-1.8, -1.8, 0.05), 'focus': (1, 1, 0), 'angle': 60}


def lobes(sides=24):
    """Return a closed surface, not convex, wound outward."""
    ball = pv.Sphere(radius=0.8, theta_resolution=sides, phi_resolution=2 * sides // 3)
    ball.clear_data()
    ball.points *= 1 + 0.3 * np.sin(5 * np.array(ball.points)).prod(1)[:, None]
    return ball


def apart():
    """Return it as triangles that share no points, as STL files have them."""
    ball = lobes()
    points = np.array(ball.points)[ball.regular_faces].reshape(-1, 3)
    return pv.PolyData.from_regular_faces(points, np.arange(len(points)).reshape(-1, 3))


def eight():
    """Return a closed tube around x whose section is an eight: one loop is wound inward."""
    points, faces = figure_eight(0.7)
    return pv.PolyData.from_regular_faces(np.roll(points, 1, 1) * 0.3, faces)


MESHES = {
    'outward': (lobes(), 'back'),
    'inward': (lobes().flip_faces(), 'front'),
    'apart': (apart(), 'back'),
    'eight': (eight(), 'none'),
    'open': (lobes().extract_cells(np.arange(600)).extract_surface(algorithm=None), 'none'),
}


def poses(mirrored=False):
    rng = np.random.default_rng(3)
    out = np.tile(np.eye(4), (9, 1, 1))
    out[:, :3, :3] = Rotation.random(9, random_state=3).as_matrix()
    out[:, :3, :3] *= rng.uniform(0.7, 1.3, (9, 1, 1))
    out[4, :3, 0] *= -1 if mirrored else 1
    i, j = np.divmod(np.arange(9), 3)
    out[:, :2, 3] = 1.8 * np.stack([i - 1, j - 1], 1)
    return out


def culling(things) -> str:
    """Return the sides that are culled, of all that is drawn."""
    near = things.groups[0].near
    actors = [a for group in near.pools[0].lent.values() for a in group]
    if not near.has_own_actors[0]:
        actors = near.draws[0].actors()
    return '/'.join(sorted({_culled(actor.GetProperty()) for actor in actors}))


def _culled(prop) -> str:
    kinds = {(0, 0): 'none', (1, 0): 'back', (0, 1): 'front'}
    return kinds[prop.GetBackfaceCulling(), prop.GetFrontfaceCulling()]


@pytest.fixture
def drawn(scenes, see, monkeypatch):
    """Assert that the picture is that of both sides; return which side was culled."""
    material = OneSided.material

    def picture(mesh, camera, change, mirrored, look):
        how = {'size': SIZE, 'camera': camera, 'color': 'tan', **look}
        pl, things = scenes.instances(mesh, poses(mirrored), bake=False, **how)
        see.grab(pl)
        if change:
            change(pl, things)
        return see.grab(pl), culling(things)

    def draw(mesh, camera=CAMERA, change=None, *, mirrored=False, **look):
        shown, found = picture(mesh, camera, change, mirrored, look)
        with monkeypatch.context() as patch:
            patch.setattr(OneSided, 'material', lambda self, _: material(self, False))
            truth, asked = picture(mesh, camera, change, mirrored, look)
        assert asked == look.get('culling', 'none')
        assert np.ptp(truth) > 0.2
        # At outlines both sides may have the same depth, in the buffer's steps.
        assert (shown != truth).any(2).mean() <= 1e-3
        return found

    return draw


@pytest.mark.parametrize('name', MESHES)
def test_the_picture_is_that_of_both_sides(drawn, name):
    mesh, side = MESHES[name]
    assert drawn(mesh) == side


def test_smooth_and_parallel(drawn):
    def change(pl, _things):
        pl.enable_parallel_projection()

    assert drawn(lobes(), change=change, smooth_shading=True, specular=0.5) == 'back'


def test_what_is_looked_into_has_both_sides(drawn):
    assert drawn(lobes(), camera=INSIDE) == 'none'
    assert drawn(lobes(), mirrored=True) == 'none'
    assert drawn(lobes(), opacity=0.5) == 'none'
    assert drawn(lobes(), culling='front') == 'front'


def test_heavy_ones_are_judged_one_by_one(drawn):
    """Only that around the eye has both sides; levels of too many triangles for a draw of many."""
    heavy = lobes(100)
    assert drawn(heavy) == 'back'
    assert drawn(heavy, camera=INSIDE) == 'back/none'
    assert drawn(heavy, mirrored=True) == 'back/none'
    assert drawn(heavy, opacity=0.5) == 'none'


def test_changes_of_the_material_are_followed(drawn):
    def paint(_pl, things):
        things.prop.color = 'red'

    def fade(_pl, things):
        things.prop.opacity = 0.5

    assert drawn(lobes(), change=paint) == 'back'
    assert drawn(lobes(), change=fade) == 'none'


def test_a_mirrored_camera_sees_the_other_side(drawn):
    def change(pl, _things):
        pl.camera.SetExplicitProjectionTransformMatrix(_flipped(pl))
        pl.camera.UseExplicitProjectionTransformMatrixOn()

    assert drawn(lobes(), change=change) == 'none'


def _flipped(pl):
    matrix = pl.camera.GetProjectionTransformMatrix(SIZE[0] / SIZE[1], -1, 1)
    for column in range(4):
        matrix.SetElement(0, column, -matrix.GetElement(0, column))
    return matrix


@pytest.mark.parametrize('mesh', [pv.Line(resolution=9).strip(), pv.PolyData(np.eye(3))])
def test_lines_and_points_have_no_side(mesh):
    """Without a triangle the set was switched off, and only a first script drew one."""
    pl = pv.Plotter(off_screen=True, window_size=(80, 60))
    lines = pl.ibr.add_instances(mesh, np.eye(3) * 3, line_width=3)
    picture = pl.screenshot()
    assert lines.enabled
    assert (picture != picture[0, 0]).any()
