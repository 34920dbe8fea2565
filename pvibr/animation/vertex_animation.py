"""Vertex animation: every key frame stores all vertices, and frames are blended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.animation.keyframes import blend, blend_directions, checked_keys, frame_weights
from pvibr.animation.vertex_animation_states import VertexAnimationStates
from pvibr.core.arguments import check_finite


@dataclass(frozen=True, eq=False)
class VertexAnimation:
    """Key frames of all vertices of a mesh; topology stays the same.

    Parameters
    ----------
    times : array_like, shape (f,)
        Times of the frames in seconds, increasing.
    positions : array_like, shape (f, v, 3)
        Vertices of each frame. A float array is stored without a copy; it may be a memory-mapped
        file larger than memory.
    normals : array_like, shape (f, v, 3), optional
        Normals of each frame.
    interpolation : {'linear', 'step', 'quadratic', 'cubic'}
        Interpolation between frames, see :func:`pvibr.animation.keyframes.frame_weights`.
    period : float, optional
        Seconds after which the animation repeats; default never, and the ends are held.
    states : VertexAnimationStates, optional
        Chooses the frames in place of times, interpolation and period.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, the interpolation is unknown, the period is
        too short, or states refer to missing frames.

    Examples
    --------
    >>> from pvibr.animation import VertexAnimation
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
        frame_weights(times, times[0], self.interpolation, self.period)  # raises the errors
        object.__setattr__(self, 'times', times)
        for name in ('positions', 'normals'):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._floats(name))
        if self.states is not None and self.states.last >= len(times):
            raise ValueError(f'states must use frames below {len(times)}, got {self.states.last}')

    @property
    def n_points(self):
        """Number of vertices."""
        return self.positions.shape[1]

    @property
    def duration(self):
        """Seconds from the first frame to the last, or of the period."""
        return float(self.times[-1] - self.times[0]) if self.period is None else self.period

    def at(self, times):
        """Return the frames to blend at given times, and their weights, which sum to one.

        Parameters
        ----------
        times : array_like, any shape
            Times in seconds.

        Returns
        -------
        tuple of numpy.ndarray, shape (..., k), int64 and float64
            Frames, and their blend weights.

        Raises
        ------
        ValueError
            If a time is not finite.
        """
        if self.states is not None:
            return self.states.at(times)
        return frame_weights(self.times, times, self.interpolation, self.period)

    def blend(self, indices, weights):
        """Return the weighted sums of vertices and unit normals of frames; None without normals.

        Shapes (..., v, 3), from indices and weights (..., k).
        """
        points = blend(self.positions, indices, weights)
        if self.normals is None:
            return points, None
        return points, blend_directions(self.normals, indices, weights)

    def sample(self, times):
        """Return vertices and normals at given times.

        Parameters
        ----------
        times : array_like, any shape
            Times in seconds.

        Returns
        -------
        points : numpy.ndarray, shape (..., v, 3), float64
            Vertices.
        normals : numpy.ndarray, shape (..., v, 3), float64, or None
            Unit normals; None if the frames have none.

        Raises
        ------
        ValueError
            If a time is not finite.
        """
        return self.blend(*self.at(times))

    @classmethod
    def from_meshes(cls, meshes, times=None, interpolation='linear', period=None):
        """Make an animation from a series of meshes.

        Parameters
        ----------
        meshes : sequence of pyvista.PolyData
            One mesh per frame, with the same vertices and faces in the same order. Point normals
            are used if all meshes have them.
        times : array_like, shape (f,), optional
            Times in seconds; default one frame per second.
        interpolation : {'linear', 'step', 'quadratic', 'cubic'}
            Interpolation between frames.
        period : float, optional
            Seconds after which the animation repeats.

        Raises
        ------
        ValueError
            If there are no meshes, or one differs from the first in its faces or number of points.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr.animation import VertexAnimation
        >>> VertexAnimation.from_meshes([pv.Sphere(radius=r) for r in (1, 2, 3)]).n_points
        842
        """
        meshes = list(meshes)
        if not meshes:
            raise ValueError('meshes must hold at least one mesh, got none')
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
        point_count = np.shape(self.positions)[1] if np.ndim(self.positions) == 3 else 'v'
        frame_count = len(self.times)
        if values.shape != (frame_count, point_count, 3):
            raise ValueError(
                f'{name} must have shape ({frame_count}, {point_count}, 3), got {values.shape}'
            )
        # Frame by frame: the file may be larger than memory.
        for i, frame in enumerate(values):
            check_finite(f'{name}[{i}]', frame)
        return values


def _check_alike(first_mesh, mesh, mesh_index):
    """Raise an error unless a mesh has the vertices and faces of the first one."""
    if mesh.n_points != first_mesh.n_points:
        raise ValueError(
            f'meshes[{mesh_index}] must have {first_mesh.n_points} points, as meshes[0], '
            f'got {mesh.n_points}'
        )
    for cell_kind in ('verts', 'lines', 'faces', 'strips'):
        if not np.array_equal(getattr(mesh, cell_kind), getattr(first_mesh, cell_kind)):
            raise ValueError(f'meshes[{mesh_index}] must have the {cell_kind} of meshes[0]')
