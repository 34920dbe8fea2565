"""Movements that are put together: layers over layers, clips in step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pvibr.animation.blending import (
    PoseSum,
    added,
    crossfade,
    difference,
    shares,
    unit_range,
)
from pvibr.animation.curves import Curve
from pvibr.animation.pose import Pose


@dataclass(frozen=True, eq=False)
class ClipSource:
    """A clip of a figure as a source of poses.

    Parameters
    ----------
    figure : Figure
        The figure.
    clip : str, int or Clip, optional
        What is played; default the first clip, or rest.
    speed : float
        Seconds of the clip per second; negative plays backwards.
    offset : float
        Where in the clip time 0 is, in seconds.
    loop : bool
        Begin again after the end.
    root : str or int, optional
        Joint that goes on from where it got to, round after round, in place of back to where it
        began (root motion): a walk that gets somewhere. Only where it is, not how it is turned.

    Raises
    ------
    ValueError
        If there is no such clip or joint.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh, Clip
    >>> from pvibr.animation.mixer import ClipSource
    >>> cube = Figure([FigureMesh(pv.Cube())], clips=[Clip('still', [], duration=3.0)])
    >>> ClipSource(cube, 'still', speed=2.0).duration
    1.5
    """

    figure: Any
    clip: Any = None
    speed: float = 1.0
    offset: float = 0.0
    loop: bool = True
    root: Any = None

    def __post_init__(self):
        object.__setattr__(self, 'clip', self.figure.clip(self.clip))
        if self.root is not None:
            object.__setattr__(self, 'root', self.figure.skeleton.index(self.root))

    @property
    def duration(self):
        """Seconds that it takes once; infinite without a clip or at no speed."""
        if self.clip is None or not self.speed:
            return np.inf
        return self.clip.duration / abs(self.speed)

    def sample(self, times):
        """Return the pose at times.

        Parameters
        ----------
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        Pose
            Of shape ``times.shape``.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh
        >>> from pvibr.animation.mixer import ClipSource
        >>> ClipSource(Figure([FigureMesh(pv.Cube())])).sample([0.0, 1.0]).shape
        (2,)
        """
        times = self.offset + self.speed * np.asarray(times, dtype=np.float64)
        pose = self.figure.sample(times, self.clip, self.loop)
        if self.root is None or self.clip is None or not (self.loop and self.clip.duration):
            return pose
        ends = self.figure.sample([0.0, self.clip.duration], self.clip, loop=False)
        rounds = np.floor_divide(times, self.clip.duration)
        translation = pose.translation.copy()
        way = ends.translation[1, self.root] - ends.translation[0, self.root]
        translation[..., self.root, :] += rounds[..., None] * way
        return pose.replaced(translation=translation)


@dataclass(frozen=True, eq=False)
class PoseSource:
    """One pose at all times, as a source of poses.

    Parameters
    ----------
    pose : Pose
        A single one.

    Examples
    --------
    >>> from pvibr.animation import Pose
    >>> from pvibr.animation.mixer import PoseSource
    >>> PoseSource(Pose([[1.0, 0.0, 0.0]])).sample([0.0, 1.0]).translation.shape
    (2, 1, 3)
    """

    pose: Pose

    def sample(self, times):
        """Return the pose, once for each time.

        Parameters
        ----------
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        Pose
            Of shape ``times.shape``.

        Examples
        --------
        >>> from pvibr.animation import Pose
        >>> from pvibr.animation.mixer import PoseSource
        >>> PoseSource(Pose([[1.0, 0.0, 0.0]])).sample(0.0).translation.tolist()
        [[1.0, 0.0, 0.0]]
        """
        total = PoseSum(np.shape(times), self.pose)
        total.add(self.pose, np.ones(()))
        return total.pose()


class SyncedClips:
    """Clips of different lengths in step: walk and run with the same foot in front.

    All share one phase, that of a round; each clip is stretched to it. Rounds per second are the
    weighted mean of the clips' own.

    Parameters
    ----------
    figure : Figure
        The figure.
    clips : sequence of str, int or Clip, length k
        What is played, all in loops that begin at the same foot.
    weights : array_like, shape (k,) or (f, k)
        Shares of the clips, constant or at times.
    times : array_like, shape (f,), optional
        When the weights are reached, in seconds, in line between. The phase is 0 at the first;
        at time 0 when the weights are constant.

    Raises
    ------
    ValueError
        If a clip does not exist or has no length, or weights or times do not fit.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh, Clip
    >>> from pvibr.animation.mixer import SyncedClips
    >>> clips = [Clip('walk', [], duration=1.0), Clip('run', [], duration=0.5)]
    >>> gait = SyncedClips(
    ...     Figure([FigureMesh(pv.Cube())], clips=clips), ['walk', 'run'], [0.5, 0.5]
    ... )
    >>> gait.phase(2.0)  # one and a half rounds per second
    np.float64(3.0)
    """

    def __init__(self, figure, clips, weights, times=None):
        self.figure = figure
        self.clips = tuple(figure.clip(clip) for clip in clips)
        weights = np.atleast_2d(shares(weights))
        if weights.shape[1] != len(self.clips):
            msg = f'weights has the shape {weights.shape} for {len(self.clips)} clips.'
            raise ValueError(msg)
        self.weights = Curve(weights, times)
        for clip in self.clips:
            if not clip.duration:
                msg = f'clip {clip.name!r} has no length, so it cannot be played in step.'
                raise ValueError(msg)
        self._rates = 1 / np.array([clip.duration for clip in self.clips])

    def go(self, weights, at, fade=0.2):
        """Go to other shares of the clips, in step all the way.

        Parameters
        ----------
        weights : array_like, shape (k,)
            Shares.
        at : float
            When it begins, in seconds; not before the first time.
        fade : float
            Seconds that it takes, above 0.

        Raises
        ------
        ValueError
            If weights do not fit, or as :meth:`pvibr.animation.curves.Curve.go` does.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Clip
        >>> from pvibr.animation.mixer import SyncedClips
        >>> clips = [Clip('walk', [], duration=1.0), Clip('run', [], duration=0.5)]
        >>> gait = SyncedClips(
        ...     Figure([FigureMesh(pv.Cube())], clips=clips), ['walk', 'run'], [1, 0]
        ... )
        >>> gait.go([0, 1], at=1.0, fade=2.0)
        >>> gait.phase([1.0, 3.0, 4.0]).tolist()
        [1.0, 4.0, 6.0]
        """
        weights = shares(weights)
        if weights.shape != (len(self.clips),):
            msg = f'weights has the shape {weights.shape} for {len(self.clips)} clips.'
            raise ValueError(msg)
        self.weights.go(weights, at, fade)

    def phase(self, times):
        """Return how many rounds have been played.

        Parameters
        ----------
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        numpy.ndarray, shape (...), float64
            Rounds, also negative; the integral of the rounds per second.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Clip
        >>> from pvibr.animation.mixer import SyncedClips
        >>> cube = Figure([FigureMesh(pv.Cube())], clips=[Clip('walk', [], duration=2.0)])
        >>> SyncedClips(cube, ['walk'], [1.0]).phase([-1.0, 0.0, 3.0]).tolist()
        [-0.5, 0.0, 1.5]
        """
        return self.weights.integral(times) @ self._rates

    def sample(self, times):
        """Return the pose at times.

        Parameters
        ----------
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        Pose
            Of shape ``times.shape``.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pvibr import Figure
        >>> from pvibr.animation import FigureMesh, Clip
        >>> from pvibr.animation.mixer import SyncedClips
        >>> cube = Figure([FigureMesh(pv.Cube())], clips=[Clip('walk', [], duration=2.0)])
        >>> SyncedClips(cube, ['walk'], [1.0]).sample([0.0, 3.0]).shape
        (2,)
        """
        times = np.asarray(times, dtype=np.float64)
        phase = self.phase(times)
        total = PoseSum(times.shape, self.figure.rest)
        weights = np.moveaxis(self.weights.at(times), -1, 0)
        for clip, share in zip(self.clips, weights, strict=True):
            if share.any():
                total.add(self.figure.sample(phase * clip.duration, clip), share)
        return total.pose()


class AnimationLayer:
    """What a mixer puts over the layers below.

    Parameters
    ----------
    source : object
        Whatever has ``sample(times) -> Pose``.
    weight : float or Curve
        How much of it, from 0 to 1, or any number when it is additive. It is kept as a
        :class:`pvibr.animation.curves.Curve`: ``layer.weight.go(1.0, at=2.0)`` turns it on.
    mask : array_like, shape (n,), optional
        Factor of each joint, as from :func:`pvibr.animation.blending.joint_mask`; morph weights
        then stay those below.
    reference : Pose, optional
        Makes the layer additive: what counts as no difference.

    Raises
    ------
    ValueError
        If the weight is not finite or outside 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import Pose
    >>> from pvibr.animation.mixer import AnimationLayer, PoseSource
    >>> layer = AnimationLayer(PoseSource(Pose([[4.0, 0.0, 0.0]])), 0.0)
    >>> layer.weight.go(1.0, at=1.0, fade=2.0)
    >>> layer.over(Pose([[0.0, 0.0, 0.0]]), 2.0).translation.tolist()
    [[2.0, 0.0, 0.0]]
    """

    def __init__(self, source, weight=1.0, mask=None, reference=None):
        self.source, self.mask, self.reference = source, mask, reference
        self.weight = weight if isinstance(weight, Curve) else Curve([float(weight)])
        if reference is None:
            unit_range('weight', self.weight.values)

    def over(self, pose, times):
        """Return poses with this layer over them.

        Parameters
        ----------
        pose : Pose
            Of the layers below, of shape ``times.shape``.
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        Pose
            Of shape ``times.shape``.

        Examples
        --------
        >>> from pvibr.animation import Pose
        >>> from pvibr.animation.mixer import AnimationLayer, PoseSource
        >>> layer = AnimationLayer(PoseSource(Pose([[4.0, 0.0, 0.0]])), 0.25)
        >>> layer.over(Pose([[0.0, 0.0, 0.0]]), 1.0).translation.tolist()
        [[1.0, 0.0, 0.0]]
        """
        weight = self.weight.at(times)
        if not np.any(weight):
            return pose
        mine = self.source.sample(times)
        if self.reference is None:
            return crossfade(pose, mine, weight, self.mask)
        return added(pose, difference(mine, self.reference), weight, self.mask)


class Mixer:
    """Layers of movements: run, and fire with the upper body, and look up.

    Parameters
    ----------
    base : object
        Whatever has ``sample(times) -> Pose``.
    *layers : Layer
        What goes over it, in this order.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Pose
    >>> from pvibr.animation.mixer import AnimationLayer, Mixer, PoseSource
    >>> rest, up, right = (Pose([p]) for p in np.array([[0, 0, 0], [0, 0, 1], [2, 0, 0]]))
    >>> mixer = Mixer(
    ...     PoseSource(rest),
    ...     AnimationLayer(PoseSource(right), 0.5),
    ...     AnimationLayer(PoseSource(up), 3.0, reference=rest),
    ... )
    >>> mixer.sample(0.0).translation.tolist()
    [[1.0, 0.0, 3.0]]
    """

    def __init__(self, base, *layers):
        self.base = base
        self.layers = layers

    def __repr__(self):
        return f'Mixer({len(self.layers)} layers over {self.base!r})'

    @property
    def revision(self) -> tuple:
        """What changes when what is shown at the same time may have."""
        return revision_of(self.base, *(layer.source for layer in self.layers))

    def sample(self, times):
        """Return the pose at times.

        Parameters
        ----------
        times : array_like, shape (...)
            Seconds.

        Returns
        -------
        Pose
            Of shape ``times.shape``.

        Examples
        --------
        >>> from pvibr.animation import Pose
        >>> from pvibr.animation.mixer import Mixer, PoseSource
        >>> Mixer(PoseSource(Pose([[0.0, 0.0, 0.0]]))).sample([0.0, 1.0]).shape
        (2,)
        """
        pose = self.base.sample(times)
        for layer in self.layers:
            pose = layer.over(pose, times)
        return pose


def revision_of(*sources) -> tuple:
    """Return what changes when poses of sources at the same time may have."""
    return tuple(getattr(source, 'revision', None) for source in sources)
