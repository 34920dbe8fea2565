"""Sources of poses: clips, clips in step, and layers blended over one another."""

from __future__ import annotations

import numpy as np

from pvibr.animation.blending import (
    PoseSum,
    crossfade,
    difference,
    shares,
    unit_range,
    with_additive,
)
from pvibr.animation.curves import Curve
from pvibr.animation.pose import Pose
from pvibr.core.arguments import checked_positive


class Source:
    """Base of sources of poses over time."""

    def sample(self, times):
        """Return the poses at given times, of shape ``times.shape``.

        Parameters
        ----------
        times : array_like, shape (...)
            Times in seconds.
        """
        return self._sampled(np.asarray(times, dtype=np.float64))

    def _sampled(self, times) -> Pose:
        raise NotImplementedError


class ClipSource(Source):
    """A clip of a figure as a source of poses.

    Parameters
    ----------
    figure : Figure
        The figure.
    clip : str, int or Clip, optional
        Clip to play; default the first one, or the rest pose if the figure has none.
    speed : float
        Clip seconds per second; negative plays backwards.
    offset : float
        Clip time at time 0, in seconds.
    loop : bool or 'pingpong'
        Restart the clip at its end, hold the last pose, or play back and forth.
    root : str or int, optional
        Joint whose translation accumulates over the loops (root motion), so that a walk cycle
        moves forward. Rotation does not accumulate.
    count : float, optional
        Cycles until the last pose is held; a 'pingpong' cycle plays forth and back.

    Raises
    ------
    ValueError
        If the figure has no such clip or joint, or ``count`` is not above 0.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import Clip, ClipSource, FigureMesh
    >>> cube = Figure([FigureMesh(pv.Cube())], clips=[Clip('still', [], duration=3.0)])
    >>> ClipSource(cube, 'still', speed=2.0).duration
    1.5
    """

    def __init__(self, figure, clip=None, speed=1.0, offset=0.0, loop=True, root=None, count=None):
        if count is not None:
            checked_positive('count', count)
        self.figure = figure
        self.clip = figure.clip(clip)
        self.speed, self.offset, self.loop, self.count = speed, offset, loop, count
        if self.clip is not None:
            self.clip.local_time(0.0, loop)  # rejects an invalid loop
        self.root = None if root is None else figure.skeleton.index(root)

    def __repr__(self):
        return f'ClipSource({self.clip!r}, speed={self.speed:g}, loop={self.loop})'

    @property
    def duration(self):
        """Seconds of one cycle; infinite without a clip or at speed 0."""
        if self.clip is None or not self.speed:
            return np.inf
        return self.clip.duration / abs(self.speed)

    @property
    def length(self):
        """Clip seconds that are played until the last pose is held; infinite for a loop."""
        if self.clip is None or (self.loop and self.count is None):
            return np.inf
        cycles = self.count if self.loop else 1
        return cycles * self.clip.duration * (2 if self.loop == 'pingpong' else 1)

    def moves_joints_only(self) -> bool:
        """Return whether it plays a clip that drives only joints, without root motion."""
        return self.clip is not None and self.root is None and self.clip.fits(self.figure.rest)

    def timing(self) -> tuple:
        """Return its speed and offset, and what :meth:`Clip.cycle` returns."""
        return self.speed, self.offset, *self.clip.cycle(self.loop, self.count)

    def _sampled(self, times):
        times = self.offset + self.speed * times
        if self.clip is None:
            return self.figure.sample(times)
        local_times = self.clip.local_time(times, self.loop, self.count)
        pose = self.figure.sample(local_times, self.clip, loop=False)
        if self.root is None or self.loop is not True or not self.clip.duration:
            return pose
        end_poses = self.figure.sample([0.0, self.clip.duration], self.clip, loop=False)
        played_time = times if self.count is None else np.clip(times, 0.0, self.length)
        full_cycles = np.rint((played_time - local_times) / self.clip.duration)
        translation = pose.translation.copy()
        cycle_step = end_poses.translation[1, self.root] - end_poses.translation[0, self.root]
        translation[..., self.root, :] += full_cycles[..., None] * cycle_step
        return pose.replaced(translation=translation)


class PoseSource(Source):
    """A constant pose as a source of poses.

    Parameters
    ----------
    pose : Pose
        A single pose.

    Examples
    --------
    >>> from pvibr.animation import Pose, PoseSource
    >>> PoseSource(Pose([[1.0, 0.0, 0.0]])).sample([0.0, 1.0]).translation.shape
    (2, 1, 3)
    """

    def __init__(self, pose):
        self.pose = pose

    def __repr__(self):
        return f'PoseSource({self.pose.n_joints} joints)'

    def _sampled(self, times):
        pose_sum = PoseSum(times.shape, self.pose)
        pose_sum.add(self.pose, np.ones(()))
        return pose_sum.pose()


