"""States of a figure - standing, running, falling - and the way from one to another."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from pvibr.animation.blending import PoseSum
from pvibr.animation.pose import Pose


class Visit(NamedTuple):
    """One stay in a state."""

    name: str
    begin: float
    fade: float


class States:
    """Orders, and the visits to states that follow from them.

    Parameters
    ----------
    states : dict of str to source
        What is shown in each state.
    start : str, optional
        State at time 0 and before; default the first one.
    fade : float
        Seconds from one state to another.
    fades : dict of (str, str) to float, optional
        Seconds for some ways.
    then : dict of str to str, optional
        Where it goes by itself when a state, with a ``duration``, has been played once.
    rules : sequence of (str or None, str, callable), optional
        From (None: from any), to, and a function of the parameters, a dict, that says whether to
        go; asked when parameters are set and when a state is reached. The first that holds wins.
    parameters : dict, optional
        Values of the parameters at the start.
    smooth : bool
        Begin and end fades gently.

    Raises
    ------
    ValueError
        If a state is not known or has no end where one is needed, or a fade is negative.

    See Also
    --------
    StateGraph : States of poses.
    pvibr.animation.vertex_animation_states.VertexAnimationStates : States of key frames.

    Examples
    --------
    >>> from pvibr.animation.states import States
    >>> states = States(
    ...     {'stand': 'a', 'run': 'b'},
    ...     rules=[('stand', 'run', lambda p: p['go'])],
    ...     parameters={'go': False},
    ... )
    >>> states.set(at=3.0, go=True)
    >>> states.state(2.0), states.state(4.0)
    ('stand', 'run')
    """

    #: Whether clocks of states stand still on the way from one to the next.
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
            msg = 'states is empty; there must be at least one.'
            raise ValueError(msg)
        self.start = self._known(next(iter(self.states)) if start is None else start)
        self.fade = _seconds('fade', fade)
        self.fades = {
            (self._known(a), self._known(b)): _seconds('fades', seconds)
            for (a, b), seconds in (fades or {}).items()
        }
        self.then = {self._ending(a, b): self._known(b) for a, b in (then or {}).items()}
        self.rules = tuple((a and self._known(a), self._known(b), when) for a, b, when in rules)
        self.parameters = dict(parameters or {})
        self.smooth = bool(smooth)
        #: The time that was asked for last: now, for orders that name none.
        self.time = 0.0
        self._orders: list = []
        self._visits: list[Visit] = []
        self._table: tuple = ()
        self._good_until = -np.inf

    def __repr__(self):
        return f'{type(self).__name__}({", ".join(self.states)})'

    @property
    def revision(self) -> int:
        """What changes when what is shown at the same time may have."""
        return len(self._orders)

    def go(self, state, at=None, fade=None):
        """Give the order to go to a state; nothing happens if it is in it.

        Parameters
        ----------
        state : str
            Where to.
        at : float, optional
            When, in seconds; default the time that was asked for last.
        fade : float, optional
            Seconds that the way takes; default that of the graph.

        Raises
        ------
        ValueError
            If there is no such state, or a time is not finite or the fade is negative.

        Examples
        --------
        >>> from pvibr.animation.states import States
        >>> states = States({'stand': 'a', 'run': 'b'})
        >>> states.go('run', at=2.0, fade=0.5)
        >>> states.state(2.0)
        'run'
        """
        fade = None if fade is None else _seconds('fade', fade)
        self._order(at, (self._known(state), fade))

    def set(self, at=None, **parameters):
        """Set parameters, on which rules depend.

        Parameters
        ----------
        at : float, optional
            From when on, in seconds; default the time that was asked for last.
        **parameters
            Their new values.

        Raises
        ------
        ValueError
            If the time is not finite.

        Examples
        --------
        >>> from pvibr.animation.states import States
        >>> states = States({'stand': 'a', 'run': 'b'}, rules=[(None, 'run', lambda p: p)])
        >>> states.set(at=2.0, speed=3.0)
        >>> states.state(2.0)
        'run'
        """
        self._order(at, parameters)

    def visits(self, until):
        """Return the states that have been gone to.

        Parameters
        ----------
        until : float
            Time in seconds.

        Returns
        -------
        list of Visit
            In order of time; the first is the start.

        Raises
        ------
        ValueError
            If rules lead from state to state without an end.

        Examples
        --------
        >>> from pvibr.animation.states import States
        >>> States({'stand': 'a', 'run': 'b'}).visits(9.0)
        [Visit(name='stand', begin=0.0, fade=0.0)]
        """
        if until >= self._good_until:
            self._visits, self._good_until = self._replayed(until)
            names, begins, fades = zip(*self._visits, strict=True)
            stops = (*begins[1:], np.inf)
            self._table = tuple(np.array(column) for column in (names, begins, fades, stops))
        # The first one is there at all times.
        return self._visits[: bisect_right(self._visits, until, lo=1, key=lambda v: v.begin)]

    def state(self, time):
        """Return the state at a time; on the way to one, that one.

        Parameters
        ----------
        time : float
            Time in seconds.

        Returns
        -------
        str
            Its name.

        Examples
        --------
        >>> from pvibr.animation.states import States
        >>> States({'stand': 'a', 'run': 'b'}, 'run').state(0.0)
        'run'
        """
        return self.visits(time)[-1].name

    def _order(self, at, order):
        at = self.time if at is None else float(at)
        if not np.isfinite(at):
            msg = f'at is {at}; it must be finite.'
            raise ValueError(msg)
        self._orders.append((at, order))
        self._orders.sort(key=lambda timed: timed[0])  # stable: equal times in order given
        self._good_until = -np.inf

    def _replayed(self, until):
        """Return all visits until a time, and the time until which these are all."""
        visits, parameters = [Visit(self.start, 0.0, 0.0)], dict(self.parameters)
        self._obey_rules(visits, 0.0, parameters)
        for at, order in self._orders:
            self._run_out(visits, at, parameters)
            if isinstance(order, dict):
                parameters.update(order)
                self._obey_rules(visits, at, parameters)
            else:
                self._arrive(visits, order[0], at, parameters, order[1])
        # Orders may lie ahead of the time, and are played all the same.
        return visits, self._run_out(visits, until, parameters)

    def _run_out(self, visits, until, parameters):
        """Go on where a state has come to its end; return when the next one will."""
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
        seen = [visits[-1].name]
        while (name := self._ruled(seen[-1], parameters)) is not None:
            if name in seen:
                msg = f'rules go round: {" -> ".join([*seen, name])} with {parameters}.'
                raise ValueError(msg)
            seen.append(name)
            self._enter(visits, name, at)

    def _ruled(self, state, parameters):
        for source, target, when in self.rules:
            if source in (state, None) and target != state and when(parameters):
                return target
        return None

    def _shown(self, times):
        """Return what is shown at times (t,): names, indices of times, clocks, shares."""
        if not np.isfinite(times).all():
            msg = 'times must be finite.'
            raise ValueError(msg)
        self.time = float(times.max(initial=-np.inf)) if times.size else self.time
        self.visits(self.time)
        names, begins, fades, stops = self._table
        visit = np.searchsorted(begins[1:], times, side='right')  # the first is there before all
        left, shown = np.ones(len(times)), []
        # From what is on top down, until what is below is hidden.
        while (seen := np.flatnonzero((left > 0) & (visit >= 0))).size:
            i = visit[seen]
            now = np.minimum(times[seen], stops[i]) if self._holds else times[seen]
            weight = self._weights(now - begins[i], fades[i])
            weight = np.where(i == 0, 1.0, np.where(begins[i] < stops[i], weight, 0.0))
            clocks = now - begins[i] - (fades[i] if self._holds else 0.0)
            clocks = np.where(self._holds & (i > 0), np.maximum(clocks, 0.0), clocks)
            share = left[seen] * weight
            for name in dict.fromkeys(names[i]):
                mine = np.flatnonzero((names[i] == name) & (share > 0))
                if mine.size:
                    shown.append((str(name), seen[mine], clocks[mine], share[mine]))
            left[seen] *= 1 - weight
            visit -= 1
        return shown[::-1]

    def _weights(self, since, fades):
        """Return how much is there of states that have been gone to for some time."""
        weights = np.clip(since / np.where(fades > 0, fades, 1.0), 0.0, 1.0)
        weights = np.where(fades > 0, weights, since >= 0)
        return weights**2 * (3 - 2 * weights) if self.smooth else weights

    def _known(self, name):
        if name not in self.states:
            msg = f'there is no state {name!r}; there are {", ".join(map(repr, self.states))}.'
            raise ValueError(msg)
        return name

    def _ending(self, name, following):
        duration = getattr(self.states[self._known(name)], 'duration', np.inf)
        if not 0 < duration < np.inf:
            msg = f'state {name!r} has no end, so nothing comes then: its duration is {duration}.'
            raise ValueError(msg)
        if name == following:
            msg = f'then leads from {name!r} to itself; a movement that loops does so by itself.'
            raise ValueError(msg)
        return name


class StateGraph(States):
    """States that a figure may be in, each a movement, with fades between them.

    A fade that is cut short by the next order goes on while the new one comes over it, so that
    nothing jumps. On the way both movements go on.

    Parameters are those of :class:`States`; states are whatever has ``sample(times) -> Pose``, as
    :class:`pvibr.animation.ClipSource`. Their clocks start when the way to them begins.

    See Also
    --------
    pvibr.animation.VertexAnimationStates : The same for key frames of whole meshes.

    Examples
    --------
    >>> from pvibr.animation import Pose
    >>> from pvibr.animation.mixer import PoseSource
    >>> from pvibr.animation.states import StateGraph
    >>> low, high = PoseSource(Pose([[0.0, 0.0, 0.0]])), PoseSource(Pose([[0.0, 0.0, 1.0]]))
    >>> graph = StateGraph({'crouch': low, 'stand': high}, fade=2.0)
    >>> graph.go('stand', at=1.0)
    >>> graph.sample([1.0, 1.5, 9.0]).translation[:, 0, 2].tolist()
    [0.0, 0.25, 1.0]
    >>> graph.state(0.5), graph.state(1.5)
    ('crouch', 'stand')
    """

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

        Raises
        ------
        ValueError
            If a time is not finite.

        Examples
        --------
        >>> from pvibr.animation import Pose
        >>> from pvibr.animation.mixer import PoseSource
        >>> from pvibr.animation.states import StateGraph
        >>> StateGraph({'stand': PoseSource(Pose([[0.0, 0.0, 1.0]]))}).sample([0.0, 1.0]).shape
        (2,)
        """
        times = np.asarray(times, dtype=np.float64)
        total = None
        for name, where, clocks, share in self._shown(times.reshape(-1)):
            pose = self.states[name].sample(clocks)
            total = PoseSum((times.size,), pose) if total is None else total
            total.add(pose, share, where=where)
        if total is None:
            return self.states[self.start].sample(times)
        return _reshaped(total.pose(), times.shape)


def _reshaped(pose, shape):
    """Return poses (t,) in another shape of the same size."""
    parts = (pose.translation, pose.rotation, pose.scale, pose.weights, pose.time)
    return Pose(*(part.reshape((*shape, *part.shape[1:])) for part in parts))


def _seconds(name, value):
    value = float(value)
    if not 0 <= value < np.inf:
        msg = f'{name} is {value}; it must be at least 0 seconds and finite.'
        raise ValueError(msg)
    return value
