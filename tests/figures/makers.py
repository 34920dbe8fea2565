"""Small figures for tests: a bending tube, and what deforms it."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Morphs, Pose, Skeleton, Skin, Track
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.maths.quaternions import from_axis_angle

JOINTS = 5


def tube(offset=0.0, k=4):
    """A closed tube along z, 4 long, of 1 400 vertices."""
    mesh = pv.Capsule(center=(0, 0, 0), direction=(0, 0, 1), radius=0.4, cylinder_length=3.2)
    mesh = mesh.triangulate().clean().subdivide(1)
    mesh = mesh.compute_normals(cell_normals=False, split_vertices=False)
    points = np.asarray(mesh.points, float)
    mesh['height'] = points[:, 2]
    mesh.points = points + offset
    return mesh


def skeleton(offset=0.0):
    rest = np.tile(np.eye(4), (JOINTS, 1, 1))
    rest[0, :3, 3] = np.array([0, 0, -2.0]) + offset
    rest[1:, 2, 3] = 1.0
    return Skeleton(np.arange(JOINTS) - 1, rest)


def skin(mesh, bones, k=4):
    joints = bones.world(bones.rest)[:, :3, 3]
    apart = np.abs(mesh.points[:, 2:] - joints[:, 2])
    nearest = np.argsort(apart, axis=1)[:, :k]
    weights = np.exp(-3 * np.take_along_axis(apart, nearest, 1) ** 2)
    return Skin(np.arange(JOINTS), np.linalg.inv(bones.world(bones.rest)), nearest, weights)


def morphs(n_points, n=3, seed=0):
    rng = np.random.default_rng(seed)
    shapes = 0.1 * rng.normal(size=(n, n_points, 3))
    return Morphs(shapes, normals=0.1 * rng.normal(size=(n, n_points, 3)))


def worm(offset=0.0, k=4, n_morphs=0, clips=()):
    """A tube on a chain of joints."""
    mesh, bones = tube(offset), skeleton(offset)
    targets = morphs(mesh.n_points, n_morphs) if n_morphs else None
    body = FigureMesh(mesh, skin=skin(mesh, bones, k), morphs=targets)
    return Figure([body], bones, clips)


def bend(figure, angle, move=0.0, stretch=1.1, weights=None):
    """A pose: each joint bends by an angle, the third twists, and they stretch."""
    rest = figure.skeleton.rest
    rotation = from_axis_angle([[1.0, 0, 0]] * JOINTS, np.full(JOINTS, angle))
    rotation[2] = from_axis_angle([0, 0, 1.0], 2 * angle)
    scale = rest.scale * np.linspace(1, stretch, JOINTS)[:, None]
    translation = rest.translation.copy()
    translation[0] += move
    weights = figure.rest.weights if weights is None else weights
    return Pose(translation, rotation, scale, weights)


def bending(seconds=2.0):
    """A clip: the second joint swings by a right angle."""
    turns = from_axis_angle([[1.0, 0, 0]] * 3, [0.0, np.pi / 2, 0.0])
    return Clip('bend', [Track(1, 'rotation', [0, seconds / 2, seconds], turns)])


def growing(n=6, interpolation='linear'):
    """A sphere of key frames that grows and turns into an ellipsoid."""
    mesh = pv.Sphere(theta_resolution=16, phi_resolution=16)
    points = np.asarray(mesh.points, float)
    positions = np.stack([points * [1, 1, 1 + 0.3 * i] + [0, 0, 0.2 * i] for i in range(n)])
    frames = VertexAnimation(np.arange(float(n)), positions, None, interpolation)
    return Figure([FigureMesh(mesh, frames=frames)])
