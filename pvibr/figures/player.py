"""The pose of a figure over time: clips, drivers, and poses and weights set by hand."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from pvibr.animation.blending import crossfade
from pvibr.animation.ensemble import Ensemble
from pvibr.animation.figure import Figure
from pvibr.animation.mixer import ClipSource, PoseSource, revision_of
from pvibr.animation.pose import Pose
from pvibr.core.arguments import checked_number, naming
from pvibr.core.errors import warn
from pvibr.core.params import Param
from pvibr.maths.transforms import signs_of
from pvibr.things.thing import Thing


@dataclass(frozen=True, eq=False)
class Moment:
    """A pose of a figure: world matrices (n, 4, 4), signs of their determinants, and bounds.

    World matrices and signs may be those of many poses, (..., n, 4, 4) and (..., n).
    """

    pose: Pose | np.ndarray
    world: np.ndarray
    signs: np.ndarray
    bounds: np.ndarray

    @classmethod
    def of(cls, figure, pose, skinning):
        """Return the moment of a pose."""
        figure_from_joint = figure.world(pose)
        # If only joints move the vertices, the world matrices give the bounds.
        is_still = not any(m.frames or m.morphs for m in figure.meshes) and not figure.correctives
        bounds = figure.bounds(figure_from_joint if is_still else pose, skinning)
        return cls(pose, figure_from_joint, signs_of(figure_from_joint), np.asarray(bounds, float))

    @cached_property
    def origin(self) -> np.ndarray:
        """Origin of positions on the GPU, shape (3,)."""
        return (self.bounds[::2] + self.bounds[1::2]) / 2


class _Fade:
    """A cross-fade from one source of poses to another."""

    def __init__(self, before, after, start, seconds):
        self.before, self.after, self.start, self.seconds = before, after, start, seconds

    @property
    def revision(self):
        return revision_of(self.before, self.after)

    def sample(self, time):
        fade_share = (time - self.start) / self.seconds
        if fade_share >= 1:
            return self.after.sample(time)
        return crossfade(self.before.sample(time), self.after.sample(time), max(fade_share, 0.0))


class FigurePlayer(Thing):
    """Base of animated figures: the pose over time, without drawing.

    Parameters are those of :class:`pvibr.AnimatedActor`.
    """

    skinning = Param(
        'linear',
        "'linear' blending is cheapest; 'dual' quaternions keep the volume of twisted limbs.",
        choices=('linear', 'dual'),
    )
    bulge = Param(
        1.0,
        "How far 'dual' skinning replaces 'linear': 1 keeps the cross-section of twists; lower it "
        'where bent joints bulge.',
        range='[0, 1]',
    )

    _changes = 0
    _moment: Moment | None = None
    _shown_key: tuple = ()
    _weights: np.ndarray | None = None
    #: Figures that are posed together; held by the first of them.
    ensemble: Ensemble | None = None
    _fixed: Pose | np.ndarray | None = None
    #: End of the clip, and its callback.
    _finish: tuple | None = None

    def __init__(self, figure, clip=None, **settings):
        super().__init__(**settings)
        self._figure = figure
        self.driver = ClipSource(figure, clip)

    @property
    def figure(self) -> Figure:
        """The figure."""
        return self._figure

    @property
    def driver(self):
        """Source of poses: anything with ``sample(time) -> Pose``, or None for a fixed pose.

        If it has a ``revision``, it is sampled again when that changes at the same time.
        """
        return self._driver

    @driver.setter
    def driver(self, driver):
        if driver is not None and not callable(getattr(driver, 'sample', None)):
            raise TypeError(f'driver must have sample(time) -> Pose, got {driver!r}')
        if driver is None:
            self._fixed = self.pose
        self._driver, self._finish = driver, None
        self._show_anew()

    def _call_finished(self):
        """Call ``on_finished`` once when the clip has ended."""
        if self._finish is not None and self._now() >= self._finish[0]:
            (_, call), self._finish = self._finish, None
            try:
                call(self)
            except Exception as error:  # noqa: BLE001, RUF100
                warn(f'on_finished of {self.name} raised {type(error).__name__}: {error}')

    def play(
        self,
        clip=None,
        *,
        speed=1.0,
        loop=True,
        count=None,
        fade=0.0,
        start=None,
        root=None,
        on_finished=None,
    ):
        """Play a clip.

        Parameters
        ----------
        clip : str, int or Clip, optional
            Name, index or clip; default the first one.
        speed : float
            Clip seconds per second; negative plays backwards.
        loop : bool or 'pingpong'
            Restart the clip at its end, hold its last pose, or play back and forth.
        count : float, optional
            Cycles until the last pose is held; a 'pingpong' cycle plays forth and back.
        fade : float
            Seconds of the cross-fade from the current animation.
        start : float, optional
            Time at which the clip starts, in seconds of ``plotter.ibr.time``; default now.
        root : str or int, optional
            Joint whose translation accumulates over the loops (root motion): a walk moves on.
        on_finished : callable, optional
            Called once with the actor, before the first frame at or after the end; it may play
            another clip. Playing another clip earlier cancels it. Its errors become warnings.

        Raises
        ------
        TypeError
            If ``on_finished`` is not callable, or speed, start or fade is not a number.
        ValueError
            If there is no such clip, joint or loop, the speed or the start is not finite, the fade
            is negative or the count is not above 0, or ``on_finished`` is given without an end.
        """
        speed, fade = checked_number('speed', speed), checked_number('fade', fade, 0)
        if on_finished is not None and not callable(on_finished):
            raise TypeError(f'on_finished must be callable, with the actor, got {on_finished!r}')
        now = self._now()
        start = now if start is None else checked_number('start', start)
        source = ClipSource(self.figure, clip, speed, -start * speed, loop, root, count)
        if speed < 0 and np.isfinite(source.length):
            source.offset += source.length  # backwards from its end
        end_time = start + source.length / abs(speed) if speed else np.inf
        if on_finished is not None and not np.isfinite(end_time):
            raise ValueError(
                'on_finished must have an end, got endless play: give loop=False or a count, '
                'and a speed'
            )
        self.driver = _Fade(self._source(), source, now, fade) if fade else source
        self._finish = None if on_finished is None else (end_time, on_finished)

    def _source(self):
        """Return the source of poses, also of a fixed one."""
        driver = self._driver
        if isinstance(driver, _Fade) and self._now() >= driver.start + driver.seconds:
            return driver.after
        if driver is not None:
            return driver
        return PoseSource(self._as_pose(self._fixed))

    def _as_pose(self, pose) -> Pose:
        if isinstance(pose, Pose):
            return pose
        return Pose.from_matrices(self.figure.skeleton.local(pose), self.figure.rest.weights)

    def stop(self):
        """Hold the current pose."""
        self.driver = None

    @property
    def pose(self):
        """The current pose: a Pose, or ``figure_from_joint`` matrices (n, 4, 4) of a simulator.

        Setting it replaces the driver.
        """
        return self._current_moment().pose

    @pose.setter
    def pose(self, pose):
        if not isinstance(pose, Pose):
            with naming('pose', pose):
                pose = np.array(pose, np.float64)
        self.figure.world(pose)
        if isinstance(pose, Pose) and not pose.shape:
            pose = self._with_weights(pose)
        shape = pose.shape if isinstance(pose, Pose) else pose.shape[:-3]
        if shape:
            raise ValueError(f'pose must be a single pose, got {shape} poses')
        self._driver, self._fixed, self._finish = None, pose, None
        self._show_anew()

    def _with_weights(self, pose):
        """Return a pose with morph weights; default those at rest."""
        rest_weights, pose_weights = self.figure.rest.weights, pose.weights
        if pose_weights.shape == rest_weights.shape:
            return pose
        if not pose_weights.size:
            return pose.replaced(weights=rest_weights)
        raise ValueError(
            f'pose must have {rest_weights.shape[-1]} morph weights, got {pose_weights.shape[-1]}'
        )

    @property
    def weights(self):
        """Morph weights of all meshes, shape (t,); once set they override clips, until None."""
        return getattr(self.pose, 'weights', self.figure.rest.weights)

    @weights.setter
    def weights(self, weights):
        if weights is not None:
            with naming('weights', weights):
                weights = np.array(weights, np.float64)
            weight_shape = self.figure.rest.weights.shape
            if weights.shape != weight_shape or not np.isfinite(weights).all():
                raise ValueError(
                    f'weights must be finite numbers of shape {weight_shape}, or None, got '
                    f'{weights!r}'
                )
        self._weights = weights
        self._show_anew()

    @classmethod
    def follow_all(cls, things):
        """Update the poses of many, together where only joints move the points."""
        pose_together(things, things[0].pipeline.time)

    def late_pose(self):
        """Return the pose, or its :class:`ClipSource`, and a callback that shows its moment.

        None if the pose is up to date.
        """
        pose_key = self._pose_key()
        if pose_key == self._shown_key:
            return None
        show_moment, driver = partial(self._become, pose_key), self._driver
        joints_only = self._weights is None and self.figure.joint_boxes[self.skinning] is not None
        if joints_only and type(driver) is ClipSource and driver.moves_joints_only():
            return driver, show_moment
        return self._sampled(self._now()), show_moment

    def follow(self):
        """Update the pose, so that bounds are right before drawing."""
        if self.pipeline is not None:
            with suppress(Exception):
                self._current_moment()

    def _show_anew(self):
        self._shown_key = ()
        self.follow()

    def _current_moment(self) -> Moment:
        """Return the moment of the current time."""
        pose_key = self._pose_key()
        if self._moment is None or pose_key != self._shown_key:
            pose = self._sampled(self._now())
            return self._become(pose_key, Moment.of(self.figure, pose, self.skinning))
        return self._moment

    def _become(self, pose_key, moment) -> Moment:
        self._moment = moment
        self._changes += 1
        self._show(moment)
        self._shown_key = pose_key
        return moment

    def _pose_key(self) -> tuple:
        """Return what the pose and its bounds depend on."""
        driver = self._driver
        if driver is None:
            return None, self.skinning
        return self._now(), getattr(driver, 'revision', None), self.skinning

    def _sampled(self, time):
        pose = self._fixed if self._driver is None else self._driver.sample(time)
        if isinstance(pose, Pose):
            pose = self._with_weights(pose)
        if self._weights is None:
            return pose
        return self._as_pose(pose).replaced(weights=self._weights)

    def _show(self, moment):
        """Move the actors to a moment."""


def pose_together(players, time):
    """Update poses to a time, together where only joints move points; skip those that fail."""
    late_players = []
    for player in players:
        with suppress(Exception):
            late_pose = player.late_pose()
            if late_pose is None:
                continue
            pose, show_moment = late_pose
            figure, skinning_mode = player.figure, player.skinning
            if figure.joint_boxes[skinning_mode] is None or isinstance(pose, np.ndarray):
                show_moment(Moment.of(figure, pose, skinning_mode))
            else:
                late_players.append((player, pose, show_moment))
    if not late_players:
        return
    first_player = late_players[0][0]
    members = [(p.figure, p.skinning, getattr(pose, 'clip', None)) for p, pose, _ in late_players]
    if first_player.ensemble is None or first_player.ensemble.members != members:
        first_player.ensemble = Ensemble(members)
    new_moments = first_player.ensemble.posed([pose for _, pose, _ in late_players], time)
    for (_, _, show_moment), moment in zip(late_players, new_moments, strict=True):
        with suppress(Exception):
            show_moment(Moment(*moment))
