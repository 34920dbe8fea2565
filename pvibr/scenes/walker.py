"""A walking or waving person made of capsules on a skeleton, for crowds."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.animation.clip import Clip, Track
from pvibr.animation.figure import Figure
from pvibr.maths.quaternions import from_axis_angle

# Joint: parent, position in metres; x is left, y front, z up.
_JOINTS = {
    'pelvis': (None, (0.0, 0.0, 0.95)),
    'chest': ('pelvis', (0.0, 0.0, 1.15)),
    'head': ('chest', (0.0, 0.0, 1.52)),
    'left arm': ('chest', (0.23, 0.0, 1.42)),
    'left hand': ('left arm', (0.26, 0.0, 1.14)),
    'right arm': ('chest', (-0.23, 0.0, 1.42)),
    'right hand': ('right arm', (-0.26, 0.0, 1.14)),
    'left leg': ('pelvis', (0.1, 0.0, 0.9)),
    'left foot': ('left leg', (0.11, 0.02, 0.48)),
    'right leg': ('pelvis', (-0.1, 0.0, 0.9)),
    'right foot': ('right leg', (-0.11, 0.02, 0.48)),
}
# Capsule: from, to, radius, colour.
_LIMBS = {
    'pelvis': ((-0.06, 0, 0.95), (0.06, 0, 0.95), 0.13, (60, 65, 85)),
    'chest': ((0, 0, 1.1), (0, 0, 1.35), 0.16, (255, 255, 255)),
    'head': ((0, 0.01, 1.62), (0, 0.01, 1.68), 0.1, (226, 180, 150)),
    'left arm': ((0.23, 0, 1.42), (0.26, 0, 1.16), 0.06, (255, 255, 255)),
    'left hand': ((0.26, 0, 1.14), (0.27, 0.05, 0.9), 0.045, (226, 180, 150)),
    'right arm': ((-0.23, 0, 1.42), (-0.26, 0, 1.16), 0.06, (255, 255, 255)),
    'right hand': ((-0.26, 0, 1.14), (-0.27, 0.05, 0.9), 0.045, (226, 180, 150)),
    'left leg': ((0.1, 0, 0.88), (0.11, 0.02, 0.5), 0.085, (60, 65, 85)),
    'left foot': ((0.11, 0.02, 0.48), (0.11, 0, 0.08), 0.06, (60, 65, 85)),
    'right leg': ((-0.1, 0, 0.88), (-0.11, 0.02, 0.5), 0.085, (60, 65, 85)),
    'right foot': ((-0.11, 0.02, 0.48), (-0.11, 0, 0.08), 0.06, (60, 65, 85)),
}
_NAMES = list(_JOINTS)


def walker(triangles=5000) -> Figure:
    """Return a person 1.8 m tall, facing y, with the clips 'Walk' and 'Wave'."""
    if triangles < 300:
        raise ValueError(f'triangles must be 300 or more, got {triangles}')
    capsule_sides = max(4, int((triangles / len(_LIMBS)) ** 0.5))
    meshes = [_capsule(*limb[:3], capsule_sides) for limb in _LIMBS.values()]
    point_counts = [m.n_points for m in meshes]
    joints = np.repeat([_NAMES.index(name) for name in _LIMBS], point_counts)
    colors = np.repeat([limb[3] for limb in _LIMBS.values()], point_counts, axis=0)
    mesh = pv.merge(meshes, merge_points=False)
    mesh = mesh.extract_surface(algorithm=None) if not isinstance(mesh, pv.PolyData) else mesh
    figure = Figure.from_arrays(
        mesh.points,
        mesh.regular_faces,
        joints[:, None],
        np.ones((mesh.n_points, 1)),
        *_rest(),
        names=_NAMES,
        clips=[_walk(), _wave()],
        normals=mesh.point_data['Normals'],
        name='walker',
        look={'scalars': 'paint', 'rgb': True, 'smooth_shading': True},
    )
    figure.meshes[0].mesh['paint'] = colors.astype(np.uint8)
    return figure


def _rest():
    """Return parents and local matrices of the joints."""
    parents = [-1 if p is None else _NAMES.index(p) for p, _ in _JOINTS.values()]
    places = np.array([place for _, place in _JOINTS.values()])
    local_matrices = np.tile(np.eye(4), (len(places), 1, 1))
    parent_places = [places[p] if p >= 0 else np.zeros(3) for p in parents]
    local_matrices[:, :3, 3] = places - parent_places
    return parents, local_matrices


def _capsule(start, end, radius, around):
    """Return a closed capsule with normals."""
    start, end = np.array(start, float), np.array(end, float)
    axis = (end - start) / np.linalg.norm(end - start)
    ball = pv.Sphere(radius=1.0, theta_resolution=around, phi_resolution=around // 2 + 2)
    unit_points = np.asarray(ball.points, float)
    any_axis = np.eye(3)[np.abs(axis).argmin()]
    side_axis = np.cross(axis, any_axis)
    side_axis /= np.linalg.norm(side_axis)
    normals = unit_points @ np.stack([side_axis, np.cross(axis, side_axis), axis])
    points = np.where(unit_points[:, 2:] > 0, end, start) + radius * normals
    capsule = pv.PolyData(points, ball.faces)
    capsule.point_data['Normals'] = normals
    return capsule


def _turns(name, seconds, degrees, axis=(1.0, 0.0, 0.0)):
    """Return a track of a joint's angles in degrees at equal time steps."""
    times = np.linspace(0.0, seconds, len(degrees))
    values = from_axis_angle([axis] * len(degrees), np.radians(degrees))
    return Track(_NAMES.index(name), 'rotation', times, values)


def _walk():
    phase = np.linspace(0.0, 2 * np.pi, 17)
    swing_degrees, tracks = 28 * np.sin(phase), []
    for side, sign in (('left', 1.0), ('right', -1.0)):
        # Bent while the leg swings forwards.
        knee_degrees = np.maximum(55 * sign * np.cos(phase), 0) + 5
        tracks += [
            _turns(f'{side} leg', 1.0, sign * swing_degrees),
            _turns(f'{side} foot', 1.0, -knee_degrees),
            _turns(f'{side} arm', 1.0, -0.8 * sign * swing_degrees),
            _turns(f'{side} hand', 1.0, np.full(17, 20.0)),
        ]
    heights = 0.95 + 0.02 * np.cos(2 * phase)
    pelvis_positions = np.stack([np.zeros(17), np.zeros(17), heights], 1)
    tracks.append(Track(0, 'translation', np.linspace(0, 1, 17), pelvis_positions))
    return Clip('Walk', tracks)


def _wave():
    front = (0.0, 1.0, 0.0)
    beat = [0, 30, -10, 30, -10, 0]
    return Clip(
        'Wave',
        [
            _turns('left arm', 2.0, [-140.0] * 6, front),
            _turns('left hand', 2.0, beat, front),
            _turns('chest', 2.0, [0, 4, -4, 4, -4, 0], (0.0, 0.0, 1.0)),
        ],
    )
