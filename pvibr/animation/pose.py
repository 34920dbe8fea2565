"""A pose: the transform of every joint relative to its parent, and the morph weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pvibr.core.arguments import check_finite, place_of
from pvibr.maths import quaternions

#: Largest cosine between two axes of a matrix that counts as free of shear.
_SHEAR = 1e-6
_SINGULAR = 1e-12  # |det| of the axes scaled to length one


@dataclass(frozen=True, eq=False, init=False)
class Pose:
    """Translation, rotation and scale of all joints relative to their parents, and morph weights.

    Leading axes hold many poses: ``shape`` is () for one pose, (f,) for f poses.

    Parameters
    ----------
    translation : array_like, shape (..., n, 3)
        Origins of the joints in their parents' space.
    rotation : array_like, shape (..., n, 4), optional
        Quaternions (w, x, y, z) of any length but zero; default no rotation.
    scale : array_like, shape (..., n, 3), optional
        Factors along the joints' axes; default 1.
    weights : array_like, shape (..., m), optional
        Morph weights: the targets of all meshes of the figure, mesh after mesh. Default none.
    time : array_like, shape (...), optional
        Time of vertex animations in seconds; default 0.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite or a quaternion is zero.

    Examples
    --------
    >>> from pvibr.animation import Pose
    >>> pose = Pose([[1.0, 0.0, 0.0]], scale=2.0)
    >>> (pose.matrices()[0] @ [1, 1, 1, 1]).tolist()
    [3.0, 2.0, 2.0, 1.0]
    """

    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    time: np.ndarray

    def __init__(self, translation, rotation=None, scale=None, weights=None, time=0.0):
        translation = _checked('translation', translation, 3)
        leading_shape = translation.shape[:-2]
        joint_count = translation.shape[-2]
        rotation = [1.0, 0.0, 0.0, 0.0] if rotation is None else rotation
        scale = [1.0, 1.0, 1.0] if scale is None else scale
        weights = np.asarray([] if weights is None else weights, dtype=np.float64)
        pose_parts = {
            'translation': translation,
            'rotation': quaternions.normalized(
                _fitted('rotation', rotation, (*leading_shape, joint_count, 4))
            ),
            'scale': _fitted('scale', scale, (*leading_shape, joint_count, 3)),
            'weights': _fitted('weights', weights, (*leading_shape, weights.shape[-1])),
            'time': _fitted('time', time, leading_shape),
        }
        for name, value in pose_parts.items():
            object.__setattr__(self, name, value)

    @property
    def n_joints(self):
        """Number of joints."""
        return self.translation.shape[-2]

    @property
    def shape(self):
        """Leading axes: () for one pose."""
        return self.translation.shape[:-2]

    def __getitem__(self, index):
        """Return the poses at an index of the leading axes."""
        if not self.shape:
            raise IndexError('pose must hold several poses to be indexed, got a single pose')
        parts = self.translation, self.rotation, self.scale, self.weights, self.time
        return Pose(*(part[index] for part in parts))

    def replaced(self, **parts):
        """Return a pose with other values.

        Parameters
        ----------
        **parts
            ``translation``, ``rotation``, ``scale``, ``weights`` or ``time``.
        """
        return replace(self, **parts)

    def matrices(self):
        """Return ``parent_from_joint`` of all joints: scale, then rotation, then translation.

        Shape (..., n, 4, 4), float64.
        """
        matrices = np.zeros((*self.translation.shape[:-1], 4, 4))
        matrices[..., :3, :3] = quaternions.unit_matrices(self.rotation) * self.scale[..., None, :]
        matrices[..., :3, 3] = self.translation
        matrices[..., 3, 3] = 1.0
        return matrices

    @classmethod
    def from_matrices(cls, matrices, weights=None, name='matrices'):
        """Decompose matrices into a pose.

        Parameters
        ----------
        matrices : array_like, shape (..., n, 4, 4)
            ``parent_from_joint``; may scale and mirror, but not shear.
        weights : array_like, shape (..., m), optional
            Morph weights.
        name : str
            Name of the matrices in error messages.

        Raises
        ------
        ValueError
            If a matrix is not affine, not finite, singular or sheared.

        Examples
        --------
        >>> import numpy as np
        >>> from pvibr.animation import Pose
        >>> Pose.from_matrices([np.diag([2.0, 3.0, -4.0, 1.0])]).scale.tolist()
        [[2.0, 3.0, -4.0]]
        """
        matrices = as_matrices(matrices, name)
        linear_parts = matrices[..., :3, :3]
        scale = np.linalg.norm(linear_parts, axis=-2)
        unit_axes = linear_parts / np.where(scale > 0, scale, 1.0)[..., None, :]
        determinant = np.linalg.det(unit_axes)
        _refuse(name, 'singular', np.abs(determinant) < _SINGULAR, matrices)
        axis_products = np.swapaxes(unit_axes, -1, -2) @ unit_axes
        is_sheared = np.abs(axis_products - np.eye(3)).max((-1, -2)) > _SHEAR
        _refuse(name, 'sheared', is_sheared, matrices)
        # A mirror becomes one negative factor, of z, whichever axis it came from.
        mirror_sign = np.where(determinant < 0, -1.0, 1.0)[..., None] ** [0, 0, 1]
        rotation = quaternions.from_matrices(unit_axes * mirror_sign[..., None, :])
        return cls(matrices[..., :3, 3], rotation, scale * mirror_sign, weights)


def unchecked_pose(**parts):
    """Return a pose from five valid parts, without checks."""
    pose = object.__new__(Pose)
    pose.__dict__.update(parts)
    return pose


def as_matrices(matrices, name):
    """Return checked affine matrices, (..., n, 4, 4), float64."""
    matrices = np.asarray(matrices, dtype=np.float64)
    if matrices.ndim < 3 or matrices.shape[-2:] != (4, 4):
        raise ValueError(f'{name} must have shape (..., n, 4, 4), got {matrices.shape}')
    check_finite(name, matrices)
    is_off = np.abs(matrices[..., 3, :] - [0, 0, 0, 1]) > 1e-9
    if is_off.any():
        bad_rows = np.argwhere(is_off.any(-1))
        place, last_row = place_of(bad_rows[0]), matrices[tuple(bad_rows[0])][3].tolist()
        raise ValueError(f'last row of {name}[{place}] must be [0, 0, 0, 1], got {last_row}')
    return matrices


def _checked(name, values, width):
    values = np.asarray(values, dtype=np.float64)
    if values.ndim < 2 or values.shape[-1] != width:
        raise ValueError(f'{name} must have shape (..., n, {width}), got {values.shape}')
    check_finite(name, values)
    return values


def _fitted(name, values, shape):
    values = np.asarray(values, dtype=np.float64)
    check_finite(name, values)
    try:
        return np.broadcast_to(values, shape)
    except ValueError:
        raise ValueError(
            f'{name} must have a shape that broadcasts to {shape}, got {values.shape}'
        ) from None


def _refuse(name, fault, is_bad, matrices):
    bad_places = np.argwhere(is_bad)
    if len(bad_places):
        matrix = matrices[tuple(bad_places[0])].tolist()
        raise ValueError(f'{name}[{place_of(bad_places[0])}] must not be {fault}, got {matrix}')