class SyncedClips(Source):
    """A blend of clips of different lengths in phase: walk and run with the same foot in front.

    All clips share one phase and are stretched to it. Cycles per second are the weighted mean
    of the clips' own.

    Parameters
    ----------
    figure : Figure
        The figure.
    clips : sequence of str, int or Clip, length k
        Looping clips that start at the same phase.
    weights : array_like, shape (k,) or (f, k)
        Blend weights of the clips, constant or at key times.
    times : array_like, shape (f,), optional
        Key times of the weights in seconds, with linear interpolation. The phase is 0 at the
        first key; at time 0 if the weights are constant.

    Raises
    ------
    ValueError
        If a clip does not exist or has no duration, or weights or times do not fit.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import Clip, FigureMesh, SyncedClips
    >>> clips = [Clip('walk', [], duration=1.0), Clip('run', [], duration=0.5)]
    >>> figure = Figure([FigureMesh(pv.Cube())], clips=clips)
    >>> gait = SyncedClips(figure, ['walk', 'run'], [0.5, 0.5])
    >>> gait.phase(2.0)  # 1.5 cycles per second
    np.float64(3.0)
    """

    def __init__(self, figure, clips, weights, times=None):
        self.figure = figure
        self.clips = tuple(figure.clip(clip) for clip in clips)
        weights = np.atleast_2d(shares(weights))
        if weights.shape[1] != len(self.clips):
            count = len(self.clips)
            raise ValueError(f'weights must have shape (..., {count}), got {weights.shape}')
        self.weights = Curve(weights, times)
        for clip in self.clips:
            if not clip.duration:
                raise ValueError(
                    f'clip {clip.name!r} must have a duration above 0 to be synchronised, got '
                    f'{clip.duration}'
                )
        self._rates = 1 / np.array([clip.duration for clip in self.clips])

    def go(self, weights, at, fade=0.2):
        """Fade to other blend weights; the clips stay in phase.

        Parameters
        ----------
        weights : array_like, shape (k,)
            Blend weights.
        at : float
            Start of the fade in seconds; not before the first key.
        fade : float
            Duration of the fade in seconds, above 0.

        Raises
        ------
        ValueError
            If weights do not fit, or as :meth:`pvibr.animation.Curve.go` does.
        """
        weights = shares(weights)
        if weights.shape != (len(self.clips),):
            raise ValueError(f'weights must have shape ({len(self.clips)},), got {weights.shape}')
        self.weights.go(weights, at, fade)

    def phase(self, times):
        """Return the cycles played since the first key: the integral of the cycles per second.

        Parameters
        ----------
        times : array_like, shape (...)
            Times in seconds.
        """
        return self.weights.integral(times) @ self._rates

    def _sampled(self, times):
        phase = self.phase(times)
        pose_sum = PoseSum(times.shape, self.figure.rest)
        weight_columns = np.moveaxis(self.weights.at(times), -1, 0)
        for clip, clip_weights in zip(self.clips, weight_columns, strict=True):
            if clip_weights.any():
                pose_sum.add(self.figure.sample(phase * clip.duration, clip), clip_weights)
        return pose_sum.pose()


class AnimationLayer:
    """A layer that a mixer blends over the layers below it.

    Parameters
    ----------
    source : object
        Anything with ``sample(times) -> Pose``.
    weight : float or Curve
        Blend weight, 0 to 1, or any number for an additive layer. It is stored as a
        :class:`pvibr.animation.Curve`: ``layer.weight.go(1.0, at=2.0)`` fades the layer in.
    mask : array_like, shape (n,), optional
        Factor per joint, as :func:`pvibr.animation.joint_mask` returns it. With a mask the layer
        leaves morph weights unchanged.
    reference : Pose, optional
        Makes the layer additive: its difference from this pose is added.

    Raises
    ------
    ValueError
        If the weight is not finite or outside 0 to 1.

    Examples
    --------
    >>> from pvibr.animation import AnimationLayer, Pose, PoseSource
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
        """Return poses with this layer blended over them, of shape ``times.shape``.

        Parameters
        ----------
        pose : Pose
            Poses of the layers below, of shape ``times.shape``.
        times : array_like, shape (...)
            Times in seconds.
        """
        weight = self.weight.at(times)
        if not np.any(weight):
            return pose
        layer_pose = self.source.sample(times)
        if self.reference is None:
            return crossfade(pose, layer_pose, weight, self.mask)
        return with_additive(pose, difference(layer_pose, self.reference), weight, self.mask)


class Mixer(Source):
    """A stack of animation layers: run, fire with the upper body, look up.

    Parameters
    ----------
    base : object
        Anything with ``sample(times) -> Pose``.
    *layers : AnimationLayer
        Layers over the base, lowest first.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import AnimationLayer, Mixer, Pose, PoseSource
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
        """Changes when the poses at the same times may have changed."""
        return revision_of(self.base, *(layer.source for layer in self.layers))

    def _sampled(self, times):
        pose = self.base.sample(times)
        for layer in self.layers:
            pose = layer.over(pose, times)
        return pose


def revision_of(*sources) -> tuple:
    """Return a key that changes when the poses of sources at the same times may have changed."""
    return tuple(getattr(source, 'revision', None) for source in sources)
