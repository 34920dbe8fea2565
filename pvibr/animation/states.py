"""States of a figure - standing, running, falling - and the fades between them."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from pvibr.animation.blending import PoseSum
from pvibr.animation.mixer import Source
from pvibr.animation.pose import Pose
from pvibr.core.arguments import check_finite, checked_number


class Visit(NamedTuple):
    """A stay in a state: name, beginning and fade-in time in seconds."""

    name: str
    begin: float
    fade: float


class States:
    """Base of state machines: orders over time, and the visits to states that follow from them.

    Parameters are those of :class:`pvibr.animation.StateGraph`.
    """

    #: True if the clocks of both states stand still during a fade.
    _holds = False

    def __init__(
        self,
        states,
        start=None,
        *,
        fade=0.2,
        fades=None,
        then=None,
        rules=(),
        parameters=None,
        smooth=False,
    ):
        self.states = dict(states)
        if not self.states:
            raise ValueError('states must hold at least one state, got none')
        self.start = self._checked(next(iter(self.states)) if start is None else start)
        self.fade = checked_number('fade', fade, 0)
        self.fades = {
            (self._checked(a), self._checked(b)): checked_number('fades', seconds, 0)
            for (a, b), seconds in (fades or {}).items()
        }
        self.then = {self._self_ending(a, b): self._checked(b) for a, b in (then or {}).items()}
        check = self._checked
        self.rules = tuple((a and check(a), check(b), when) for a, b, when in rules)
        self.parameters = dict(parameters or {})
        self.smooth = bool(smooth)
        #: The time sampled last: the default time of orders.
        self.time = 0.0
        self._orders: list = []
        self._visits: list[Visit] = []
        self._table: tuple = ()
        self._good_until = -np.inf

    def __repr__(self):
        return f'{type(self).__name__}({", ".join(self.states)})'

    @property
    def revision(self) -> int:
        """Changes when the poses at the same times may have changed."""
        return len(self._orders)

    def go(self, state, at=None, fade=None):
        """Request a change of state; no effect if the state is the current one.

        Parameters
        ----------
        state : str
            Next state.
        at : float, optional
            Time of the request in seconds; default the time sampled last.
        fade : float, optional
            Duration of the fade in seconds; default that of the graph.

        Raises
        ------
        ValueError
            If the state is unknown, the time is not finite or the fade is negative.
        """
        fade = None if fade is None else checked_number('fade', fade, 0)
        self._order(at, (self._checked(state), fade))

    def set(self, at=None, **parameters):
        """Set parameters of the rules.

        Parameters
        ----------
        at : float, optional
            Time from which they hold, in seconds; default the time sampled last.
        **parameters
            New values.

        Raises
        ------
        ValueError
            If the time is not finite.
        """
        self._order(at, parameters)

    def visits(self, until):
        """Return the visits to states up to a time, in order: ``(name, begin, fade)``.

        Parameters
        ----------
        until : float
            Time in seconds.

        Raises
        ------
        ValueError
            If rules form a cycle.
        """
        if until >= self._good_until:
            self._visits, self._good_until = self._replayed(until)
            names, begins, fades = zip(*self._visits, strict=True)
            stops = *begins[1:], np.inf
            self._table = tuple(np.array(column) for column in (names, begins, fades, stops))
        # The first visit has no beginning.
        return self._visits[: bisect_right(self._visits, until, lo=1, key=lambda v: v.begin)]

    def state(self, time):
        """Return the name of the state at a time; during a fade, of the next state.

        Parameters
        ----------
        time : float
            Time in seconds.
        """
        return self.visits(time)[-1].name

    def _order(self, at, order):
        at = self.time if at is None else checked_number('at', at)
        self._orders.append((at, order))
        self._orders.sort(key=lambda timed: timed[0])  # stable: equal times keep their order
        self._good_until = -np.inf

    def _replayed(self, until):
        """Return all visits up to a time, and the time up to which they are complete."""
        visits, parameters = [Visit(self.start, 0.0, 0.0)], dict(self.parameters)
        self._obey_rules(visits, 0.0, parameters)
        for order_time, order in self._orders:
            self._run_out(visits, order_time, parameters)
            if isinstance(order, dict):
                parameters.update(order)
                self._obey_rules(visits, order_time, parameters)
            else:
                self._arrive(visits, order[0], order_time, parameters, order[1])
        # Orders later than the time are replayed too.
        return visits, self._run_out(visits, until, parameters)

    def _run_out(self, visits, until, parameters):
        """Follow the transitions of states that ended; return the time of the next one."""
        while visits[-1].name in self.then:
            name = visits[-1].name
            begin = visits[-1].begin + (visits[-1].fade if self._holds else 0.0)
            end = begin + self.states[name].duration
            if end > until:
                return end
            self._arrive(visits, self.then[name], end, parameters)
        return np.inf

    def _arrive(self, visits, name, at, parameters, fade=None):
        self._enter(visits, name, at, fade)
        self._obey_rules(visits, at, parameters)

    def _enter(self, visits, name, at, fade=None):
        last = visits[-1].name
        if name != last:
            fade = self.fades.get((last, name), self.fade) if fade is None else fade
            visits.append(Visit(name, at, fade))

    def _obey_rules(self, visits, at, parameters):
        visited_states = [visits[-1].name]
        while (name := self._ruled(visited_states[-1], parameters)) is not None:
            if name in visited_states:
                cycle = ' -> '.join([*visited_states, name])
                raise ValueError(f'rules must not form a cycle, got {cycle} with {parameters}')
            visited_states.append(name)
            self._enter(visits, name, at)

    def _ruled(self, state, parameters):
        for source, target, when in self.rules:
            if source in (state, None) and target != state and when(parameters):
                return target
        return None

    def _visible_states(self, times):
        """Return the visible states at times (t,): names, time indices, clocks and weights."""
        check_finite('times', times)
        self.time = float(times.max(initial=-np.inf)) if times.size else self.time
        self.visits(self.time)
        names, begins, fades, stops = self._table
        visits = np.searchsorted(begins[1:], times, side='right')  # the first has no beginning
        remaining, visible_states = np.ones(len(times)), []
        # From the top visit down, until the visits below are hidden.
        while (samples := np.flatnonzero((remaining > 0) & (visits >= 0))).size:
            visit = visits[samples]
            now = np.minimum(times[samples], stops[visit]) if self._holds else times[samples]
            weight = self._weights(now - begins[visit], fades[visit])
            weight = np.where(visit == 0, 1.0, np.where(begins[visit] < stops[visit], weight, 0.0))
            clocks = now - begins[visit] - (fades[visit] if self._holds else 0.0)
            clocks = np.where(self._holds & (visit > 0), np.maximum(clocks, 0.0), clocks)
            share = remaining[samples] * weight
            for name in dict.fromkeys(names[visit]):
                mine = np.flatnonzero((names[visit] == name) & (share > 0))
                if mine.size:
                    visible_states.append((str(name), samples[mine], clocks[mine], share[mine]))
            remaining[samples] *= 1 - weight
            visits -= 1
        return visible_states[::-1]

    def _weights(self, elapsed_times, fades):
        """Return the blend weights of states some time after their fade began."""
        weights = np.clip(elapsed_times / np.where(fades > 0, fades, 1.0), 0.0, 1.0)
        weights = np.where(fades > 0, weights, elapsed_times >= 0)
        return weights**2 * (3 - 2 * weights) if self.smooth else weights

    def _checked(self, name):
        if name not in self.states:
            names = ', '.join(map(repr, self.states))
            raise ValueError(f'state must be one of {names}, got {name!r}')
        return name

    def _self_ending(self, name, next_state):
        duration = getattr(self.states[self._checked(name)], 'duration', np.inf)
        if not 0 < duration < np.inf:
            raise ValueError(
                f'duration of state {name!r} must be above 0 and finite to end by '
                f'itself, got {duration}'
            )
        if name == next_state:
            raise ValueError(
                f'then must lead to another state, got {name!r} after itself; use a looping clip'
            )
        return name


class StateGraph(States, Source):
    """States of a figure, each an animation, with cross-fades between them.

    Both animations keep playing during a fade. A fade that is interrupted continues below the
    new one, so that poses never jump.

    Parameters
    ----------
    states : dict of str to object
        Anything with ``sample(times) -> Pose``, as :class:`pvibr.animation.ClipSource`. A state's
        clock starts when the fade into it begins.
    start : str, optional
        State at time 0 and before; default the first one.
    fade : float
        Default duration of a fade in seconds.
    fades : dict of (str, str) to float, optional
        Durations of single transitions.
    then : dict of str to str, optional
        Next state after one cycle of a state that has a ``duration``.
    rules : sequence of (str or None, str, callable), optional
        From state (None: any), to state, and a predicate of the parameters dict. Rules are checked
        when parameters are set and when a state is entered; the first that holds wins.
    parameters : dict, optional
        Initial values of the parameters.
    smooth : bool
        Ease fades in and out.

    Raises
    ------
    ValueError
        If a state is unknown, cannot end although ``then`` names it, or a fade is negative.

    Examples
    --------
    >>> from pvibr.animation import Pose, PoseSource, StateGraph
    >>> low, high = PoseSource(Pose([[0.0, 0.0, 0.0]])), PoseSource(Pose([[0.0, 0.0, 1.0]]))
    >>> graph = StateGraph(
    ...     {'crouch': low, 'stand': high},
    ...     fade=2.0,
    ...     rules=[('crouch', 'stand', lambda p: p['rise'])],
    ...     parameters={'rise': False},
    ... )
    >>> graph.set(at=1.0, rise=True)  # or graph.go('stand', at=1.0)
    >>> graph.sample([1.0, 1.5, 9.0]).translation[:, 0, 2].tolist()
    [0.0, 0.25, 1.0]
    >>> graph.state(0.5), graph.state(1.5)
    ('crouch', 'stand')
    """

    def _sampled(self, times):
        pose_sum = None
        for name, time_indices, clocks, state_weight in self._visible_states(times.reshape(-1)):
            pose = self.states[name].sample(clocks)
            pose_sum = PoseSum((times.size,), pose) if pose_sum is None else pose_sum
            pose_sum.add(pose, state_weight, where=time_indices)
        if pose_sum is None:
            return self.states[self.start].sample(times)
        return _reshaped(pose_sum.pose(), times.shape)


def _reshaped(pose, shape):
    """Return poses (t,) reshaped."""
    parts = pose.translation, pose.rotation, pose.scale, pose.weights, pose.time
    return Pose(*(part.reshape((*shape, *part.shape[1:])) for part in parts))
