"""Meshes that poses mirror: lit and culled as their own mirror images, made by numpy."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Pose, Skeleton, Skin, Track
from tests import pictures
from tests.figures.makers import bend, morphs, worm

pytestmark = pytest.mark.sampled

MIRRORS = {'x': [-1.0, 1, 1], 'all': [-1.0, -1, -1], 'uneven': [1.0, 1, -0.7]}


def horn(seed=3):
    """A closed mesh without any symmetry, about 1 large."""
    rng = np.random.default_rng(seed)
    mesh = pv.Sphere(radius=0.5, theta_resolution=24, phi_resolution=24)
    bumps = rng.normal(size=(4, 3))
    points = np.asarray(mesh.points, float)
    mesh.points = points * (1 + 0.4 * np.cos(points @ bumps.T * 3).sum(1, keepdims=True) / 4)
    return mesh.compute_normals(split_vertices=False, auto_orient_normals=True)


def mirrored_figure(kind, scale):
    """A figure whose root mirrors it: one that is rigid, morphed or skinned."""
    mesh, rest = horn(), Pose([[0.0, 0, 0]], scale=[scale])
    bones = Skeleton([-1], rest)
    if kind == 'skinned':
        ones = np.ones((mesh.n_points, 1))
        skin = Skin([0], [np.eye(4)], ones.astype(int) * 0, ones)
        return Figure([FigureMesh(mesh, skin=skin)], bones)
    targets = morphs(mesh.n_points, 1) if kind == 'morphed' else None
    return Figure([FigureMesh(mesh, node=0, morphs=targets)], bones)


def mirror_image(scale, mesh=None):
    """The mesh scaled by numpy, faces wound so that they look outward."""
    mesh = horn() if mesh is None else mesh
    points = np.asarray(mesh.points, float) * scale
    normals = np.asarray(mesh.point_data.active_normals, float) / scale
    faces = mesh.regular_faces
    made = pv.PolyData.from_regular_faces(points, faces[:, ::-1] if np.prod(scale) < 0 else faces)
    made.point_data['Normals'] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    made.point_data.active_normals_name = 'Normals'
    return made


def stage():
    pl = pictures.plotter((160, 120), lighting='none')
    pl.add_light(pv.Light(position=(4, -3, 6), light_type='scene light'))
    return pl


def shot(pl):
    return pictures.shown(pictures.place(pl, (2.5, -2.0, 1.5)))


def apart(a, b):
    """Pixels that differ by more than two levels."""
    return int((np.abs(a - b).max(-1) > 2).sum())


@pytest.mark.parametrize('scale', MIRRORS.values(), ids=MIRRORS)
@pytest.mark.parametrize('kind', ['rigid', 'morphed', 'skinned'])
@pytest.mark.parametrize('culling', ['none', 'back', 'front'])
def test_it_is_lit_and_culled_as_its_mirror_image(kind, scale, culling):
    pl, plain = stage(), stage()
    look = {'color': 'tan', 'culling': culling, 'smooth_shading': True}
    pl.ibr.add_animated(mirrored_figure(kind, scale), **look)
    plain.add_mesh(mirror_image(scale), **look)
    ours, theirs = shot(pl), shot(plain)
    assert np.ptp(theirs) > 100
    assert apart(ours, theirs) <= 5


@pytest.mark.parametrize('kind', ['rigid', 'skinned'])
def test_the_sign_may_change_in_a_clip_and_by_the_place(kind):
    """Scale turns from 1 to -1 along x; the actor's own scale mirrors as well."""
    figure = mirrored_figure(kind, [1.0, 1, 1])
    turn = Clip('turn', [Track(0, 'scale', [0, 1], [[1, 1, 1], [-1, 1, 1]], 'step')])
    figure = Figure(figure.meshes, figure.skeleton, [turn])
    pl = stage()
    look = {'color': 'tan', 'culling': 'back', 'smooth_shading': True}
    actor = pl.ibr.add_animated(figure, clip='turn', **look)
    for time, place in ((0.0, [1, 1, 1]), (1.0, [1, 1, 1]), (1.0, [1, 1, -1]), (0.0, [1, -1, 1])):
        actor.scale = place
        actor.play('turn', loop=False, start=0.0)
        pl.ibr.time = time
        plain = stage()
        scale = np.array(place) * ([-1, 1, 1] if time else 1)
        plain.add_mesh(mirror_image(scale), **look)
        ours = shot(pl)
        assert apart(ours, shot(plain)) <= 5
        again = stage()
        again.add_mesh(actor.mesh(), **look)
        assert apart(ours, shot(again)) <= 5
        plain.close()
        again.close()


