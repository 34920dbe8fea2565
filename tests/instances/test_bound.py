"""The error bound holds from everywhere: outlines and coverage against the mesh, many samples."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.maths.image_error import crossed, displacements
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import SAMPLES, Stage, covered, mesh_actors
from tests.marks import slow

pytestmark = pytest.mark.all_sizes
#: Displacement beyond max_error: outlines are known to whole pixels.
SLACK = 0.5
VIEW_ANGLE, NARROW = 20.0, 8.0


def ring():
    """Return a thin ring."""
    return pv.ParametricTorus(ringradius=1.0, crosssectionradius=0.05, u_res=90, v_res=16)


def plate():
    """Return a flat plate."""
    return pv.Plane(i_size=2.0, j_size=1.4, i_resolution=20, j_resolution=20)


def views(mesh, size, count, rng):
    """Return cameras around a mesh, one in eight level with its ring, and the pixels of a side."""
    side = size + 16
    away = rng.normal(size=(count, 3))
    away[::8, 2] *= 0.1
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    angle = np.radians(VIEW_ANGLE / 2)
    radius = mesh.length / 2
    distance = radius / np.sin(np.arctan(np.tan(angle) * size / side))
    ups, shifts = rng.normal(size=(2, count, 3))
    focuses = np.array(mesh.center) + 0.5 * radius / size * shifts
    eyes = focuses + distance * away
    return side, [tuple(map(tuple, camera)) for camera in zip(eyes, focuses, ups, strict=True)]


def pictures(stage, cameras, coverage):
    """Return the coverage of a stage from each camera."""
    found = []
    for camera in cameras:
        stage.look(camera)
        stage.draw()
        found.append(coverage(stage))
    return found


def full(parts, poses, cameras, size, samples, bounds, angle=VIEW_ANGLE):
    """Return the coverage of meshes from each camera."""
    look = {'view_angle': angle, 'samples': samples, 'background': 'white'}
    with Stage(size, **look, multi_samples=0) as stage:
        stage.bounds = bounds
        empty = pictures(stage, cameras[:1], Stage.depth)[0]
        stage.add(mesh_actors([parts], poses, np.zeros(len(poses), int)))
        return pictures(stage, cameras, lambda s: covered(s.depth(), empty, samples))


def moved(drawn, truth):
    """Return the 99th percentile of the displacement of all outlines."""
    away = [displacements(*pair) for pair in zip(drawn, truth, strict=True)]
    return np.percentile(np.concatenate(away), 99)


def faded(drawn, truth):
    """Return the pixels by which each picture covers too much or too little, by its outlines'."""
    pairs = list(zip(drawn, truth, strict=True))
    lengths = [max(crossed(a).sum(), crossed(b).sum(), 1) for a, b in pairs]
    return np.array([abs(a.sum() - b.sum()) for a, b in pairs]) / lengths


def assert_bound(drawn, truth, own, max_error):
    """Outlines lie where those of the mesh lie, and nothing fades; or no worse than meshes."""
    assert moved(drawn, truth) <= max(max_error + SLACK, moved(own, truth))
    allowed = np.maximum(max_error / 2, faded(own, truth))
    assert np.mean(faded(drawn, truth) > allowed) <= 0.02
    sums = [np.sum(coverage) for coverage in (drawn, truth)]
    assert sums[0] == pytest.approx(sums[1], rel=0.05)


def check_from_everywhere(mesh, folder, count, seed):
    """Check that the bound holds for a mesh at several sizes."""
    rng, parts = np.random.default_rng(seed), as_parts(mesh)
    bounds = tuple(np.array(mesh.center).repeat(2) + np.tile([-1, 1], 3) * mesh.length / 2)
    for size in (12, 24, 48, 96):
        few = count if size < 30 else count // 3  # large pictures have many outlines each
        side, cameras = views(mesh, size, few, rng)
        truth, own = (
            full(parts, np.eye(4)[None], cameras, (side, side), n, bounds) for n in (SAMPLES, 1)
        )
        look = {'view_angle': VIEW_ANGLE, 'background': 'white'}
        with Stage((side, side), **look, multi_samples=0) as stage:
            stage.bounds = bounds
            things = stage.plotter.ibr.add_instances(
                parts, [[0, 0, 0]], bake=True, cache=folder, show_scalar_bar=False
            )
            for max_error in (1.0, 2.0):
                things.max_error = max_error
                assert_bound(pictures(stage, cameras, Stage.coverage), truth, own, max_error)


@pytest.mark.slow
@pytest.mark.parametrize('make', [slow(ring), plate])
def test_from_everywhere(atlases, make):
    check_from_everywhere(make(), atlases, 60, 150)


@pytest.mark.bench
@pytest.mark.parametrize('make', [ring, plate])
def test_from_a_thousand_places(atlases, make):
    check_from_everywhere(make(), atlases, 250, 151)


def test_a_field_seen_along_the_ground(atlases):
    rng, parts = np.random.default_rng(152), as_parts(ring())
    poses = np.tile(np.eye(4), (150, 1, 1))
    turns = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi, (150, 1)) * [0.0, 0.0, 1.0])
    poses[:, :3, :3] = turns.as_matrix() * rng.uniform(0.6, 1.4, (150, 1, 1))
    poses[:, :3, 3] = rng.uniform(-1, 1, (150, 3)) * [20, 20, 0]
    bounds = (-22.0, 22.0) * 3
    azimuths, rise = rng.uniform(0, 2 * np.pi, 4), np.radians(5.0)
    eyes = [
        tuple(60 * np.array([np.cos(a), np.sin(a), np.tan(rise)]) * np.cos(rise)) for a in azimuths
    ]
    cameras = [(eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) for eye in eyes]
    size = (300, 60)
    truth, own = (full(parts, poses, cameras, size, n, bounds, NARROW) for n in (SAMPLES, 1))
    with Stage(size, view_angle=NARROW, background='white', multi_samples=0) as stage:
        stage.bounds = bounds
        add = stage.plotter.ibr.add_instances
        things = add(parts, poses, bake=True, cache=atlases, show_scalar_bar=False)
        for max_error in (1.0, 2.0):
            things.max_error = max_error
            assert_bound(pictures(stage, cameras, Stage.coverage), truth, own, max_error)
