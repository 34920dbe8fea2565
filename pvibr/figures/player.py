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
from pvibr.core.errors import warn
from pvibr.core.params import Param
from pvibr.maths.arguments import checked_number, naming
from pvibr.maths.transforms import signs_of
from pvibr.scene.thing import Thing


@dataclass(frozen=True, eq=False)
class Moment:
    """A pose of a figure: world matrices (n, 4, 4), signs of their determinants, and bounds."""

    pose: Pose | np.ndarray
    world: np.ndarray
    signs: np.ndarray
    bounds: np.ndarray

    @classmethod
    def of(cls, figure, pose, skinning):
        """Return the moment of a pose."""
        world = figure.world(pose)
        # If only joints move the vertices, the world matrices give the bounds.
        still = not any(m.frames or m.morphs for m in figure.meshes) and not figure.correctives
        bounds = figure.bounds(world if still else pose, skinning)
        return cls(pose, world, signs_of(world), np.asarray(bounds, float))

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
        share = (time - self.start) / self.seconds
        if share >= 1:
            return self.after.sample(time)
        return crossfade(self.before.sample(time), self.after.sample(time), max(share, 0.0))


class FigurePlayer(Thing):
    """Base of animated figures: the pose over time, without drawing.

    Parameters are those of :class:`pvibr.AnimatedActor`.
    """

    skinning = Param(
        'linear', 'Linear blend or dual quaternion skinning.', choices=('linear', 'dual')
    )
    bulge = Param(
        1.0,
        'Share of dual quaternions: 1 keeps the cross-section of a twist, less bulges less.',
        range='[0, 1]',
    )

    _changes = 0
    _moment: Moment | None = None
    _known: tuple = ()
    _weights: np.ndarray | None = None
    #: Of the figures that were posed together with this one, if it is their first.
    ensemble: Ensemble | None = None
    _fixed: Pose | np.ndarray | None = None
    #: When the clip ends, and what is called then.
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
            raise TypeError(f'driver = {driver!r}: must have sample(time) -> Pose')
        if driver is None:
            self._fixed = self.pose
        self._driver, self._finish = driver, None
        self._show_anew()

    def _call_finished(self):
        """Tell who asked for it that the clip has ended, once."""
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
            Restart the clip at its end, hold its last pose, or go there and back.
        count : float, optional
            Cycles until the last pose is held; a cycle of 'pingpong' goes there and back.
        fade : float
            Seconds of the cross-fade from the current animation.
        start : float, optional
            Time at which the clip starts, in seconds of ``plotter.ibr.time``; default now.
        root : str or int, optional
            Joint whose translation accumulates over the loops (root motion): a walk moves on.
        on_finished : callable, optional
            Called with the actor before the first frame at or after the end, once; it may play
            another clip. Playing another clip before cancels it. What it raises is a warning.

        Raises
        ------
        TypeError
            If ``on_finished`` is not callable, or the speed, the start or the fade is no number.
        ValueError
            If there is no such clip, joint or loop, the speed or the start is not finite, the fade
            is negative or the count is not above 0, or ``on_finished`` is given without an end.
        """
        speed, fade = checked_number('speed', speed), checked_number('fade', fade, 0)
        if on_finished is not None and not callable(on_finished):
            raise TypeError(f'on_finished = {on_finished!r}: must be callable, with the actor')
        now = self._now()
        start = now if start is None else checked_number('start', start)
        played = ClipSource(self.figure, clip, speed, -start * speed, loop, root, count)
        if speed < 0 and np.isfinite(played.length):
            played.offset += played.length  # backwards from its end
        end = start + played.length / abs(speed) if speed else np.inf
        if on_finished is not None and not np.isfinite(end):
            raise ValueError('on_finished needs an end: give loop=False or a count, and a speed')
        self.driver = _Fade(self._source(), played, now, fade) if fade else played
        self._finish = None if on_finished is None else (end, on_finished)

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
        return self._now_shown().pose

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
            raise ValueError(f'pose holds {shape} poses; it must be a single one')
        self._driver, self._fixed, self._finish = None, pose, None
        self._show_anew()

    def _with_weights(self, pose):
        """Return a pose with morph weights; default those at rest."""
        wanted, found = self.figure.rest.weights, pose.weights
        if found.shape == wanted.shape:
            return pose
        if not found.size:
            return pose.replaced(weights=wanted)
        raise ValueError(
            f'the pose has {found.shape[-1]} morph weights, the figure {wanted.shape[-1]}'
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
            wanted = self.figure.rest.weights.shape
            if weights.shape != wanted or not np.isfinite(weights).all():
                raise ValueError(
                    f'weights = {weights!r}: must be finite numbers of shape {wanted}, or None'
                )
        self._weights = weights
        self._show_anew()

    @classmethod
    def follow_all(cls, things):
        """Update the poses of many, together where only joints move the points."""
        pose_together(things, things[0].pipeline.time)

    def late_pose(self):
        """Return the pose if it is not shown yet, and what shows its moment; else None.

        In place of the pose, it may be the source of the clip that gives it.
        """
        asked = self._asked()
        if asked == self._known:
            return None
        show, driver = partial(self._become, asked), self._driver
        together = self._weights is None and self.figure.joint_boxes[self.skinning] is not None
        if together and type(driver) is ClipSource and driver.moves_joints_only():
            return driver, show
        return self._sampled(self._now()), show

    def follow(self):
        """Update the pose, so that bounds are right before drawing."""
        if self.pipeline is not None:
            with suppress(Exception):
                self._now_shown()

    def _show_anew(self):
        self._known = ()
        self.follow()

    def _now_shown(self) -> Moment:
        """Return the moment of the current time."""
        known = self._asked()
        if self._moment is None or known != self._known:
            pose = self._sampled(self._now())
            return self._become(known, Moment.of(self.figure, pose, self.skinning))
        return self._moment

    def _become(self, known, moment) -> Moment:
        self._moment = moment
        self._changes += 1
        self._show(moment)
        self._known = known
        return moment

    def _asked(self) -> tuple:
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
    """Update poses to a time, together where only joints move the points; those that fail stay."""
    alike = []
    for player in players:
        with suppress(Exception):
            late = player.late_pose()
            if late is None:
                continue
            pose, show = late
            figure, how = player.figure, player.skinning
            if figure.joint_boxes[how] is None or isinstance(pose, np.ndarray):
                show(Moment.of(figure, pose, how))
            else:
                alike.append((player, pose, show))
    if not alike:
        return
    first = alike[0][0]
    members = [(p.figure, p.skinning, getattr(pose, 'clip', None)) for p, pose, _ in alike]
    if first.ensemble is None or first.ensemble.members != members:
        first.ensemble = Ensemble(members)
    moved = first.ensemble.moved([pose for _, pose, _ in alike], time)
    for (_, _, show), moment in zip(alike, moved, strict=True):
        with suppress(Exception):
            show(Moment(*moment))
