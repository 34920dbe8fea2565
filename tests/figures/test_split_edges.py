"""Sharp edges of meshes that move are split as those of any mesh, and move as before."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import FigureMesh, Morphs, Pose, Skeleton, Skin
from pvibr.animation.correctives import Correctives, PoseSpace
from pvibr.animation.splitting import split_figure
from pvibr.animation.vertex_animation import VertexAnimation

SPLIT = {'smooth_shading': True, 'split_sharp_edges': True}


def prism(seed=3):
    """A closed prism of shared points: five sides with edges of 72 degrees, and two ends."""
    mesh = pv.Cylinder(resolution=5, height=2, direction=(0, 0, 1)).triangulate().clean()
    mesh.points += np.random.default_rng(seed).normal(0, 0.02, mesh.points.shape)
    mesh.clear_data()
    return mesh


def deformed(kind):
    """Return a figure of a prism, a pose of it, and its own keywords."""
    mesh = prism()
    n = mesh.n_points
    rng = np.random.default_rng(11)
    moved = 0.3 * rng.normal(size=(n, 3))
    if kind == 'frames':
        points = np.asarray(mesh.points, float)
        frames = VertexAnimation([0.0, 1.0], np.stack([points, points + moved]))
        figure = Figure([FigureMesh(mesh, frames=frames)])
        return figure, figure.rest.replaced(time=1.0)
    if kind in ('dense', 'sparse'):
        some = rng.permutation(n)[: n // 2]
        shape = moved if kind == 'dense' else (some, moved[some])
        morphs = Morphs([shape]).with_normals(mesh)
        figure = Figure([FigureMesh(mesh, morphs=morphs)])
        return figure, figure.rest.replaced(weights=[1.0])
    bones = Skeleton([-1, 0], Pose([[0, 0, -1.0], [0, 0, 1.0]]))
    weights = np.stack([1 - mesh.points[:, 2], 1 + mesh.points[:, 2]], 1).clip(0.01)
    bind = np.linalg.inv(bones.world(bones.rest))
    skin = Skin([0, 1], bind, np.tile([0, 1], (n, 1)), weights)
    turned = [[1.0, 0, 0, 0], [np.cos(0.4), 0, np.sin(0.4), 0]]
    pose = Pose(bones.rest.translation, turned)
    space = PoseSpace([1], Pose(bones.rest.translation[None], [turned]), bones.rest)
    shape = Correctives(space, {0: Morphs([0.3 * moved]).with_normals(mesh)})
    return Figure([FigureMesh(mesh, skin=skin)], bones, correctives=shape), pose


def shot(add):
    pl = pv.Plotter(off_screen=True, window_size=(96, 72), lighting='none')
    pl.add_light(pv.Light(position=(3, 2, 5)))
    pl.enable_parallel_projection()
    add(pl)
    pl.camera_position = [(4, 5, 3), (0, 0, 0), (0, 0, 1)]
    pl.camera.parallel_scale = 1.6
    pl.show(auto_close=False)
    image = pl.screenshot(return_img=True).astype(int)
    pl.close()
    return image


@pytest.mark.parametrize('kind', ['frames', 'dense', 'sparse', 'skin'])
def test_it_looks_as_the_posed_mesh_split_by_pyvista(kind):
    figure, pose = deformed(kind)

    def add(pl, **look):
        actor = pl.ibr.add_animated(figure, color='tan', **look)
        actor.pose = pose
        split = actor.figure.meshes[0].mesh.n_points > figure.meshes[0].mesh.n_points
        assert split == look['split_sharp_edges']

    at_rest = figure.mesh(pose=figure.rest)
    flat = at_rest.compute_normals(cell_normals=False, split_vertices=True)
    posed = figure.mesh(pose=pose)
    # PyVista splits where the rest is sharp: it has no other pose.
    expected = flat.copy()
    expected.points = posed.points[flat['pyvistaOriginalPointIds']]
    expected = expected.compute_normals(cell_normals=False, split_vertices=False)
    want = shot(lambda pl: pl.add_mesh(expected, color='tan', smooth_shading=True))
    found = shot(lambda pl: add(pl, **SPLIT))
    smooth = shot(lambda pl: add(pl, smooth_shading=True, split_sharp_edges=False))
    # Joints blend normals by the vertices of rest, polygons know only where they are now.
    unsplit = np.abs(smooth - want).mean()
    assert unsplit > 4
    assert np.abs(found - want).mean() < (0.5 if kind == 'skin' else 0.01) * unsplit


def test_a_theme_splits_edges():
    figure, pose = deformed('dense')
    theme = pv.themes.DocumentTheme()
    theme.split_sharp_edges = theme.smooth_shading = True
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    actor = pl.ibr.add_animated(figure, theme=theme)
    plain = pl.ibr.add_animated(figure, theme=theme, split_sharp_edges=False)
    actor.pose = pose
    pl.show(auto_close=False)
    assert plain.figure is figure
    assert actor.figure is not figure
    for _, points, normals in actor.download_posed():
        expected = actor.figure.posed(0, actor.pose)
        assert np.abs(points - expected[0]).max() < 1e-5
        assert np.abs(normals - expected[1]).max() < 1e-5
    # Every point of the split one is one of the other's.
    apart = actor.mesh().points[:, None] - figure.mesh(pose=pose).points[None]
    assert np.linalg.norm(apart, axis=-1).min(1).max() < 1e-6
    pl.close()


def test_edges_below_the_angle_stay():
    figure, _ = deformed('skin')
    assert split_figure(figure, [170.0]) is figure
    assert split_figure(figure, [None]) is figure


def test_colours_follow_split_points():
    mesh = prism()
    mesh['height'] = mesh.points[:, 2]
    figure = Figure([FigureMesh(mesh, morphs=Morphs([np.ones((mesh.n_points, 3))]))])
    split = split_figure(figure, [30.0]).meshes[0].mesh
    assert np.array_equal(split['height'], split.points[:, 2])


def test_members_of_a_crowd_are_split():
    figure, _ = deformed('skin')
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    crowd = pl.ibr.add_animated(figure, [[0.0, 0, 0], [3, 0, 0]], cache=False, **SPLIT)
    pl.show(auto_close=False)
    assert crowd.mesh(0).n_points > figure.meshes[0].mesh.n_points
    pl.close()
