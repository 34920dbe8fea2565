"""Members of a crowd: level of detail, clip and clip time of each; the images of clips."""

from __future__ import annotations

import numpy as np

from pvibr.core.progress import baking
from pvibr.figures.crowd_draws import CrowdDraws, can_share_draws, culls_faces
from pvibr.figures.member_poses import MemberPoses
from pvibr.figures.mesh_actors import posed_part
from pvibr.figures.player import Moment
from pvibr.figures.pose_atlas import bake_pose_atlas
from pvibr.figures.posed_meshes import PosedPool
from pvibr.figures.posing import pose_budget
from pvibr.gl import nbytes_of, release
from pvibr.instances.group import InstanceGroup
from pvibr.instances.mesh_models import MeshModels
from pvibr.instances.near_meshes import NO_TINT, NearMeshes
from pvibr.instances.placement import spheres
from pvibr.maths.transforms import signs_of

#: Seconds after which clip times are uploaded again: float32 stays exact to 1/1000 cycle so long.
_ERA = 512.0
_UNIFORMS = 'ibr_has_looks', 'ibr_multiply'


class Playback:
    """Clip, time offset, speed and loop mode of each member of a crowd."""

    def __init__(self, count):
        self.clip = np.zeros(count, int)
        self.offset = np.zeros(count)
        self.speed = np.ones(count)
        self.loop = np.ones(count, bool)

    def rounds(self, motions, time, ids=slice(None)) -> np.ndarray:
        """Return the normalised clip times of members, 0 to 1."""
        durations = np.array([m.duration for m in motions])[self.clip[ids]]
        clip_rounds = (self.offset[ids] + self.speed[ids] * time) / np.maximum(durations, 1e-12)
        clip_rounds[durations == 0] = 0.0
        return np.where(self.loop[ids], clip_rounds % 1.0, np.clip(clip_rounds, 0.0, 1.0))

    def rows(self, motions, time) -> np.ndarray:
        """Return the playback from a time on as the GPU reads it, (n, 4) float32."""
        durations = np.array([m.duration for m in motions])[self.clip]
        is_still = durations == 0
        durations = np.where(is_still, 1.0, durations)
        clip_rounds = (self.offset + self.speed * time) / durations
        clip_rounds = np.where(self.loop, clip_rounds % 1.0, clip_rounds)
        round_rate = self.speed / durations
        clip_rounds[is_still] = round_rate[is_still] = 0.0
        return np.stack([clip_rounds, round_rate, self.clip, self.loop], 1).astype(np.float32)


