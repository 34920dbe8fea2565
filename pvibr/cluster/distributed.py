"""What workers draw, composited with the scene of the user's process by depth."""

from __future__ import annotations

import uuid
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pvibr.cluster.clients import Cluster
from pvibr.cluster.kept_bars import kept_bars
from pvibr.cluster.sent_scenes import scene_of
from pvibr.cluster.shard_frames import ShardFrames
from pvibr.cluster.shard_recipes import make_recipes, recipes_of
from pvibr.cluster.shards import ShardView, light_values
from pvibr.core.arguments import checked_whole
from pvibr.core.determinism import is_deterministic
from pvibr.core.params import Param
from pvibr.core.passes import supersampling_of
from pvibr.gl.texture import Texture, nbytes_of, release
from pvibr.substitutes.layer_card import LayerCard
from pvibr.substitutes.layer_maths import part_of
from pvibr.things.thing import Thing, joined_bounds


class _Shown(NamedTuple):
    """A composite on the GPU, as :class:`LayerCard` draws it."""

    color: Texture
    depth: Texture
    rect: tuple[int, ...]
    clip_from_view: np.ndarray
    crop: tuple[float, ...] = (0.0, 0.0, 1.0, 1.0)
    blends: bool = True


class _Unwarped(NamedTuple):
    warp: np.ndarray = np.eye(3)
    turn: np.ndarray = np.eye(4)


