"""Members of a crowd: which of them are drawn how, and what phase each is in."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pvibr.actors.figure_bodies import posed_part
from pvibr.actors.figure_player import Moment
from pvibr.actors.kind import Kind
from pvibr.actors.posed_meshes import PosedPool

#: Seconds after which rounds are counted anew, at the same times whatever was shown before: floats
#: of 32 bits keep a thousandth of a round so long.
_ERA = 512.0


class Moves:
    """What each member of a crowd plays.

    Parameters
    ----------
    count : int
        Members.

    Attributes
    ----------
    clip : numpy.ndarray, shape (n,), int
        Number of the motion.
    offset : numpy.ndarray, shape (n,), float64
        Time in the clip when the plotter's is 0, seconds.
    speed : numpy.ndarray, shape (n,), float64
        Seconds of the clip in a second.
    loop : numpy.ndarray, shape (n,), bool
        Whether it begins again after its end.
    """

    def __init__(self, count):
        self.clip = np.zeros(count, int)
        self.offset = np.zeros(count)
        self.speed = np.ones(count)
        self.loop = np.ones(count, bool)

    def rounds(self, motions, time, ids=slice(None)) -> np.ndarray:
        """Return how many rounds of their clips members are through.

        Parameters
        ----------
        motions : sequence of Motion
            The clips.
        time : float
            Seconds of the plotter.
        ids : index
            Which members.

        Returns
        -------
        numpy.ndarray
            From 0 to 1.
        """
        durations = np.array([m.duration for m in motions])[self.clip[ids]]
        rounds = (self.offset[ids] + self.speed[ids] * time) / np.maximum(durations, 1e-12)
        rounds[durations == 0] = 0.0
        return np.where(self.loop[ids], rounds % 1.0, np.clip(rounds, 0.0, 1.0))

    def rows(self, motions, time) -> np.ndarray:
        """Return what the GPU needs to know, from a time on.

        Parameters
        ----------
        motions : sequence of Motion
            The clips.
        time : float
            Seconds of the plotter that count as 0.

        Returns
        -------
        numpy.ndarray, shape (n, 4), float32
            Rounds at that time, rounds a second, number of the clip, whether it goes round.
        """
        durations = np.array([m.duration for m in motions])[self.clip]
        still = durations == 0
        durations = np.where(still, 1.0, durations)
        rounds = (self.offset + self.speed * time) / durations
        rounds = np.where(self.loop, rounds % 1.0, rounds)
        rate = self.speed / durations
        rounds[still] = rate[still] = 0.0
        return np.stack([rounds, rate, self.clip, self.loop], 1).astype(np.float32)


class CrowdKind(Kind):
    """The members of a crowd.

    Parameters
    ----------
    cast : Cast
        The figure with what it may play.
    *args
        See :class:`pvibr.actors.kind.Kind`.
    """

    def __init__(self, cast, *args):
        self.cast = cast
        self._era: float | None = None
        self._posed: dict = {}
        super().__init__(*args)

    def _pools(self) -> list:
        return [PosedPool(level, self.cast.bodies, self.cast.skinning) for level in self.levels]

    def upload(self, window):
        """Put atlas and poses on the GPU of a window whose context is current.

        Parameters
        ----------
        window : vtkOpenGLRenderWindow
            The window.
        """
        super().upload(window)
        self._era = None

    def moved(self):
        """Look again at what members play."""
        self._era, self._posed = None, {}

    def at(self, window, time):
        """Show all as they are at a time.

        Parameters
        ----------
        window : vtkOpenGLRenderWindow
            Whose context is current.
        time : float
            Seconds of the plotter.
        """
        if self.atlas.phased:
            era = _ERA * float(np.floor(time / _ERA))
            if self._era != era:
                self._era = era
                self.cards.move(self.cast.moves.rows(self.cast.motions, era)[self.ids])
            self.cards.uniforms['ibr_time'] = float(time - era)
        for pool in self.pools:
            if pool.lent:
                slots = list(pool.lent)
                clips, seconds = self.cast.seconds(time, self.ids[slots])
                pairs = zip(clips.tolist(), seconds.tolist(), strict=True)
                keys = dict(zip(slots, pairs, strict=True))
                pool.pose(window, keys, self.cast.moments, self.matrix)

    def parts(self, slot) -> list:
        """Return the meshes of a member as it is now, as Parts in the figure's space.

        Parameters
        ----------
        slot : int
            A place in the order of this kind.
        """
        time = self.cast.now()
        key = int(self.ids[slot]), time
        if self._posed.get('key') != key:
            mesh = self.cast.shown(key[0], time)
            blocks = [mesh] if hasattr(mesh, 'regular_faces') else list(mesh)
            self._posed = {'key': key, 'parts': [SimpleNamespace(mesh=m) for m in blocks]}
        return self._posed['parts']

    def finish(self):
        """Give the texture units back."""
        for pool in self.pools:
            pool.finish()

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.cards.nbytes + sum(pool.nbytes for pool in self.pools)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        window = self.cards.window
        super().release()
        if window is not None:
            for pool in self.pools:
                pool.release(window)


class Cast:
    """A figure with its looks, what it may play, and what each member plays.

    Parameters
    ----------
    figure : pvibr.Figure
        The figure.
    bodies : list of RigidBody or PosedBody
        With its looks.
    skinning : {'linear', 'dual'}
        How joints are blended.
    moves : Moves
        What each member plays.
    now : callable
        Returns the plotter's time.
    """

    def __init__(self, figure, bodies, skinning, moves, now):
        self.figure, self.bodies, self.skinning = figure, bodies, skinning
        self.moves, self.now = moves, now
        self.motions: list = []
        self.box = np.zeros(6)

    def seconds(self, time, ids) -> tuple[np.ndarray, np.ndarray]:
        """Return number of and time in the clips of members.

        Parameters
        ----------
        time : float
            Seconds of the plotter.
        ids : numpy.ndarray of int
            Which members.
        """
        clips = self.moves.clip[ids]
        durations = np.array([m.duration for m in self.motions])[clips]
        return clips, self.moves.rounds(self.motions, time, ids) * durations

    def pose(self, clip, seconds):
        """Return the pose at a time of a clip.

        Parameters
        ----------
        clip : int
            Its number.
        seconds : array_like, shape (...)
            Within the clip.
        """
        return self.figure.sample(seconds, self.motions[clip].clip, loop=False)

    def moments(self, keys) -> list[Moment]:
        """Return what is shown at times of clips, all times of a clip at once.

        Parameters
        ----------
        keys : sequence of (int, float)
            Number of the clip, seconds within it.
        """
        clips, seconds = np.array(keys).T
        out: list = [None] * len(keys)
        # Where nothing but joints moves vertices, these are all that is asked for.
        still = not any(getattr(body, 'shapes', None) for body in self.bodies)
        for clip in np.unique(clips):
            (places,) = np.nonzero(clips == clip)
            poses = self.pose(int(clip), seconds[places])
            worlds = self.figure.world(poses)
            for k, place in enumerate(places):
                out[place] = Moment(worlds[k] if still else poses[k], worlds[k], self.box)
        return out

    def parts(self, member, time, matrix) -> list:
        """Return the meshes of a member as it is, with their looks, in world units.

        Parameters
        ----------
        member : int
            Which one.
        time : float
            Seconds of the plotter.
        matrix : numpy.ndarray, shape (4, 4)
            World from figure.
        """
        clips, seconds = self.seconds(time, np.array([member]))
        pose = self.pose(int(clips[0]), float(seconds[0]))
        return [
            posed_part(self.figure, i, body.part, matrix, pose, self.skinning)
            for i, body in enumerate(self.bodies)
        ]

    def shown(self, member, time):
        """Return the mesh of a member as it is, in the figure's space.

        Parameters
        ----------
        member : int
            Which one.
        time : float
            Seconds of the plotter.
        """
        clips, seconds = self.seconds(time, np.array([member]))
        pose = self.pose(int(clips[0]), float(seconds[0]))
        return self.figure.mesh(pose=pose, skinning=self.skinning)