def test_one_mirrored_arm_turns_nothing_else():
    """What most of a skin does decides."""
    figure = worm()
    pose = bend(figure, 0.3)
    scale = np.array(pose.scale)
    scale[-1] *= [-1, 1, 1]
    world = figure.world(pose.replaced(scale=scale))
    assert not figure.meshes[0].mirrors(world)
    scale = np.array(pose.scale)
    scale[0] *= [-1, 1, 1]
    assert figure.meshes[0].mirrors(figure.world(pose.replaced(scale=scale)))


EFFECTS = {
    'maps': lambda: pvibr.Shadows(resolution=512),
    'volumes': lambda: pvibr.Shadows(method='volume'),
}


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=EFFECTS)
@pytest.mark.parametrize('kind', ['rigid', 'skinned'])
def test_shadows_of_mirrored_meshes(kind, effect):
    found = []
    look = {'color': 'tan', 'culling': 'back', 'smooth_shading': True}
    for as_mesh in (False, True):
        pl = stage()
        pl.add_mesh(pv.Plane(center=(0, 0, -0.7), i_size=4, j_size=4), color='white')
        if as_mesh:
            pl.add_mesh(mirror_image(MIRRORS['x']), **look)
        else:
            pl.ibr.add_animated(mirrored_figure(kind, MIRRORS['x']), **look)
        pl.ibr.add(effect())
        found.append(shot(pl))
    assert apart(*found) <= 10


@pytest.mark.parametrize('kind', ['rigid', 'skinned'])
@pytest.mark.parametrize('max_error', [0.05, 16.0], ids=['meshes', 'images'])
def test_crowds_of_mirrored_figures(kind, max_error):
    """Members mirror as well: with an even number of mirrors nothing is turned."""
    sides = [[1.0, 1, 1], [1, -1, 1]]
    poses = np.stack([np.diag([*side, 1.0]) for side in sides])
    poses[:, 0, 3] = -0.8, 0.8
    pl, plain = stage(), stage()
    look = {'color': 'tan', 'smooth_shading': True}
    pl.ibr.add_animated(
        mirrored_figure(kind, MIRRORS['x']), poses, max_error=max_error, cache=False, **look
    )
    for side, pose in zip(sides, poses, strict=True):
        mesh = mirror_image(np.array(side) * MIRRORS['x'])
        plain.add_mesh(mesh.translate(pose[:3, 3]), **look)
    ours, theirs = shot(pl), shot(plain)
    if max_error < 1:
        assert apart(ours, theirs) <= 5
    else:
        lit = (theirs.max(-1) > 60) & (ours.max(-1) > 60)
        assert abs(ours[lit].mean() - theirs[lit].mean()) <= 2


def test_what_is_picked_and_written_faces_outward(tmp_path):
    pl = stage()
    actor = pl.ibr.add_animated(mirrored_figure('rigid', MIRRORS['x']), color='tan')
    shot(pl)
    hit = actor.pick(80, 60)
    (mesh,) = actor.posed_meshes()
    assert hit is not None
    a, b, c = mesh.points[mesh.regular_faces[hit.cell]]
    assert np.cross(b - a, c - a) @ (np.array([2.5, -2.0, 1.5]) - a) > 0
    for found in (mesh, actor.mesh(), actor.figure.mesh()):
        assert found.volume > 0
        assert _signed(found) > 0
    plain = pl.ibr.to_plain_plotter()
    (baked,) = [a for a in plain.actors.values() if a.mapper is not None]
    assert _signed(baked.mapper.dataset.extract_surface(algorithm=None)) > 0


def _signed(mesh):
    corners = np.asarray(mesh.points, float)[mesh.regular_faces]
    return np.einsum('ij,ij->i', corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