class Distributed(Thing):
    """Parts of a scene that the workers of a Dask cluster hold and draw.

    Each worker draws its shard by the camera and lights of the plotter; the pictures are
    composited by depth, with each other and with what is local. Effects that read colour and
    depth, such as bloom and fog, apply to the whole. Those that read normals or ids of surfaces,
    such as outlines, shadows and projected photographs apply only to what is local. It has no
    part in shadows, mirrors and picking.

    Parameters
    ----------
    client : distributed.Client, optional
        The cluster, by default the client that is open.
    make_shard : callable, optional
        Called on the workers as ``make_shard(index, count, *args, **kwargs)``; it returns a
        plotter with shard `index` of `count`. Nothing of it is in this process. By default the
        things of the subplot that can be divided are sent away: instances, spheres, cylinders
        and ellipsoids, with their poses, colours and materials; their scalar bars stay, their
        labels in legends do not. Large meshes are not sent: `make_shard` adds a `part` of each.
    count : int, optional
        Number of shards, by default that of the workers.
    args : tuple
        Further arguments of `make_shard`.
    kwargs : dict, optional
        Its keyword arguments.
    things : sequence of pvibr.Thing, optional
        Those to send, instead of all.
    name : str, optional
        Name in the plotter and in reports.
    **settings
        Settings.

    Raises
    ------
    TypeError, ValueError
        If an argument is not allowed, or cannot be sent to the workers.
    FileNotFoundError
        If a path among the arguments is not there for a worker.
    ImportError
        If the extra ``cluster`` is not installed.
    PvibrError
        If a shard cannot be made; the message has its number and traceback.

    Notes
    -----
    Sort-last: Molnar et al., "A Sorting Classification of Parallel Rendering", 1994.

    Examples
    --------
    >>> import pyvista as pv
    >>> from distributed import Client
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]])
    >>> with Client(processes=False, n_workers=1, dashboard_address=':0') as client:
    ...     shards = pl.ibr.distribute(client)
    ...     pl.show(auto_close=False)
    ...     shards.n_shards
    1
    >>> pl.close()
    """

    FOR_USERS = ('n_shards',)
    web = 'lost', 'it is drawn by the workers'
    coarse = Param(
        0.5,
        'Resolution of pictures while the view moves and quality is lowered, see '
        '`plotter.ibr.interactive_frame_ms`; 1 always draws at full resolution.',
        range='(0, 1]',
    )

    def __init__(
        self,
        client=None,
        make_shard=None,
        *,
        count=None,
        args=(),
        kwargs=None,
        things=None,
        name=None,
        **settings,
    ):
        super().__init__(**settings)
        self.name = name
        self._cluster = Cluster(client)
        self._count = len(self._cluster.workers()) or 1 if count is None else count
        checked_whole('count', self._count, 1, 100_000)
        self._things = things
        self._frames: Any = None
        self._bars: list = []
        self._card = LayerCard()
        self._shown: _Shown | None = None
        self._shown_key: Any = None
        self._redraws = 0
        if make_shard is not None:
            if things is not None:
                raise ValueError('things must be left out with make_shard, which makes all')
            scene = scene_of(self._cluster, make_shard, args, kwargs, name='make_shard')
            self._start(scene, [None] * self._count)
        elif args or kwargs:
            raise ValueError('args and kwargs require make_shard, whose arguments they are')

    def _start(self, scene, data):
        token, count = uuid.uuid4().hex, len(data)
        scenes = [
            replace(scene, key=f'{token}-{k}', args=(k, count, *scene.args)) for k in range(count)
        ]
        self._frames = ShardFrames(self._cluster, scenes, data)
        self._set_bounds(joined_bounds(self._frames.bounds))

    @property
    def n_shards(self) -> int:
        """Number of shards."""
        return self._count

    def _contents(self) -> str:
        return f'{self._count} shards'

    # -- in the scene ------------------------------------------------------------------------

    def attach(self, pipeline):
        """Send things away, and enter the scene."""
        if self._frames is None:
            taken, data = recipes_of(pipeline.things, self._things, self._count)
            self._count = len(data)
            self._start(scene_of(self._cluster, make_recipes, (), None, name='a shard'), data)
            self._bars = kept_bars(taken)
            for thing in taken:
                pipeline.remove(thing)
        super().attach(pipeline)
        for kept in self._bars:
            kept.pipeline = pipeline
            kept.bar.show(kept)

    def detach(self):
        """Leave the scene, and close the plotters of the workers."""
        super().detach()
        for kept in self._bars:
            kept.bar.leave(kept)
        self._frames.close()

    def actors(self) -> list:
        """Return the actors of the quad that shows the composite."""
        return self._card.actors

    def draws(self, frame, *, depth=False) -> list:
        """Return nothing: it is drawn for the eye only."""
        return []

    def depths(self) -> list:
        """Return nothing: it casts no shadows."""
        return []

    def solids(self) -> list:
        """Return nothing: it casts no shadows."""
        return []

    def content_key(self) -> tuple:
        """Return a value that changes with the settings."""
        return (self.revision,)

    # -- frames ------------------------------------------------------------------------------

    def prepare(self, frame):
        """Have the shards drawn, if the view changed since."""
        if not frame.own or frame.picking:
            self._card.hide()
            return
        is_coarse = frame.quality < 1 and not is_deterministic()
        full = supersampling_of(frame.renderer)
        share = full * (self.coarse if is_coarse else 1.0)
        width, height = (max(1, int(share * n)) for n in frame.size)
        samples = frame.window.GetMultiSamples()
        view = ShardView(
            frame.view, (width, height), samples, frame.time, light_values(frame.renderer)
        )
        key = frame.window, frame.size, view.key()
        if key != self._shown_key:
            self._take(frame, view, 'linear' if share < full else 'nearest')
            self._shown_key = key
        if self._shown is None:
            self._card.hide()
            return
        bounds = joined_bounds(self._frames.bounds)
        self._card.show(frame, self._shown, _Unwarped(), bounds, deep=self._depth_is_read(frame))
        self.order = tuple(self._card.order(0))

    def _take(self, frame, view, filter):
        """Adopt the composite of a view."""
        picture = self._frames.picture(view)
        self._redraws += 1
        self._let_go()
        if not picture.depth.size:
            return
        grown = np.divide(frame.size, view.size)
        rect = (np.reshape(picture.rect, (2, 2)) * grown).ravel().tolist()
        clip = frame.clip_from_view
        color = Texture(frame.window, filter=filter).upload(
            picture.blendable(frame.renderer.GetBackground())
        )
        depth = Texture(frame.window).upload(_window_depth(picture.depth, clip))
        part = part_of(clip, frame.size, rect)
        self._shown = _Shown(color, depth, tuple(rect), part)

    def _let_go(self):
        if self._shown is not None:
            release(self._shown.color, self._shown.depth)
        self._shown = self._shown_key = None

    def finish(self, frame):
        """Note failures of the shader."""
        self._card.check()

    def deactivate(self):
        """Draw nothing."""
        self._card.hide()

    def release(self):
        """Free GPU memory; the context is current."""
        self.deactivate()
        self._let_go()
        self._card.release(None if self.pipeline is None else self.pipeline.window)

    def report(self) -> dict:
        """Return bytes of the GPU and of the last frame, frames, and workers that died."""
        shown = self._shown
        return {
            'bytes': 0 if shown is None else nbytes_of(shown.color, shown.depth),
            'shards': self._count,
            'redraws': self._redraws,
            'received_bytes': self._frames.nbytes,
            'deaths': self._frames.deaths,
        }


def _window_depth(distances, clip) -> np.ndarray:
    """Return window depth, 0 to 1, of distances along the view; 1 where they are infinite."""
    z = -np.where(np.isfinite(distances), distances, 1.0).astype(float)
    depth = 0.5 + 0.5 * (clip[2, 2] * z + clip[2, 3]) / (clip[3, 2] * z + clip[3, 3])
    return np.where(np.isfinite(distances), np.clip(depth, 0, 1), 1.0).astype(np.float32)
