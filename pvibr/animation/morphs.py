"""Morph targets: differences of points, normals, tangents and colours."""

from __future__ import annotations

import numpy as np

from pvibr.animation.normals import normals_at
from pvibr.core.arguments import check_finite

#: Attributes of a target, and their possible numbers of components.
WIDTHS = {'positions': (3,), 'normals': (3,), 'tangents': (3,), 'colors': (3, 4)}

_SAME = 1e-7  # smaller differences of a normal are rounding


class Morphs:
    """Morph targets: differences from the neutral mesh.

    Each of the four is an array of shape (t, v, 3), or a sequence with one entry per target: an
    array (v, 3), a sparse pair of indices (k,) and differences (k, 3), or ``None`` for no change.

    Parameters
    ----------
    positions : array_like or sequence, shape (t, v, 3)
        Differences of the points.
    normals, tangents : array_like or sequence, optional
        Differences of the normals and tangents.
    colors : array_like or sequence, optional
        Differences of the colours, of 3 or 4 channels.
    names : sequence of str, optional
        Names of the targets; default 'target0', 'target1', ...
    weights : array_like, shape (t,), optional
        Blend weights at rest; default 0. Weights may be below 0 and above 1.

    Raises
    ------
    ValueError
        If numbers of targets or vertices do not fit, or a value is not finite.

    Examples
    --------
    >>> from pvibr.animation import Morphs
    >>> smile = Morphs([([2], [[0.0, 0.0, 1.0]])], names=['smile'])
    >>> smile.total('positions', [0.5], 4)[2].tolist()
    [0.0, 0.0, 0.5]
    """

    def __init__(
        self, positions, normals=None, tangents=None, colors=None, *, names=None, weights=None
    ):
        count = len(positions)
        attributes = zip(WIDTHS, (positions, normals, tangents, colors), strict=True)
        self._targets = {
            attribute: _targets(attribute, values, count)
            for attribute, values in attributes
            if values is not None
        }
        self.names = tuple(f'target{i}' for i in range(count)) if names is None else tuple(names)
        self.weights = np.zeros(count) if weights is None else np.array(weights, dtype=np.float64)
        for name, value in (('names', self.names), ('weights', self.weights)):
            if np.shape(value) != (count,):
                raise ValueError(
                    f'{name} must have shape ({count},), one per morph target, got '
                    f'{np.shape(value)}'
                )
        check_finite('weights', self.weights)

    def __len__(self):
        return len(self.weights)

    def __repr__(self):
        return f'Morphs({len(self)} targets of {", ".join(self._targets)})'

    def has(self, what):
        """Return True if any target changes an attribute."""
        return any(target is not None for target in self._targets.get(what, ()))

    def target(self, what, index):
        """Return the difference of one target.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            The attribute.
        index : int
            Index of the target.

        Returns
        -------
        tuple of numpy.ndarray or None
            Indices (k,), or ``slice(None)`` for all vertices, and differences (k, c); ``None``
            if the target does not change the attribute.
        """
        return self._targets[what][index] if what in self._targets else None

    def total(self, what, weights, n_points):
        """Return the sum of weight times difference of all targets, shape (n_points, c), float64.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            The attribute.
        weights : array_like, shape (t,)
            Blend weights, unlimited.
        n_points : int
            Number of vertices of the mesh.
        """
        total = np.zeros((n_points, self.width(what)))
        for index in np.flatnonzero(weights):
            target = self.target(what, index)
            if target is not None:
                np.add.at(total, target[0], weights[index] * target[1].astype(np.float64))
        return total

    def width(self, what):
        """Return the number of components of an attribute: 3, or 4 for colours with alpha."""
        widths = {t[1].shape[1] for t in self._targets.get(what, ()) if t is not None}
        return max(widths, default=3)

    def with_normals(self, mesh):
        """Return these targets with differences of normals computed from the polygons.

        Parameters
        ----------
        mesh : pyvista.PolyData
            The neutral mesh.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr.animation import Morphs
        >>> flat = pv.Plane()
        >>> slope = Morphs([flat.points[:, :1] * [0, 0, 1]]).with_normals(flat)
        >>> slope.target('normals', 0)[1][0].tolist()
        [-0.707, 0.0, -0.293]
        """
        neutral = np.asarray(mesh.points, dtype=np.float64)
        neutral_normals = normals_at(mesh, neutral)
        changes: list[tuple] = []
        for i in range(len(self)):
            one_hot = np.arange(len(self)) == i
            morphed_points = neutral + self.total('positions', one_hot, len(neutral))
            normal_change = (normals_at(mesh, morphed_points) - neutral_normals).astype(np.float32)
            changed_vertices = np.flatnonzero(np.abs(normal_change).max(1) > _SAME)
            changes.append((changed_vertices, normal_change[changed_vertices]))
        targets = {name: self._targets.get(name) for name in WIDTHS} | {'normals': changes}
        return Morphs(**targets, names=self.names, weights=self.weights)

    def check(self, n_points):
        """Raise an error if the targets do not fit a mesh with this number of vertices."""
        for attribute, targets in self._targets.items():
            for i, target in enumerate(targets):
                if target is None:
                    continue
                vertices, values = target
                name = f'{attribute}[{i}]'
                if isinstance(vertices, slice):
                    if len(values) != n_points:
                        raise ValueError(f'{name} must have {n_points} rows, got {len(values)}')
                elif vertices.max(initial=-1) >= n_points:
                    last = n_points - 1
                    raise ValueError(
                        f'indices of {name} must be from 0 to {last}, got {vertices.max()}'
                    )


def _targets(attribute, values, target_count):
    if len(values) != target_count:
        raise ValueError(f'{attribute} must have {target_count} targets, got {len(values)}')
    values = [*values]
    unique_targets: dict[int, tuple | None] = {id(None): None}
    for i, value in enumerate(values):
        if id(value) not in unique_targets:
            unique_targets[id(value)] = _target(f'{attribute}[{i}]', attribute, value)
    return [unique_targets[id(value)] for value in values]


def _target(name, attribute, value):
    """Return indices and differences; float32 stays float32, to save memory."""
    if isinstance(value, tuple) and isinstance(value[0], slice):  # as Morphs.target gives it
        value = value[1]
    is_sparse = isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) == 1
    vertices = np.asarray(value[0]) if is_sparse else slice(None)
    values = np.asarray(value[1] if is_sparse else value)
    values = values if values.dtype == np.float32 else values.astype(np.float64)
    if values.ndim != 2 or values.shape[1] not in WIDTHS[attribute]:
        raise ValueError(f'{name} must be (v, {WIDTHS[attribute][-1]}), got {values.shape}')
    check_finite(name, values)
    if is_sparse:
        vertices = _indices(name, vertices, len(values))
    return vertices, values


def _indices(name, vertices, count):
    is_bad = count and (vertices.dtype.kind not in 'iu' or vertices.min(initial=0) < 0)
    if vertices.shape != (count,) or is_bad:
        first = vertices.tolist()[:5]
        raise ValueError(
            f'indices of {name} must be {count} whole numbers of 0 or more, got {first}...'
        )
    return vertices.astype(np.int64)
