"""Sets of many items that a few actors draw."""

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
    """Items with looks of their own.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('instance_of',)
    _stand_ins: Any = None
    #: Frames that are drawn to pick need them too.
    picks = True
    _noun = 'items'
    _changes = _watcher = 0
    _content_key: tuple | None = None

    def _contents(self) -> str:
        return f'{len(self):,} {self._noun}'

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the items' bounding spheres."""
        raise NotImplementedError

    def item_mesh(self, index) -> pv.PolyData:
        """Return the mesh of an item in world units, for VTK's pickers."""
        raise NotImplementedError

    def picked(self) -> list:
        """Return the actors that pickers of VTK find in its place."""
        return [] if self._stand_ins is None else self._stand_ins.actors()

    def instance_of(self, actor) -> int | None:
        """Return the index of the item that an actor stands for, or None.

        Parameters
        ----------
        actor : vtkActor
            Actor that one of PyVista's pickers returned.
        """
        return None if self._stand_ins is None else self._stand_ins.index_of(actor)

    def _is_drawn_for_picker(self, frame) -> bool:
        """Show meshes instead if a frame is drawn to pick; return True if it is."""
        if frame.picking and frame.own:
            self.deactivate()
            if self.pickable:
                self._stand_ins.draw(frame)
        return frame.picking and frame.own

    def _places(self) -> np.ndarray:
        """Return the positions of the items, shape (n, 3), world units."""
        raise NotImplementedError

    def dataset(self) -> pv.PolyData:
        """Return the positions of the items as points, with what is known of each."""
        self.follow()
        mesh = pv.PolyData(np.array(self._places(), float).reshape(-1, 3))
        mesh['visible'] = self.visible
        known = {'colors': self.colors, self.scalar_title() or 'scalars': self.scalars}
        for name, values in known.items():
            if values is not None:
                mesh[name] = values
        return mesh

    def _can_pick(self) -> bool:
        return self.pickable and self.pipeline is not None and self.needed(None) is True

    def content_key(self) -> tuple:
        """Return a value that changes with the content, camera excluded."""
        self.follow()
        return self._changes, self.revision, self.visibility

    def needed(self, frame) -> bool | str:
        """Return True if there is anything to draw, else why not."""
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
        # Before the pipeline starts the frame, which has one clipping range.
        self._watcher = renderer.AddObserver('StartEvent', weakly(self._on_start))

    def _on_start(self):
        with suppress(ValueError):  # raised in the pipeline: VTK's loop swallows errors
            self.follow()
        self._stay_whole(self._changes)

    def _take_out(self, renderer):
        self.deactivate()
        self._stand_ins.take_out()
        renderer.RemoveObserver(self._watcher)
        super()._take_out(renderer)

    def _touch(self):
        """Choose the items again for the next frame."""
        self._content_key = None
        self._changes += 1


class CardSet(ItemSet):
    """Items on cards, sorted among other translucent props where they blend.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('blends',)
    _planes = ClippingPlanes()

    def _begin_drawing(self, *stale):
        """Start without anything on the GPU; name the textures to be made."""
        self.binder = Binder()
        self.textures: dict[str, Texture] = {}
        self._stale = set(stale)

    @property
    def blends(self) -> bool:
        """Whether items are translucent, and so drawn from far to near."""
        return self.prop.GetOpacity() < 1

    # -- the life of an effect ----------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a value that changes with the content, camera excluded."""
        return *super().content_key(), self.blends, self._planes.key()

    def set_clipping_planes(self, planes):
        """Cut it off by a vtkPlaneCollection."""
        found = ClippingPlanes(planes)
        switched = bool(found) != bool(self._planes)
        self._planes = found
        if switched:
            self._switch_clipping()
        if self._stand_ins is not None:
            self._stand_ins.clip(planes)
        self._touch()

    def _switch_clipping(self):
        """Have shaders that clip, or such that do not."""
        raise NotImplementedError

    def prepare(self, frame):
        """Choose which items are drawn, and in which order."""
        if self._is_drawn_for_picker(frame):
            return
        self._upload(frame.window)
        others: list[float] = []
        if self.blends and frame.own and not frame.casting:
            others = self.pipeline.order.others(frame, self, self.pipeline.things)
        camera = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        key = (*camera, frame.casting, others, *self._choice_key())
        if key != self._content_key:
            self._choose(frame, others)
            self._content_key = key

    def _choice_key(self) -> tuple:
        """Return what changes with the choice of items, camera excluded."""
        return self.blends, self._changes, self.revision, self._planes.key()

    def _choose(self, frame, others):
        raise NotImplementedError

    def _order_parts(self, frame, others, parts):
        """Draw parts of the actors that blend in turn with other props, the farthest first."""
        own = float(depths_of(frame, np.array([self.center]))[0])
        places = *others, -np.inf
        self.order = tuple(
            ((*translucent(depth, own), k), actor)
            for depth, part in zip(places, parts, strict=True)
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
        """Upload textures again for the next frame."""
        self._stale |= set(names)
        self._touch()