class _PosedMeshes(NearMeshes):
    """Near members at their levels: many per draw, or with an actor per mesh and member."""

    def __init__(self, levels, state):
        self._state = state
        #: Of each level.
        self.poses = [MemberPoses(level.mesh_actors, state.skinning) for level in levels]
        # Levels whose members share draws, with their slots, shares and ranks from the nearest;
        # and the view that they were chosen for.
        self._shared: list[tuple] = []
        self._eye_from_world = np.eye(4)
        self._crowd_draws: list[CrowdDraws] = []
        self._counts: dict = {}  # of members by their poses, which share the memory
        self._window: object = None  # whose driver has been asked for room
        super().__init__(levels)

    def _pools(self) -> list:
        return [PosedPool(level, self._state.skinning) for level in self.levels]

    def draw_many(self, capacity, center, binder):
        """Prepare draws of many members, unless their meshes need actors of their own."""
        options = capacity, center, self._matrix, binder, False
        pairs = zip(self.levels, self.poses, strict=True)
        self._crowd_draws = [CrowdDraws(level, poses, *options) for level, poses in pairs]
        self.draws = [*self._crowd_draws]
        self.follow_material()

    def follow_material(self):
        """Use actors of each member where a material needs more than surfaces."""
        may_mirror = self._state.may_mirror()
        own_actors = [
            not (self.draws and can_share_draws(level, may_mirror)) or pool.poses.by_cpu
            for level, pool in zip(self.levels, self.pools, strict=True)
        ]
        self._culls = culls_faces(self._state.mesh_actors)
        self._set_own_actors(own_actors, elsewhere=self._culls)

    def select(self, group, frame, limits) -> list:
        """Draw the members too large for cards; return new actors."""
        if self._window is not frame.window:
            self._window = frame.window
            for pool in self.pools:
                pool.poses.ask(frame.window)
            if any(pool.poses.by_cpu for pool in self.pools):
                self.follow_material()
        return super().select(group, frame, limits)

    def _need_own_actors(self, group, slots, mesh_levels) -> np.ndarray:
        needs_own = super()._need_own_actors(group, slots, mesh_levels)
        # In a mirror image the other faces are culled.
        return needs_own | group.placement.mirrored(slots) if self._culls else needs_own

    def _show_batches(self, group, frame, slots, _centers, levels, shares, _outside):
        shares, self._eye_from_world = shares.clip(0, 1), frame.view_from_world
        uniforms = {name: group.cards.uniforms[name] for name in _UNIFORMS} | NO_TINT
        textures = {'ibr_looks': group.cards.textures['ibr_looks']}
        inputs = textures, group.cards.view_uniforms, uniforms
        new_actors, self._shared, blends = [], [], self._blends()
        ranks = np.arange(len(slots))
        level_counts = np.bincount(levels, minlength=len(self.draws)).tolist()
        for k, (draws, count) in enumerate(zip(self.draws, level_counts, strict=True)):
            if count:
                drawn, order = ranks[levels == k], ranks[:count]  # nearest first
                if blends:
                    drawn, order = drawn[::-1], order[::-1]
                self._shared.append((k, slots[drawn], shares[drawn], order))
                draws.set_inputs(None, *inputs)
                new_actors += draws.show(0, count, False)
            elif draws.is_shown:
                draws.hide()
        return new_actors

    def pose(self, window, group, time):
        """Pose the members that share draws, and share the memory among all."""
        self._share_memory()
        eye_from_world, state = self._eye_from_world, self._state
        for level, slots, shares, ranks in self._shared:
            draws = self._crowd_draws[level]
            numbers, _ = state.pose_members(draws.poses, window, group, time, slots, ranks)
            eye_from_figure = eye_from_world @ group.matrices(slots)
            draws.upload(window, slots, shares, group.radii[slots], numbers, eye_from_figure)

    def _share_memory(self):
        """Share the memory for poses by what the members that are shown need."""
        counts = {self.poses[level]: len(slots) for level, slots, *_ in self._shared}
        for pool in self.pools:
            if pool.lent:
                counts[pool.poses] = len(pool.lent)
        if self._counts == counts:
            return
        self._counts = counts
        rows = {poses: poses.needed_rows(count) for poses, count in counts.items()}
        for poses, needed_rows in rows.items():
            poses.memory_share = needed_rows / max(sum(rows.values()), 1)
        all_poses = [*self.poses, *(pool.poses for pool in self.pools)]
        if nbytes_of(*all_poses) > pose_budget():
            release(*(poses for poses in all_poses if poses not in rows))

    @property
    def note(self) -> str:
        """What members share because there are too few poses; empty if each has its own."""
        pooled = [pool.poses for pool in self.pools]
        notes = zip(2 * self._level_names, [*self.poses, *pooled], strict=True)
        return '; '.join(f'{name}: {poses.note}' for name, poses in notes if poses.note)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self.poses, *self.draws, *self.pools)

    def hide(self, group):
        """Draw nothing, and forget what slots hold."""
        super().hide(group)
        self._shared = []

    def release(self, window):
        """Free GPU memory; the context is current."""
        super().release(window)
        release(*self.poses)


class CrowdGroup(InstanceGroup):
    """The members of a crowd, as a group of instances."""

    near: _PosedMeshes

    def __init__(self, state, *args, **options):
        self.state = state
        self._era: float | None = None
        self._posed: dict = {}
        super().__init__(*args, **options)

    def _near_meshes(self, _translucent):
        return _PosedMeshes(self.levels, self.state)

    def tight_bounds(self, poses=None) -> tuple:
        """Return the bounds of the spheres in which the figures move."""
        if poses is None or not len(self):
            return tuple(self.bounds)
        centers, radii = spheres(poses, self.ids, self.atlas.center, self.atlas.radius)
        bounds = np.stack([(centers - radii).min(1), (centers + radii).max(1)], 1)
        return tuple(bounds.ravel().tolist())

    def _placed(self, rows=None):
        super()._placed(rows)
        self.moved()

    def release(self):
        """Release all GPU resources; the context must be alive."""
        window = self.cards.window
        super().release()
        self.moved()
        if window is not None:
            for pool in self.near.pools:
                pool.release(window)

    def moved(self):
        """Upload the playback again with the next frame."""
        self._era, self._posed = None, {}

    def at(self, window, time):
        """Animate all members to a time."""
        if self.atlas.animated:
            era_start = _ERA * float(np.floor(time / _ERA))
            if self._era != era_start:
                self._era = era_start
                self.cards.move(self.state.playback.rows(self.state.motions, era_start)[self.ids])
            self.cards.set(ibr_time=float(time - era_start))
        self.near.pose(window, self, time)
        for pool in self.near.pools:
            if pool.lent:
                pool.pose(window, self, time, self.state)

    def parts(self, slot) -> list:
        """Return the posed meshes of a member, as parts in the figure's space."""
        time = self.state.now()
        member_key = int(self.ids[slot]), time
        if self._posed.get('key') != member_key:
            self._posed = {'key': member_key, 'parts': self.state.parts(*member_key, np.eye(4))}
        return self._posed['parts']

    def finish(self):
        """Release the texture units."""
        for pool in self.near.pools:
            pool.finish()

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self.cards, self.near)


