"""Members of a crowd: which of them are drawn how, and what phase each is in."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pvibr.figures.mesh_actors import posed_part
from pvibr.figures.player import Moment
from pvibr.figures.posed_meshes import PosedPool
from pvibr.instances.group import InstanceGroup

#: Seconds after which rounds are counted anew, at the same times whatever was shown before: floats
#: of 32 bits keep a thousandth of a round so long.
_ERA = 512.0


class Playback:
    """What each member of a crowd plays."""

    def __init__(self, count):
        self.clip = np.zeros(count, int)
        self.offset = np.zeros(count)
        self.speed = np.ones(count)
        self.loop = np.ones(count, bool)

    def rounds(self, motions, time, ids=slice(None)) -> np.ndarray:
        """Return how many rounds of their clips members are through."""
        durations = np.array([m.duration for m in motions])[self.clip[ids]]
        rounds = (self.offset[ids] + self.speed[ids] * time) / np.maximum(durations, 1e-12)
        rounds[durations == 0] = 0.0
        return np.where(self.loop[ids], rounds % 1.0, np.clip(rounds, 0.0, 1.0))

    def rows(self, motions, time) -> np.ndarray:
        """Return what the GPU needs to know, from a time on."""
        durations = np.array([m.duration for m in motions])[self.clip]
        still = durations == 0
        durations = np.where(still, 1.0, durations)
        rounds = (self.offset + self.speed * time) / durations
        rounds = np.where(self.loop, rounds % 1.0, rounds)
        rate = self.speed / durations
        rounds[still] = rate[still] = 0.0
        return np.stack([rounds, rate, self.clip, self.loop], 1).astype(np.float32)


class CrowdGroup(InstanceGroup):
    """The members of a crowd."""

    def __init__(self, state, *args):
        self.state = state
        self._era: float | None = None
        self._posed: dict = {}
        super().__init__(*args)

    def _pools(self) -> list:
        return [
            PosedPool(level, self.state.mesh_actors, self.state.skinning) for level in self.levels
        ]

    def upload(self, window):
        """Put atlas and poses on the GPU of a window whose context is current."""
        super().upload(window)
        self._era = None

    def moved(self):
        """Look again at what members play."""
        self._era, self._posed = None, {}

    def at(self, window, time):
        """Show all as they are at a time."""
        if self.atlas.phased:
            era = _ERA * float(np.floor(time / _ERA))
            if self._era != era:
                self._era = era
                self.cards.move(self.state.playback.rows(self.state.motions, era)[self.ids])
            self.cards.uniforms['ibr_time'] = float(time - era)
        for pool in self.pools:
            if pool.lent:
                slots = list(pool.lent)
                clips, seconds = self.state.seconds(time, self.ids[slots])
                pairs = zip(clips.tolist(), seconds.tolist(), strict=True)
                keys = dict(zip(slots, pairs, strict=True))
                pool.pose(window, keys, self.state.moments, self.matrix)

    def parts(self, slot) -> list:
        """Return the meshes of a member as it is now, as Parts in the figure's space."""
        time = self.state.now()
        key = int(self.ids[slot]), time
        if self._posed.get('key') != key:
            mesh = self.state.shown(key[0], time)
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


class CrowdState:
    """A figure with its looks, what it may play, and what each member plays."""

    def __init__(self, figure, mesh_actors, skinning, playback, now):
        self.figure, self.mesh_actors, self.skinning = figure, mesh_actors, skinning
        self.playback, self.now = playback, now
        self.motions: list = []
        self.box = np.zeros(6)

    def seconds(self, time, ids) -> tuple[np.ndarray, np.ndarray]:
        """Return number of and time in the clips of members."""
        clips = self.playback.clip[ids]
        durations = np.array([m.duration for m in self.motions])[clips]
        return clips, self.playback.rounds(self.motions, time, ids) * durations

    def pose(self, clip, seconds):
        """Return the pose at a time of a clip."""
        return self.figure.sample(seconds, self.motions[clip].clip, loop=False)

    def moments(self, keys) -> list[Moment]:
        """Return what is shown at times of clips, all times of a clip at once."""
        clips, seconds = np.array(keys).T
        out: list = [None] * len(keys)
        # Where nothing but joints moves vertices, these are all that is asked for.
        still = not any(getattr(mesh_actor, 'shapes', None) for mesh_actor in self.mesh_actors)
        for clip in np.unique(clips):
            (places,) = np.nonzero(clips == clip)
            poses = self.pose(int(clip), seconds[places])
            worlds = self.figure.world(poses)
            for k, place in enumerate(places):
                out[place] = Moment(worlds[k] if still else poses[k], worlds[k], self.box)
        return out

    def parts(self, member, time, matrix) -> list:
        """Return the meshes of a member as it is, with their looks, in world units."""
        clips, seconds = self.seconds(time, np.array([member]))
        pose = self.pose(int(clips[0]), float(seconds[0]))
        return [
            posed_part(self.figure, i, mesh_actor.part, matrix, pose, self.skinning)
            for i, mesh_actor in enumerate(self.mesh_actors)
        ]

    def shown(self, member, time):
        """Return the mesh of a member as it is, in the figure's space."""
        clips, seconds = self.seconds(time, np.array([member]))
        pose = self.pose(int(clips[0]), float(seconds[0]))
        return self.figure.mesh(pose=pose, skinning=self.skinning)
