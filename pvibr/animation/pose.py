"""A pose: where every joint of a figure is, relative to its parent, and the morph weights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pvibr.maths import quaternions

#: Largest cosine between two axes of a matrix that counts as free of shear.
_SHEAR = 1e-6
_SINGULAR = 1e-12  # |det| of the axes scaled to length one


@dataclass(frozen=True, eq=False)
class Pose:
    """Translations, rotations and scales of all joints, each relative to its parent's joint.

    Leading axes hold many poses at once: ``shape`` is () for one pose, (f,) for f poses.

    Parameters
    ----------
    translation : array_like, shape (..., n, 3)
        Origins of the joints in their parents' space, in the figure's unit.
    rotation : array_like, shape (..., n, 4), optional
        Quaternions (w, x, y, z) of any length but zero; default no rotation.
    scale : array_like, shape (..., n, 3), optional
        Factors along the joints' own axes; default 1.
    weights : array_like, shape (..., m), optional
        Morph weights of the whole figure: the targets of all its meshes one after another, in
        the order of the meshes. Default none.
    time : array_like, shape (...), optional
        Time of the meshes that are key-framed, in seconds; default 0.

    Raises
    ------
    ValueError
        If shapes do not fit each other, a value is not finite or a quaternion is zero.

    Examples
    --------
    >>> from pvibr.animation.pose import Pose
    >>> Pose([[1.0, 2.0, 3.0]]).matrices()[0, :3, 3].tolist()
    [1.0, 2.0, 3.0]
    """

    # Any: what is given may be any array_like or None, what is held is an array.
    translation: Any
    rotation: Any = None
    scale: Any = None
    weights: Any = None
    time: Any = 0.0

    def __post_init__(self):
        translation = _checked('translation', self.translation, 3)
        lead = translation.shape[:-2]
        n = translation.shape[-2]
        rotation = [1.0, 0.0, 0.0, 0.0] if self.rotation is None else self.rotation
        scale = [1.0, 1.0, 1.0] if self.scale is None else self.scale
        weights = np.zeros(0) if self.weights is None else self.weights
        weights = np.asarray(weights, dtype=np.float64)
        values = {
            'translation': translation,
            'rotation': quaternions.normalized(_fitted('rotation', rotation, (*lead, n, 4))),
            'scale': _fitted('scale', scale, (*lead, n, 3)),
            'weights': _fitted('weights', weights, (*lead, weights.shape[-1])),
            'time': _fitted('time', self.time, lead),
        }
        for name, value in values.items():
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
            msg = 'this is one pose, not several: it cannot be indexed.'
            raise IndexError(msg)
        parts = (self.translation, self.rotation, self.scale, self.weights, self.time)
        return Pose(*(part[index] for part in parts))

    def replaced(self, **parts):
        """Return this pose with other values.

        Parameters
        ----------
        **parts
            ``translation``, ``rotation``, ``scale``, ``weights`` or ``time``.

        Returns
        -------
        Pose
            A new pose.

        Examples
        --------
        >>> from pvibr.animation.pose import Pose
        >>> Pose([[0.0, 0.0, 0.0]]).replaced(weights=[0.5]).weights.tolist()
        [0.5]
        """
        return replace(self, **parts)

    def matrices(self):
        """Return the matrices that take points of each joint to its parent's space.

        Returns
        -------
        numpy.ndarray, shape (..., n, 4, 4), float64
            ``parent_from_joint``: scale, then rotation, then translation.

        Examples
        --------
        >>> from pvibr.animation.pose import Pose
        >>> (Pose([[1.0, 0.0, 0.0]], scale=2.0).matrices()[0] @ [1, 1, 1, 1]).tolist()
        [3.0, 2.0, 2.0, 1.0]
        """
        matrices = np.zeros((*self.translation.shape[:-1], 4, 4))
        rotation = quaternions.to_matrices(self.rotation)
        matrices[..., :3, :3] = rotation * self.scale[..., None, :]
        matrices[..., :3, 3] = self.translation
        matrices[..., 3, 3] = 1.0
        return matrices

    @classmethod
    def from_matrices(cls, matrices, weights=None, name='matrices'):
        """Take matrices apart.

        Parameters
        ----------
        matrices : array_like, shape (..., n, 4, 4)
            ``parent_from_joint``; may scale and mirror, but not shear.
        weights : array_like, shape (..., m), optional
            Morph weights.
        name : str
            Name of the matrices in an error.

        Returns
        -------
        Pose
            A pose whose ``matrices()`` are these.

        Raises
        ------
        ValueError
            If a matrix is no affine matrix, is not finite, is singular or shears; its place is
            named.

        Examples
        --------
        >>> import numpy as np
        >>> from pvibr.animation.pose import Pose
        >>> Pose.from_matrices([np.diag([2.0, 3.0, -4.0, 1.0])]).scale.tolist()
        [[2.0, 3.0, -4.0]]
        """
        matrices = as_matrices(matrices, name)
        linear = matrices[..., :3, :3]
        scale = np.linalg.norm(linear, axis=-2)
        axes = linear / np.where(scale > 0, scale, 1.0)[..., None, :]
        determinant = np.linalg.det(axes)
        _refuse(f'{name}[{{}}] is singular', np.abs(determinant) < _SINGULAR, matrices)
        products = np.swapaxes(axes, -1, -2) @ axes
        _refuse(
            f'{name}[{{}}] is sheared',
            np.abs(products - np.eye(3)).max((-1, -2)) > _SHEAR,
            matrices,
        )
        # A mirror is one negative factor: z, whichever axis was meant.
        sign = np.where(determinant < 0, -1.0, 1.0)[..., None] ** [0, 0, 1]
        rotation = quaternions.from_matrices(axes * sign[..., None, :])
        return cls(matrices[..., :3, 3], rotation, scale * sign, weights)


def as_matrices(matrices, name):
    """Return affine matrices as float64."""
    matrices = np.asarray(matrices, dtype=np.float64)
    if matrices.ndim < 3 or matrices.shape[-2:] != (4, 4):
        msg = f'{name} must be (..., n, 4, 4), not of shape {matrices.shape}.'
        raise ValueError(msg)
    _finite(name, matrices)
    off = np.abs(matrices[..., 3, :] - [0, 0, 0, 1]) > 1e-9
    if off.any():
        wrong = np.argwhere(off.any(-1))
        row = matrices[tuple(wrong[0])][3].tolist()
        msg = f'{name}[{_place(wrong[0])}] has the last row {row}; it must be [0, 0, 0, 1].'
        raise ValueError(msg)
    return matrices


def _checked(name, values, width):
    values = np.asarray(values, dtype=np.float64)
    if values.ndim < 2 or values.shape[-1] != width:
        msg = f'{name} must be (..., n, {width}), not of shape {values.shape}.'
        raise ValueError(msg)
    _finite(name, values)
    return values


def _fitted(name, values, shape):
    values = np.asarray(values, dtype=np.float64)
    _finite(name, values)
    try:
        return np.broadcast_to(values, shape)
    except ValueError:
        msg = f'{name} has the shape {values.shape}, which does not fit {shape}.'
        raise ValueError(msg) from None


def _finite(name, values):
    finite = np.isfinite(values)
    if not finite.all():
        bad = np.argwhere(~finite)
        place = f'[{_place(bad[0])}]' if values.ndim else ''
        msg = f'{name}{place} is {values[tuple(bad[0])]}; it must be finite.'
        raise ValueError(msg)


def _refuse(words, bad, matrices):
    places = np.argwhere(bad)
    if len(places):
        matrix = matrices[tuple(places[0])].tolist()
        msg = f'{words.format(_place(places[0]))}: {matrix}.'
        raise ValueError(msg)


def _place(index):
    return ', '.join(str(int(i)) for i in index)
