"""Morph targets: what is added to a mesh's points, normals, tangents and colours."""

from __future__ import annotations

import numpy as np

from pvibr.animation.normals import normals_at

#: What a target may change, and of how many numbers the difference is.
WIDTHS = {'positions': (3,), 'normals': (3,), 'tangents': (3,), 'colors': (3, 4)}

_SAME = 1e-7  # of a normal: what is less is rounding


class Morphs:
    """Differences from the neutral mesh, one target after another.

    Each of the four is an array of shape (t, v, 3), or a sequence with one entry per target:
    an array (v, 3), a sparse pair of indices (k,) and differences (k, 3), or ``None`` where the
    target leaves it as it is.

    Parameters
    ----------
    positions : array_like or sequence, shape (t, v, 3)
        Differences of the points, in the mesh's unit.
    normals : array_like or sequence, optional
        Differences of the normals.
    tangents : array_like or sequence, optional
        Differences of the tangents.
    colors : array_like or sequence, optional
        Differences of the colours, of 3 or 4 channels.
    names : sequence of str, optional
        Names of the targets; default 'target0', 'target1', ...
    weights : array_like, shape (t,), optional
        Weights at rest; default 0. They may be below 0 and above 1, here and in a pose.

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
        given = {
            'positions': positions,
            'normals': normals,
            'tangents': tangents,
            'colors': colors,
        }
        n = len(positions)
        self._targets = {
            what: _targets(what, values, n) for what, values in given.items() if values is not None
        }
        self.names = tuple(f'target{i}' for i in range(n)) if names is None else tuple(names)
        self.weights = np.zeros(n) if weights is None else np.array(weights, dtype=np.float64)
        for name, value in (('names', self.names), ('weights', self.weights)):
            if np.shape(value) != (n,):
                msg = f'{name} has the shape {np.shape(value)} for {n} morph targets.'
                raise ValueError(msg)
        if not np.isfinite(self.weights).all():
            msg = f'weights of morph targets must be finite, not {self.weights.tolist()}.'
            raise ValueError(msg)

    def __len__(self):
        return len(self.weights)

    def __repr__(self):
        return f'Morphs({len(self)} targets of {", ".join(self._targets)})'

    def has(self, what):
        """Say whether any target changes something.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            What is asked for.

        Returns
        -------
        bool
            Whether one does.

        Examples
        --------
        >>> from pvibr.animation import Morphs
        >>> Morphs([([0], [[0, 0, 1]])]).has('normals')
        False
        """
        return any(target is not None for target in self._targets.get(what, ()))

    def target(self, what, index):
        """Return the difference of one target.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            What is changed.
        index : int
            Number of the target.

        Returns
        -------
        tuple of numpy.ndarray or None
            Indices (k,), or ``slice(None)`` for all vertices, and differences (k, c); ``None``
            where the target changes nothing.

        Examples
        --------
        >>> from pvibr.animation import Morphs
        >>> Morphs([([7], [[0, 0, 1]])]).target('positions', 0)[0].tolist()
        [7]
        """
        return self._targets[what][index] if what in self._targets else None

    def total(self, what, weights, n_points):
        """Return what the targets add, by their weights.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            What is changed.
        weights : array_like, shape (t,)
            Any numbers.
        n_points : int
            Number of the mesh's vertices.

        Returns
        -------
        numpy.ndarray, shape (n_points, c), float64
            Sum of weight times difference.

        Examples
        --------
        >>> from pvibr.animation import Morphs
        >>> Morphs([[[1.0, 0, 0]], [[0, 1.0, 0]]]).total('positions', [2.0, -1.0], 1).tolist()
        [[2.0, -1.0, 0.0]]
        """
        total = np.zeros((n_points, self.width(what)))
        for index in np.flatnonzero(weights):
            target = self.target(what, index)
            if target is not None:
                np.add.at(total, target[0], weights[index] * target[1].astype(np.float64))
        return total

    def width(self, what):
        """Return of how many numbers a difference is.

        Parameters
        ----------
        what : {'positions', 'normals', 'tangents', 'colors'}
            What is changed.

        Returns
        -------
        int
            3, or 4 for colours with an alpha.

        Examples
        --------
        >>> from pvibr.animation import Morphs
        >>> Morphs([[[1.0, 0, 0]]]).width('positions')
        3
        """
        widths = {t[1].shape[1] for t in self._targets.get(what, ()) if t is not None}
        return max(widths, default=3)

    def with_normals(self, mesh):
        """Return these targets with the differences that they make to the mesh's normals.

        Parameters
        ----------
        mesh : pyvista.PolyData
            The neutral mesh.

        Returns
        -------
        Morphs
            The same targets. Differences of normals are those between the normals of the
            polygons with a target at weight 1 and without.

        Examples
        --------
        >>> import numpy as np
        >>> import pyvista as pv
        >>> from pvibr.animation import Morphs
        >>> flat = pv.Plane()
        >>> slope = Morphs([flat.points[:, :1] * [0, 0, 1]]).with_normals(flat)
        >>> slope.target('normals', 0)[1][0].tolist()
        [-0.707, 0.0, -0.293]
        """
        neutral = np.asarray(mesh.points, dtype=np.float64)
        before = normals_at(mesh, neutral)
        changes: list[tuple] = []
        for one in np.eye(len(self)):
            points = neutral + self.total('positions', one, len(neutral))
            change = (normals_at(mesh, points) - before).astype(np.float32)
            rows = np.flatnonzero(np.abs(change).max(1) > _SAME)
            changes.append((rows, change[rows]))
        others = {name: self._targets.get(name) for name in WIDTHS} | {'normals': changes}
        return Morphs(**others, names=self.names, weights=self.weights)

    def check(self, n_points):
        """Refuse targets of another mesh.

        Parameters
        ----------
        n_points : int
            Number of the mesh's vertices.

        Raises
        ------
        ValueError
            If a target has another number of vertices or an index out of range.

        Examples
        --------
        >>> from pvibr.animation import Morphs
        >>> Morphs([[[1.0, 0, 0]]]).check(1)
        """
        for what, targets in self._targets.items():
            for i, target in enumerate(targets):
                if target is None:
                    continue
                where, values = target
                if isinstance(where, slice) and len(values) != n_points:
                    msg = f'{what}[{i}] has {len(values)} rows; the mesh has {n_points} points.'
                    raise ValueError(msg)
                if not isinstance(where, slice) and len(where) and where.max() >= n_points:
                    msg = (
                        f'{what}[{i}] has the index {where.max()}; the mesh has {n_points} points.'
                    )
                    raise ValueError(msg)


def _targets(what, values, n):
    if len(values) != n:
        msg = f'{what} has {len(values)} targets, positions {n}.'
        raise ValueError(msg)
    return [
        None if value is None else _target(f'{what}[{i}]', what, value)
        for i, value in enumerate(values)
    ]


def _target(name, what, value):
    """Return where and by how much; float32 stays so, to hold many targets."""
    if isinstance(value, tuple) and isinstance(value[0], slice):  # as Morphs.target gives it
        value = value[1]
    sparse = isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) == 1
    where = np.asarray(value[0]) if sparse else slice(None)
    values = np.asarray(value[1] if sparse else value)
    values = values if values.dtype == np.float32 else values.astype(np.float64)
    if values.ndim != 2 or values.shape[1] not in WIDTHS[what]:
        msg = f'{name} must be (v, {WIDTHS[what][-1]}), not of shape {values.shape}.'
        raise ValueError(msg)
    if not np.isfinite(values).all():
        row = np.flatnonzero(~np.isfinite(values).all(1))[0]
        msg = f'{name}, row {row}, is {values[row].tolist()}; it must be finite.'
        raise ValueError(msg)
    if sparse:
        where = _indices(name, where, len(values))
    return where, values


def _indices(name, where, n):
    if where.shape != (n,) or (n and where.dtype.kind not in 'iu') or (n and where.min() < 0):
        msg = f'indices of {name} must be {n} whole numbers >= 0, not {where.tolist()[:5]}...'
        raise ValueError(msg)
    return where.astype(np.int64)
