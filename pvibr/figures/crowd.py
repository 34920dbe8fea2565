"""Crowds: many instances of an animated figure, each at its own clip time."""

from __future__ import annotations

from functools import partial

import numpy as np

from pvibr.animation.joint_tables import joint_table
from pvibr.core.arguments import check_one_of
from pvibr.core.nan_rows import NanRows
from pvibr.core.signatures import takes
from pvibr.figures.crowd_group import ClipModels, CrowdGroup, CrowdState, Playback
from pvibr.figures.lying import lying_note
from pvibr.figures.mesh_actors import as_mesh_actors, drawn_figure, moved_figure
from pvibr.gl import nbytes_of
from pvibr.instances.instances import Instances
from pvibr.instances.mesh_groups import MeshGroups
from pvibr.instances.posed_items import PosedItems
from pvibr.maths.transforms import trs
from pvibr.meshes.parts import as_parts
from pvibr.meshes.posed import posed
from pvibr.things.appearance import as_colors, read_only
from pvibr.things.item_set import ItemSet
from pvibr.things.thing import Thing


class Crowd(Instances):
    """An animated figure drawn many times: near as posed meshes, far as images of its clips.

    Parameters
    ----------
    figure : pvibr.Figure
        Meshes, skeleton and clips.
    poses : array_like, shape (n, 3) or (n, 4, 4)
        Points or ``world_from_figure`` matrices, world units.
    times : array_like, shape (n,), or float, optional
        Clip time of each figure at ``plotter.ibr.time`` 0, in seconds; default 0.
    clips : str, int, Clip, or sequence of them, optional
        Clip of all figures, or of each; default the first one.
    speeds : array_like, shape (n,), or float, optional
        Clip seconds per second; default 1.
    loop : bool or array_like of bool, shape (n,)
        Restart clips at their end.
    orient : array_like, str, bool or scipy.spatial.transform.Rotation, optional
        Where each member turns, see :func:`pvibr.matrices`: vectors toward which x turns,
        quaternions (w, x, y, z), matrices, or the name of an array of `poses`.
    scale : float, array_like, shape (n,) or (n, 3), str or bool, optional
        Factors, vectors of these lengths, or the name of an array of `poses`.
    factor : float
        Factor applied to all sizes.
    skinning : {'linear', 'dual'}
        Linear blend or dual quaternion skinning.
    max_error : float
        Largest error of an outline in pixels, relative to the posed mesh.
    scalars : array_like, shape (n,), or str, optional
        Values per figure, mapped by `cmap`; a name selects an array of the meshes.
    colors : array_like, shape (n, 3), optional
        Colours per figure, uint8 or float.
    nan : {'raise', 'hide'}
        Refuse figures with NaN in their poses, or hide them.
    **mesh_kwargs
        Keywords of :meth:`pyvista.Plotter.add_mesh`, which override the looks of the meshes.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh, Clip, Skeleton, Track
    >>> rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2]])])
    >>> joint = [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]
    >>> balloon = Figure([FigureMesh(pv.Sphere(), node=0)], Skeleton([-1], joint), [rise])
    >>> pl = pv.Plotter(off_screen=True)
    >>> balloons = pl.ibr.add_animated(
    ...     balloon, [[0, 0, 0], [2, 0, 0]], times=[0.0, 0.5], max_error=8, cache=False
    ... )
    >>> round(balloons.mesh(1).center[2], 3)
    1.0
    >>> pl.close()
    """

    _can_grow = False
    _models: ClipModels

    @takes(mesh_kwargs=as_parts)
    def __init__(
        self,
        figure,
        poses,
        *,
        times=0.0,
        clips=None,
        speeds=1.0,
        loop=True,
        orient=None,
        scale=None,
        factor=1.0,
        skinning='linear',
        max_error=1.0,
        name=None,
        scalars=None,
        colors=None,
        blend='replace',
        cmap=None,
        clim=None,
        pickable=True,
        cache=True,
        progress=None,
        theme=None,
        nan='raise',
        **mesh_kwargs,
    ):
        ItemSet.__init__(self, max_error=max_error)
        self.name = name
        placing, nan_rows = {'orient': orient, 'scale': scale, 'factor': factor}, NanRows(nan)
        poses = posed(poses, nan_rows=nan_rows, **placing)
        member_count = len(poses)
        mesh_kwargs |= {'cmap': cmap, 'clim': clim}
        self._theme = theme
        mesh_options = self._begin_looks_of(member_count, scalars, colors, blend, mesh_kwargs)
        check_one_of('skinning', skinning, ('linear', 'dual'))
        self.figure = figure = drawn_figure(figure, mesh_options, theme)
        playback = Playback(member_count)
        playback.clip, all_clips = self._clip_indices(clips, member_count, [])
        playback.offset = _each('times', times, member_count)
        playback.speed = _each('speeds', speeds, member_count)
        playback.loop = _each('loop', loop, member_count, bool)
        state = self._crowd_state = CrowdState(
            figure, as_mesh_actors(figure, mesh_options, theme), skinning, playback, self._now
        )
        baking = {'max_error': float(max_error), 'cache': cache, 'progress': progress}
        models = ClipModels(state, all_clips, **baking)
        if member_count:
            models.remake()
        indices = np.zeros(member_count, int)
        items = PosedItems(poses, poses, indices, placing=placing, nan_rows=nan_rows)
        self.pickable, self._shown_material = pickable, 0
        self._begin(items, models, MeshGroups(partial(CrowdGroup, state)), scalars, colors)

    def _clip_indices(self, clips, member_count, known_clips) -> tuple[np.ndarray, list]:
        """Return the index of each figure's clip, and all clips, new ones last."""
        is_single = clips is None or isinstance(clips, str | int) or hasattr(clips, 'sample')
        member_clips = [self.figure.clip(c) for c in ([clips] if is_single else clips)]
        if not is_single and len(member_clips) != member_count:
            raise ValueError(f'clips must be one clip or {member_count}, got {len(member_clips)}')
        all_clips = list({id(clip): clip for clip in [*known_clips, *member_clips]}.values())
        clip_index = {id(clip): i for i, clip in enumerate(all_clips)}
        clip_indices = np.array([clip_index[id(clip)] for clip in member_clips], int)
        return np.broadcast_to(
            clip_indices, (member_count,)
        ).copy() if is_single else clip_indices, all_clips

    # Posed meshes are drawn by other actors, without clipping planes or alphas.
    set_clipping_planes = Thing.set_clipping_planes

    def _as_colors(self, colors, count=None):
        return as_colors(colors, len(self) if count is None else count)

    def _materials_of_all(self) -> list:
        return [a.part.actor.GetProperty() for a in self._crowd_state.mesh_actors]

    def _adopt_material(self):
        self._share_material()

    # -- playback -----------------------------------------------------------------------------

    @property
    def times(self) -> np.ndarray:
        """Clip times at ``plotter.ibr.time`` 0 in seconds, shape (n,)."""
        return read_only(self._crowd_state.playback.offset)

    @times.setter
    def times(self, times):
        self._crowd_state.playback.offset = _each('times', times, len(self))
        self._moved()

    @property
    def speeds(self) -> np.ndarray:
        """Clip seconds per second, shape (n,)."""
        return read_only(self._crowd_state.playback.speed)

    @speeds.setter
    def speeds(self, speeds):
        self._crowd_state.playback.speed = _each('speeds', speeds, len(self))
        self._moved()

    @property
    def clips(self) -> list:
        """The clip of each figure; None is the rest pose."""
        return [self._models.clips[i] for i in self._crowd_state.playback.clip]

    def play(self, clip=None, ids=None, *, speed=1.0, loop=True, start=None):
        """Play a clip.

        Parameters
        ----------
        clip : str, int or Clip, optional
            Name, index or clip; default the first one. A new clip is baked.
        ids : array_like of int, optional
            Indices of the figures; default all.
        speed : float or array_like, shape (k,)
            Clip seconds per second; negative plays backwards.
        loop : bool or array_like, shape (k,)
            Restart the clip at its end.
        start : float or array_like, shape (k,), optional
            Time at which the clip starts, in seconds of ``plotter.ibr.time``; default now.

        Raises
        ------
        IndexError
            If an index is out of range.
        ValueError
            If there is no such clip, or values do not fit.
        """
        ids = np.arange(len(self))[slice(None) if ids is None else np.asarray(ids)]
        ids = np.atleast_1d(ids)
        speed = _each('speed', speed, len(ids))
        start = _each('start', self._now() if start is None else start, len(ids))
        loop = _each('loop', loop, len(ids), bool)
        clip_indices, all_clips = self._clip_indices(clip, len(ids), self._models.clips)
        is_new = len(all_clips) > len(self._models.clips)
        if is_new:
            self._models.show_clips(all_clips)  # it may be interrupted
        playback = self._crowd_state.playback
        playback.clip[ids] = clip_indices
        playback.speed[ids], playback.loop[ids] = speed, loop
        playback.offset[ids] = -speed * start
        if is_new:
            self._rebuild()
        self._moved()

    def _moved(self):
        for group in self.groups:
            group.moved()
        self._changes += 1

    def mesh(self, index, *, merge=True):
        """Return one figure at the current time in world space, as :meth:`pvibr.Figure.mesh`.

        Parameters
        ----------
        index : int
            Index of the figure.
        merge : bool
            Return one mesh; False keeps the figure's meshes apart.
        """
        self.follow()
        mesh = self._crowd_state.shown(index, self._now(), merge)
        return moved_figure(mesh, _matrix(self._items.poses[index]))

    def joints(self, index, *, world=True):
        """Return where the joints of one figure are now, as :meth:`pvibr.Figure.joints`.

        Parameters
        ----------
        index : int
            Index of the figure.
        world : bool
            In the scene's space, otherwise relative to the parents.
        """
        self.follow()
        state, matrix = self._crowd_state, _matrix(self._items.poses[index])
        figure_from_joint = state.figure.world(state.pose_of(index, self._now()))
        return joint_table(state.figure.skeleton, matrix @ figure_from_joint, world)

    def bake_into(self, scene):
        """Hand each figure as it is now to a scene without pvibr."""
        for i in np.flatnonzero(self.drawn_items()):
            member_color = None if self._colors is None else self._colors[i]
            matrix = _matrix(self._items.poses[i])
            for part in self._crowd_state.parts(int(i), self._now(), matrix):
                scene.part(self, part, color=member_color, multiply=self.multiplies)

    # -- the life of an effect ---------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a key that changes when the content changes, whatever the camera."""
        return *super().content_key(), self._now()

    def _time_getters(self):
        return None  # its members move

    def prepare(self, frame):
        """Choose levels of detail, and animate the members."""
        if self._shown_material != self._material.changes:
            self._shown_material = self._material.changes
            self._remake()
        super().prepare(frame)
        for group in self.groups:
            group.at(frame.window, self._now())

    def finish(self, frame):
        """Release the texture units."""
        super().finish(frame)
        for group in self.groups:
            group.finish()

    def report(self) -> dict:
        """Return the report of instances, with bytes on the GPU."""
        details = super().report() | {'bytes': nbytes_of(*self.groups)}
        for group in self.groups:
            details |= {'poses': group.near.note} if group.near.note else {}
        if len(self):
            details |= lying_note(self.figure, _matrix(self._items.poses[0]), self.pipeline)
        return details


def _matrix(pose) -> np.ndarray:
    """Return a pose as a matrix, (4, 4)."""
    return pose if pose.ndim == 2 else trs(pose)[0]


def _each(name, values, member_count, dtype=float) -> np.ndarray:
    """Return one value for each figure."""
    array = np.asarray(values)
    is_valid = array.dtype == bool if dtype is bool else array.dtype.kind in 'iuf'
    if array.shape not in ((), (member_count,)) or not is_valid or not np.isfinite(array).all():
        kind = 'bool' if dtype is bool else 'finite numbers'
        raise ValueError(
            f'{name} must be {kind}, one or ({member_count},), '
            f'got {array.dtype} of shape {array.shape}'
        )
    return np.broadcast_to(array.astype(dtype), (member_count,)).copy()
