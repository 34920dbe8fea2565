"""Key-frame animation: every frame stores all vertices, and frames are blended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.animation.vertex_animation_states import VertexAnimationStates
from pvibr.maths.keyframes import blend, blend_directions, checked_keys, frame_weights


@dataclass(frozen=True, eq=False)
class VertexAnimation:
    """Shapes of one mesh over time: the same vertices and triangles, other places.

    Parameters
    ----------
    times : array_like, shape (f,)
        Times of the frames in seconds, increasing.
    positions : array_like, shape (f, v, 3)
        Vertices of each frame. An array of floats is kept as it is, also if it is a file that is
        mapped to memory, so that long series need not fit into memory.
    normals : array_like, shape (f, v, 3), optional
        Normals of each frame.
    interpolation : {'linear', 'step', 'quadratic', 'cubic'}
        How frames are blended: see :func:`pvibr.maths.keyframes.frame_weights`.
    period : float, optional
        Seconds after which it begins again; without one the ends stay.
    states : pvibr.animation.vertex_animation_states.VertexAnimationStates, optional
        Chooses the frames, in place of times, interpolation and period.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, the interpolation is not known, the period
        is too short, or states show frames that there are not.

    Examples
    --------
    >>> from pvibr.animation.vertex_animation import VertexAnimation
    >>> up = VertexAnimation([0.0, 1.0], [[[0.0, 0.0, 0.0]], [[0.0, 0.0, 2.0]]])
    >>> up.sample(0.25)[0].tolist()
    [[0.0, 0.0, 0.5]]
    """

    times: np.ndarray
    positions: np.ndarray
    normals: np.ndarray | None = None
    interpolation: str = 'linear'
    period: float | None = None
    states: VertexAnimationStates | None = None

    def __post_init__(self):
        times = checked_keys(self.times, 'times')
        frame_weights(times, times[0], self.interpolation, self.period)  # says what is wrong
        object.__setattr__(self, 'times', times)
        for name in ('positions', 'normals'):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._floats(name))
        if self.states is not None and self.states.last >= len(times):
            msg = f'states show frame {self.states.last}; there are {len(times)} frames.'
            raise ValueError(msg)

    @property
    def n_points(self):
        """Number of vertices."""
        return self.positions.shape[1]

    @property
    def duration(self):
        """Seconds from the first frame to the last, or of the period."""
        return float(self.times[-1] - self.times[0]) if self.period is None else self.period

    def at(self, times):
        """Return which frames are shown at times.

        Parameters
        ----------
        times : array_like, any shape
            When, in seconds.

        Returns
        -------
        indices : numpy.ndarray, shape (..., k), int64
            Frames.
        weights : numpy.ndarray, shape (..., k), float64
            Their weights, with the sum 1.

        Raises
        ------
        ValueError
            If a time is not finite.

        Examples
        --------
        >>> from pvibr.animation.vertex_animation import VertexAnimation
        >>> VertexAnimation([0.0, 1.0], [[[0.0, 0.0, 0.0]], [[0.0, 0.0, 2.0]]]).at(0.25)
        (array([0, 1]), array([0.75, 0.25]))
        """
        if self.states is not None:
            return self.states.at(times)
        return frame_weights(self.times, times, self.interpolation, self.period)

    def blend(self, indices, weights):
        """Return the weighted sum of frames.

        Parameters
        ----------
        indices : array_like, shape (..., k), int
            Frames.
        weights : array_like, shape (..., k)
            Their weights.

        Returns
        -------
        points : numpy.ndarray, shape (..., v, 3), float64
            Vertices.
        normals : numpy.ndarray, shape (..., v, 3), float64, or None
            Normals of length 1; None if the frames have none.

        Examples
        --------
        >>> from pvibr.animation.vertex_animation import VertexAnimation
        >>> frames = VertexAnimation([0.0, 1.0], [[[0.0, 0.0, 0.0]], [[0.0, 0.0, 2.0]]])
        >>> frames.blend([0, 1], [0.5, 0.5])[0].tolist()
        [[0.0, 0.0, 1.0]]
        """
        points = blend(self.positions, indices, weights)
        if self.normals is None:
            return points, None
        return points, blend_directions(self.normals, indices, weights)

    def sample(self, times):
        """Return the mesh's vertices and normals at times.

        Parameters
        ----------
        times : array_like, any shape
            When, in seconds.

        Returns
        -------
        points : numpy.ndarray, shape (..., v, 3), float64
            Vertices.
        normals : numpy.ndarray, shape (..., v, 3), float64, or None
            Normals of length 1; None if the frames have none.

        Raises
        ------
        ValueError
            If a time is not finite.

        Examples
        --------
        >>> from pvibr.animation.vertex_animation import VertexAnimation
        >>> fall = VertexAnimation(
        ...     [0, 1, 2], [[[0, 0, 4.0]], [[0, 0, 3.0]], [[0, 0, 0.0]]], None, 'cubic'
        ... )
        >>> fall.sample(1.5)[0].tolist()
        [[0.0, 0.0, 1.75]]
        """
        return self.blend(*self.at(times))

    @classmethod
    def from_meshes(cls, meshes, times=None, interpolation='linear', period=None):
        """Return the frames of a series of meshes.

        Parameters
        ----------
        meshes : sequence of pyvista.PolyData
            One per frame: the same vertices in the same order, and the same faces. Normals at
            points are used if all have them.
        times : array_like, shape (f,), optional
            When, in seconds; one frame a second unless given.
        interpolation : {'linear', 'step', 'quadratic', 'cubic'}
            How frames are blended.
        period : float, optional
            Seconds after which it begins again.

        Returns
        -------
        Frames
            The frames.

        Raises
        ------
        ValueError
            If there are no meshes, or one differs from the first in its faces or number of
            points; it is named.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr.animation.vertex_animation import VertexAnimation
        >>> VertexAnimation.from_meshes([pv.Sphere(radius=r) for r in (1, 2, 3)]).n_points
        842
        """
        meshes = list(meshes)
        if not meshes:
            msg = 'meshes is empty; there must be at least one.'
            raise ValueError(msg)
        for i, mesh in enumerate(meshes):
            _check_alike(meshes[0], mesh, i)
        times = np.arange(float(len(meshes))) if times is None else times
        normals = [mesh.point_data.active_normals for mesh in meshes]
        whole = not any(n is None for n in normals)
        points = np.stack([mesh.points for mesh in meshes])
        return cls(times, points, np.stack(normals) if whole else None, interpolation, period)

    def _floats(self, name):
        values = np.asarray(getattr(self, name))
        if values.dtype.kind != 'f':
            values = values.astype(np.float64)
        size = np.shape(self.positions)[1] if np.ndim(self.positions) == 3 else 'v'
        if values.shape != (len(self.times), size, 3):
            msg = (
                f'{name} has the shape {values.shape}; it must be ({len(self.times)}, {size}, 3).'
            )
            raise ValueError(msg)
        # Frame after frame: the whole may be a file that is larger than memory.
        for i, frame in enumerate(values):
            if not np.isfinite(frame).all():
                msg = f'{name}[{i}] is not finite.'
                raise ValueError(msg)
        return values


def _check_alike(first, mesh, i):
    """Raise unless a mesh has the vertices and faces of the first one."""
    if mesh.n_points != first.n_points:
        msg = (
            f'meshes[{i}] has {mesh.n_points} points and meshes[0] has {first.n_points}; '
            'all frames must have the same vertices.'
        )
        raise ValueError(msg)
    for part in ('verts', 'lines', 'faces', 'strips'):
        if not np.array_equal(getattr(mesh, part), getattr(first, part)):
            msg = f'meshes[{i}] has other {part} than meshes[0]; all frames must have the same.'
            raise ValueError(msg)
