"""Key-frame animation of meshes."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation.keyframes import SLOTS
from pvibr.animation.vertex_animation import VertexAnimation
from tests.animation.conftest import refused


def swelling(period=None, interpolation='linear'):
    """A sphere whose radius is 1, 2, 4 at 0, 1, 3 seconds."""
    meshes = [pv.Sphere(radius=r, theta_resolution=8, phi_resolution=6) for r in (1, 2, 4)]
    return meshes, VertexAnimation.from_meshes(meshes, [0.0, 1.0, 3.0], interpolation, period)


@pytest.mark.parametrize('interpolation', ['step', 'linear', 'quadratic', 'cubic'])
def test_frames_are_shown_at_their_times(interpolation):
    meshes, frames = swelling(interpolation=interpolation)
    points, normals = frames.sample(frames.times)
    np.testing.assert_allclose(points, [mesh.points for mesh in meshes], atol=1e-6)
    np.testing.assert_allclose(normals, [mesh.active_normals for mesh in meshes], atol=1e-6)
    assert frames.at(0.5)[0].shape == (SLOTS[interpolation],)


@given(st.floats(-5, 8))
def test_a_sphere_stays_a_sphere(time):
    points, normals = swelling()[1].sample(time)
    radius = np.interp(time, [0, 1, 3], [1, 2, 4])
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), radius, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_it_begins_again_after_the_period():
    _, frames = swelling(period=4.0)
    np.testing.assert_allclose(frames.sample(3.5)[0], frames.positions[0] * 2.5)
    np.testing.assert_array_equal(frames.sample(0.25)[0], frames.sample(8.25)[0])
    assert (frames.duration, swelling()[1].duration) == (4, 3)


def test_normals_are_blended_and_made_one_long():
    frames = VertexAnimation([0, 1], np.zeros((2, 1, 3)), [[[1, 0, 0]], [[0, 1, 0]]])
    np.testing.assert_allclose(frames.sample(0.5)[1], [[np.sqrt(0.5), np.sqrt(0.5), 0]])


def test_many_times_are_one_call():
    _, frames = swelling(period=4.0)
    times = np.linspace(-3, 9, 24).reshape(4, 6)
    whole = frames.sample(times)[0]
    assert whole.shape == (4, 6, frames.n_points, 3)
    np.testing.assert_array_equal(whole[2, 3], frames.sample(times[2, 3])[0])


def test_a_file_stays_a_file(tmp_path):
    np.save(tmp_path / 'frames.npy', np.ones((4, 5, 3), np.float32))
    frames = VertexAnimation(np.arange(4), np.load(tmp_path / 'frames.npy', mmap_mode='r'))
    assert isinstance(frames.positions.base, np.memmap)
    assert frames.positions.dtype == np.float32
    assert frames.sample(0.5)[0].dtype == np.float64


def test_bad_input_is_named():
    sphere = pv.Sphere()
    with pytest.raises(ValueError, match=r'meshes\[1\] must have \d+ points.* got 8'):
        VertexAnimation.from_meshes([sphere, pv.Cube().clean()])
    turned = sphere.copy()
    turned.flip_faces(inplace=True)
    with pytest.raises(ValueError, match=r'meshes\[2\] must have the faces of meshes\[0\]'):
        VertexAnimation.from_meshes([sphere, sphere, turned])
    refused('at least one mesh', VertexAnimation.from_meshes, [])
    with pytest.raises(ValueError, match=r'positions must have shape .* got \(2, 4\)'):
        VertexAnimation([0, 1], np.zeros((2, 4)))
    with pytest.raises(ValueError, match=r'normals must have shape \(2, 4, 3\)'):
        VertexAnimation([0, 1], np.zeros((2, 4, 3)), np.zeros((2, 5, 3)))
    refused(
        r'times must increase, got 0.0 after 1.0 at times\[1\]',
        VertexAnimation,
        [1, 0],
        np.zeros((2, 4, 3)),
    )
    with pytest.raises(ValueError, match=r'positions\[1\]\[0, 0\].* finite'):
        VertexAnimation([0, 1], [np.zeros((1, 3)), np.full((1, 3), np.nan)])
    refused('interpolation must', VertexAnimation, [0, 1], np.zeros((2, 4, 3)), None, 'septic')
    refused(r'period must .*got 0\.5', VertexAnimation, [0, 1], np.zeros((2, 4, 3)), period=0.5)
