"""Sets of many items drawn by a few actors."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core.observers import weakly
from pvibr.gl import Texture
from pvibr.gl.binder import Binder
from pvibr.things.clipping import ClippingPlanes
from pvibr.things.draw_order import depths_of, translucent
from pvibr.things.painted import Painted
from pvibr.things.placing import PlacedItems
from pvibr.things.stand_ins import StandIns


class ItemSet(PlacedItems, Painted):
    """Items with individual looks.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('instance_of',)
    _stand_ins: Any = None
    #: Also drawn in picking frames.
    picks = True
    _noun = 'items'
    _changes = _watcher = 0
    _content_key: tuple | None = None

    def _contents(self) -> str:
        return f'{len(self):,} {self._noun}'

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the items' bounding spheres, world units."""
        raise NotImplementedError

    def item_mesh(self, index) -> pv.PolyData:
        """Return an item's mesh in world units, for VTK's pickers."""
        raise NotImplementedError

    def picked(self) -> list:
        """Return the actors that VTK's pickers find in its place."""
        return [] if self._stand_ins is None else self._stand_ins.actors()

    def instance_of(self, actor) -> int | None:
        """Return the index of the item that a picked actor represents, or None.

        Parameters
        ----------
        actor : vtkActor
            Actor returned by one of PyVista's pickers.
        """
        return None if self._stand_ins is None else self._stand_ins.index_of(actor)

    def _is_drawn_for_picker(self, frame) -> bool:
        """In a picking frame show meshes instead, and return True."""
        if frame.picking and frame.own:
            self.deactivate()
            if self.pickable:
                self._stand_ins.draw(frame)
        return frame.picking and frame.own

    def _places(self) -> np.ndarray:
        """Return the item positions, shape (n, 3), world units."""
        raise NotImplementedError

    def dataset(self) -> pv.PolyData:
        """Return the item positions as points, with the items' attributes as arrays."""
        self.follow()
        mesh = pv.PolyData(np.array(self._places(), float).reshape(-1, 3))
        mesh['visible'] = self.visible
        item_arrays = {'colors': self.colors, self.scalar_title() or 'scalars': self.scalars}
        for name, values in item_arrays.items():
            if values is not None:
                mesh[name] = values
        return mesh

    def _can_pick(self) -> bool:
        return self.pickable and self.pipeline is not None and self.needed(None) is True

    def content_key(self) -> tuple:
        """Return a value that changes with the content, but not with the camera."""
        self.follow()
        return self._changes, self.revision, self.visibility

    def needed(self, frame) -> bool | str:
        """Return True if there is anything to draw, else the reason."""
        self.follow()
        if not self.visibility:
            return super().needed(frame)
        return bool(len(self)) or f'no {self._noun}'

    def deactivate(self):
        """Hide all actors."""
        for actor in self.actors():
            actor.VisibilityOff()
        self._content_key = None

    def attach(self, pipeline):
        """Add its props to the scene."""
        self._framed = self._changes, self.GetBounds()
        super().attach(pipeline)

    def _put_in(self, renderer):
        super()._put_in(renderer)
        self._stand_ins = self._stand_ins or StandIns(self)
        self._stand_ins.put_in(renderer)
        # Before the pipeline's own observer, so that the frame has one clipping range.
        self._watcher = renderer.AddObserver('StartEvent', weakly(self._on_start))

    def _on_start(self):
        with suppress(ValueError):  # the pipeline raises it: VTK swallows errors here
            self.follow()
        self._stay_whole(self._changes)

    def _take_out(self, renderer):
        self.deactivate()
        self._stand_ins.take_out()
        renderer.RemoveObserver(self._watcher)
        super()._take_out(renderer)

    def _touch(self):
        """Choose the items again in the next frame."""
        self._content_key = None
        self._changes += 1


class CardSet(ItemSet):
    """Items on cards, depth-sorted with other translucent props where they blend.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('blends',)
    _planes = ClippingPlanes()

    def _begin_drawing(self, *stale):
        """Start with nothing on the GPU; name the textures to upload."""
        self.binder = Binder()
        self.textures: dict[str, Texture] = {}
        self._stale = set(stale)

    @property
    def blends(self) -> bool:
        """Whether items are translucent, and so drawn back to front."""
        return self.prop.GetOpacity() < 1

    # -- the life of an effect ----------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a value that changes with the content, but not with the camera."""
        return *super().content_key(), self.blends, self._planes.key()

    def set_clipping_planes(self, planes):
        """Clip it by a vtkPlaneCollection."""
        clip_planes = ClippingPlanes(planes)
        toggles_clipping = bool(clip_planes) != bool(self._planes)
        self._planes = clip_planes
        if toggles_clipping:
            self._switch_clipping()
        if self._stand_ins is not None:
            self._stand_ins.clip(planes)
        self._touch()

    def _switch_clipping(self):
        """Use shaders with, or without, clipping."""
        raise NotImplementedError

    def prepare(self, frame):
        """Choose which items are drawn, and in which order."""
        if self._is_drawn_for_picker(frame):
            return
        self._upload(frame.window)
        other_depths: list[float] = []
        if self.blends and frame.own and not frame.casting:
            other_depths = self.pipeline.order.others(frame, self, self.pipeline.things)
        camera_key = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        choice_key = (*camera_key, frame.casting, other_depths, *self._choice_key())
        if choice_key != self._content_key:
            self._choose(frame, other_depths)
            self._content_key = choice_key

    def _choice_key(self) -> tuple:
        """Return what determines the choice of items, besides the camera."""
        return self.blends, self._changes, self.revision, self._planes.key()

    def _choose(self, frame, others):
        raise NotImplementedError

    def _order_parts(self, frame, other_depths, parts):
        """Interleave parts of the blending actors with other props, back to front."""
        own_depth = float(depths_of(frame, np.array([self.center]))[0])
        depths = *other_depths, -np.inf
        self.order = tuple(
            ((*translucent(depth, own_depth), k), actor)
            for depth, part in zip(depths, parts, strict=True)
            for k, actor in enumerate(part)
        )

    def finish(self, frame):
        """Release the texture units."""
        self.binder.unbind()

    # -- the GPU ------------------------------------------------------------------------------

    def _upload(self, window):
        raise NotImplementedError

    def _repaint(self):
        self._drop('ibr_looks')

    def _drop(self, *names):
        """Upload textures again in the next frame."""
        self._stale |= set(names)
        self._touch()
