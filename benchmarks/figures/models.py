"""Figures of any size for the bench: a tube on a chain of joints, and what else deforms it."""

from __future__ import annotations

import numpy as np

from pvibr.animation.clip import Clip, Track
from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.morphs import Morphs
from pvibr.animation.pose import Pose
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.maths.quaternions import from_axis_angle

LENGTH, RADIUS = 8.0, 0.6
#: Duration of the clip, seconds.
SECONDS = 2.0


def tube(rings, around, joints, *, offset=0.0, morphs=None, look=None, every=1) -> Figure:
    """Return a tube along z on a chain of joints that sways and twists, with four weights each."""
    points, faces = _grid(rings, around)
    bone = LENGTH / joints
    rest = np.zeros((joints, 3))
    rest[1:, 2] = bone
    rest[0] = offset
    apart = np.abs(points[:, 2:] - bone * np.arange(joints)) / bone
    nearest = np.argsort(apart, axis=1, kind='stable')[:, : min(4, joints)]
    weights = np.exp(-(np.take_along_axis(apart, nearest, 1) ** 2))
    return Figure.from_arrays(
        points + offset,
        faces[::every],
        nearest,
        weights,
        np.arange(joints) - 1,
        Pose(rest),
        normals=points * [1 / RADIUS, 1 / RADIUS, 0],
        morphs=morphs,
        look=look,
        clips=[swaying(joints)],
    )


def swaying(joints) -> Clip:
    """Return a clip in which a chain bends by a right angle in all, and twists."""
    bend = np.pi / 2 / joints
    turns = from_axis_angle([[1.0, 0, 0.4]] * 3, [-bend, bend, -bend])
    times = np.array([0, SECONDS / 2, SECONDS])
    return Clip('sway', [Track(joint, 'rotation', times, turns) for joint in range(joints)])


def targets(n, points, seed=0) -> Morphs:
    """Return morph targets that move every vertex, with normals."""
    rng = np.random.default_rng(seed)
    moves = [0.02 * rng.normal(size=(points, 3)).astype(np.float32) for _ in range(n)]
    return Morphs(moves, normals=moves)


def swelling(rings, around, *, offset=0.0, frames=5) -> Figure:
    """Return a tube of key frames that swells and shears."""
    points, faces = _grid(rings, around)
    shapes = []
    for share in np.linspace(0, 1, frames):
        shape = points * [1 + share, 1 - 0.5 * share, 1]
        shape[:, 0] += share * np.sin(points[:, 2])
        shapes.append(shape + offset)
    still = Figure.from_arrays(shapes[0], faces)
    times = 0.5 * np.arange(frames)
    moves = VertexAnimation(times, np.stack(shapes), None, 'linear')
    body = FigureMesh(still.meshes[0].mesh, frames=moves)
    return Figure([body], clips=[Clip('swell', [], times[-1])])


def _grid(rings, around):
    """Return points (rings * around, 3) of a tube along z, and its triangles."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    circle = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle)], 1)
    height = np.linspace(0, LENGTH, rings)
    points = np.column_stack([np.tile(circle, (rings, 1)), np.repeat(height, around)])
    low = np.arange(around) + around * np.arange(rings - 1)[:, None]
    next_ = (np.arange(around) + 1) % around + around * np.arange(rings - 1)[:, None]
    faces = np.stack([low, next_, next_ + around, low, next_ + around, low + around], -1)
    return points, faces.reshape(-1, 3)