class CrowdState:
    """What members of a crowd share: figure, looks, sampled clips; and the playback of each."""

    def __init__(self, figure, mesh_actors, skinning, playback, now):
        self.figure, self.mesh_actors, self.skinning = figure, mesh_actors, skinning
        self.playback, self.now = playback, now
        self.motions: list = []
        self.box = np.zeros(6)

    def may_mirror(self) -> bool:
        """Return whether joints may mirror meshes: by the scales of the rest pose and of clips."""
        if (self.figure.skeleton.rest.scale < 0).any():
            return True
        clips = [motion.clip for motion in self.motions if motion.clip is not None]
        return any(_may_mirror(clip) for clip in clips)

    def seconds(self, time, ids) -> tuple[np.ndarray, np.ndarray]:
        """Return clip indices and clip times of members."""
        clips = self.playback.clip[ids]
        return clips, self.playback.rounds(self.motions, time, ids) * self.durations(clips)

    def durations(self, clips) -> np.ndarray:
        """Return the durations of clips, in seconds."""
        return np.array([m.duration for m in self.motions])[clips]

    def pose_members(self, poses, window, group, time, slots, ranks=None) -> tuple:
        """Pose members, ranked from the nearest or in this order.

        Return the number of the pose of each, and the clip and time that it shows, (n, 2).
        """
        clips, seconds = self.seconds(time, group.ids[slots])
        ranks = np.arange(len(slots)) if ranks is None else ranks
        times = clips, seconds, self.durations(clips), self.moments
        numbers = poses.pose(window, time, slots, ranks, *times)
        return numbers, poses.keys[numbers]

    def pose(self, clip, seconds):
        """Return the poses at times of a clip."""
        return self.figure.sample(seconds, self.motions[clip].clip, loop=False)

    def moments(self, keys) -> list[tuple[list[int], Moment]]:
        """Return the moments of (clip, time) pairs, each with the indices of its pairs.

        If only joints move the vertices, there is one moment of all poses of a clip.
        """
        clip_indices, clip_seconds = np.array(keys).T
        is_batched = all(actor.moves_with_joints for actor in self.mesh_actors)
        moments: list[tuple[list[int], Moment]] = []
        for clip in np.unique(clip_indices):
            (key_indices,) = np.nonzero(clip_indices == clip)
            poses = self.pose(int(clip), clip_seconds[key_indices])
            worlds = self.figure.world(poses)
            signs = signs_of(worlds)
            if is_batched:
                moments.append((key_indices.tolist(), Moment(worlds, worlds, signs, self.box)))
                continue
            for k, place in enumerate(key_indices.tolist()):
                moments.append(([place], Moment(poses[k], worlds[k], signs[k], self.box)))
        return moments

    def parts(self, member, time, matrix) -> list:
        """Return the posed meshes of a member with their looks, in world units."""
        placement = matrix, self.pose_of(member, time), self.skinning
        return [
            posed_part(self.figure, i, a.part, *placement) for i, a in enumerate(self.mesh_actors)
        ]

    def shown(self, member, time, merge=True):
        """Return the posed mesh of a member, or its meshes, in the figure's space."""
        pose = self.pose_of(member, time)
        return self.figure.mesh(pose=pose, skinning=self.skinning, merge=merge)

    def pose_of(self, member, time):
        """Return the pose of a member."""
        clip_indices, clip_seconds = self.seconds(time, np.array([member]))
        return self.pose(int(clip_indices[0]), float(clip_seconds[0]))


def _may_mirror(clip) -> bool:
    """Return whether a clip has negative scales, or is no sequence of tracks."""
    tracks = getattr(clip, 'tracks', None)
    if tracks is None:
        return True
    return any(track.path == 'scale' and np.min(track.values) < 0 for track in tracks)


class ClipModels(MeshModels):
    """The model of a crowd: images of its figure in poses of all clips."""

    def __init__(self, state, clips, **baking):
        super().__init__(**baking)
        self._state, self.clips = state, clips

    def show_clips(self, clips):
        """Bake clips and store their motions; if that fails, everything is as before."""
        state, options = self._state, dict(self._baking)
        with baking(options.pop('progress')) as advance:
            model, motions = bake_pose_atlas(
                state.figure,
                state.mesh_actors,
                clips,
                skinning=state.skinning,
                advance=advance,
                **options,
            )
        state.motions, state.box = motions, model.atlas.box.T.ravel()
        self.by_mesh, self.clips = {0: model}, clips

    def remake(self, _index=None):
        """Bake all clips again, in the changed colours."""
        self.show_clips(self.clips)
