"""Meshes of single items that exist only while VTK's own pickers look for them."""

from __future__ import annotations

import weakref
from collections import deque
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.core.errors import warn
from pvibr.core.observers import weakly
from pvibr.core.plotters import put_inner
from pvibr.gl.scene_pass import hidden_name
from pvibr.things.clipping import set_planes
from pvibr.things.frame import Frame
from pvibr.things.picking import pixel_ray

#: Most items, the nearest, offered to pickers that cast rays and to pickers that draw.
_CLICKED, _DRAWN = 8, 1024
#: Display points that a ray picker converts: its own, then two corners of the viewport.
_LAST = 3
#: Tolerance of PyVista's pickers, as a fraction of the diagonal.
_TOLERANCE = 0.025


class StandIns:
    """Actors of single items, some for ray pickers and some for pickers that draw."""

    #: Whether a thing converts points itself, which is then no sign of a picker.
    _is_converting = False

    def __init__(self, thing):
        self._thing: Any = weakref.ref(thing)
        self._renderer: Any = None
        self._observer = 0
        #: The display points converted last: the only trace of a picker.
        self._display_points: deque = deque(maxlen=_LAST)
        self._ray_items: tuple = ((), [])
        self._point: tuple = ()
        self._clip_planes: list = []
        self._area_key: tuple | None = None
        #: Indices of the items that the actors of either kind represent.
        self._index_by_rank: dict = {}
        self._drawn_indices: list[int] = []
        self._ray_actors: list = []
        self._drawn_actors: list = []
        #: Setters of the visibility of those for ray pickers, visible while one looks, and of
        #: those for pickers that draw, visible between frames.
        self._set_rays_visible: list = []
        self._set_visible: list = []
        self._are_rays_visible = False
        self._has_warned = self._is_empty = False

    def put_in(self, renderer):
        """Enter a scene."""
        self._renderer = renderer
        if not self._ray_actors:
            self._ray_actors = [_lazy_actor(self, k) for k in range(_CLICKED)]
        self._drawn_actors = [_actor(_vtk.vtkPolyDataMapper()) for _ in range(_CLICKED)]
        self.clip(self._clip_planes)
        for actor in self.actors():
            put_inner(renderer, actor)
        setters = [method(actor, 'SetVisibility') for actor in self.actors()]
        self._set_rays_visible, self._set_visible = setters[:_CLICKED], setters[_CLICKED:]
        self._empty()
        self._observer = renderer.AddObserver('ModifiedEvent', weakly(self._on_convert))
        self.end_frame()

    def actors(self) -> list:
        """Return the actors of both kinds."""
        return [*(actor for actor, _ in self._ray_actors), *self._drawn_actors]

    def clip(self, planes):
        """Clip the items by planes, or by none."""
        self._clip_planes = list(planes or ())
        for actor in self.actors():
            set_planes(actor.GetMapper(), self._clip_planes)

    def take_out(self):
        """Leave the scene."""
        self._renderer.RemoveObserver(self._observer)
        for actor in self.actors():
            self._renderer.RemoveViewProp(actor)
        self._renderer = None
        self._set_rays_visible, self._set_visible = [], []
        self._drawn_actors, self._drawn_indices = [], []
        self._area_key = None

    def _on_convert(self):
        display_point = self._renderer.GetDisplayPoint()[:2]
        if self._is_converting or (
            self._display_points and self._display_points[-1] == display_point
        ):
            return
        self._display_points.append(display_point)
        self._show_rays(self._is_pickable())
        if display_point != self._point and not self._has_drawn(*display_point):
            self._empty()
        self._point = display_point
        for _, source in self._ray_actors:
            source.Modified()

    def _has_drawn(self, x, y) -> bool:
        """Return True if a picker that drew a pixel asks for the position of what it found."""
        if self._area_key is None:
            return False
        (x0, y0, x1, y1), _, content_key = self._area_key
        thing = self._thing()
        is_inside = x0 - 1 <= x <= x1 + 1 and y0 - 1 <= y <= y1 + 1
        return is_inside and thing is not None and content_key == thing.content_key()

    def _empty(self):
        """Drop the meshes for pickers that draw: ray pickers would find them."""
        if self._area_key is None and self._is_empty:
            return
        self._area_key, self._is_empty = None, True
        for actor in self._drawn_actors:
            actor.GetMapper().SetInputDataObject(_vtk.vtkPolyData())

    def begin_frame(self):
        """Hide what is shown to pickers between frames."""
        if self._renderer.GetSelector() is None:
            self._empty()
        if self._are_rays_visible:
            self._show_rays(False)
        for set_visible in self._set_visible:
            set_visible(False)
        for actor in self._drawn_actors[_CLICKED:]:
            actor.VisibilityOff()

    def _is_pickable(self) -> bool:
        thing = self._thing()
        return thing is not None and thing.pickable and thing.visibility

    def _show_rays(self, are_visible):
        if are_visible != self._are_rays_visible:
            self._are_rays_visible = are_visible
            for set_visible in self._set_rays_visible:
                set_visible(are_visible)

    def end_frame(self):
        """Let pickers find items between frames."""
        is_pickable = self._is_pickable()
        # The hardware picker draws only what is visible before its first frame.
        for set_visible in self._set_visible:
            set_visible(is_pickable)
        self._display_points.clear()

    # -- pickers by rays ----------------------------------------------------------------------

    def fill(self, k, output):
        """Put the mesh of the k-th item under a ray picker into an output."""
        thing = self._thing()
        item_indices = self._candidates(thing) if thing is not None and self._renderer else []
        output.Initialize()
        if k < len(item_indices):
            self._index_by_rank[k] = item_indices[k]
            output.ShallowCopy(_named(thing, item_indices[k]))

    def _candidates(self, thing) -> list[int]:
        if len(self._display_points) < _LAST:
            return []
        pick_key = tuple(self._display_points), thing.content_key()
        if self._ray_items[0] != pick_key:
            self._index_by_rank = {}
            self._ray_items = pick_key, self._items_near(thing, *self._place())
        return self._ray_items[1]

    def _place(self):
        """Return a picker's pixel; afterwards it converts both corners of the viewport."""
        width, height = self._renderer.GetRenderWindow().GetSize()
        _, _, right, top = self._renderer.GetViewport()
        has_corners = np.allclose(self._display_points[-1], (width * right, height * top))
        return self._display_points[0 if has_corners else -1]

    def _items_near(self, thing, x, y) -> list[int]:
        with self._converting():
            ray_start, direction = pixel_ray(self._renderer, x, y)
            hit = thing.pick(x, y)
        frame = Frame.of(self._renderer)
        centers, radii = thing.item_spheres()
        from_start = centers - ray_start
        ray_distances = from_start @ direction
        ray_gaps = np.linalg.norm(from_start - ray_distances[:, None] * direction, axis=1)
        pixel_sizes = (1.0 if frame.parallel else np.maximum(ray_distances, 0)) / frame.pixel_scale
        max_gaps = radii + _TOLERANCE * np.hypot(*frame.size) * pixel_sizes
        item_indices = np.flatnonzero(
            thing.drawn_items() & (ray_gaps <= max_gaps) & (ray_distances + radii > 0)
        )
        item_indices = item_indices[
            np.argsort((ray_distances - radii)[item_indices], kind='stable')
        ].tolist()
        hit_first = [] if hit is None else [hit.index]
        return list(dict.fromkeys([*hit_first, *item_indices[:_CLICKED]]))[:_CLICKED]

    @contextmanager
    def _converting(self):
        """Convert points with the renderer, and restore the picker's afterwards."""
        renderer = self._renderer
        world_point, display_point = renderer.GetWorldPoint(), renderer.GetDisplayPoint()
        StandIns._is_converting = True
        try:
            yield
        finally:
            renderer.SetDisplayPoint(*display_point)
            renderer.SetWorldPoint(*world_point)
            StandIns._is_converting = False

    # -- pickers that draw --------------------------------------------------------------------

    def draw(self, frame):
        """Show the items in the area of a picker that draws the scene, in each of its passes."""
        thing = self._thing()
        view_key = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        picked_area = tuple(self._renderer.GetSelector().GetArea())
        key = picked_area, view_key, thing.content_key()
        if key == self._area_key:
            self._show_drawn()
            return
        self._area_key = key
        item_indices = self._in_area(thing, frame)
        if len(item_indices) > _DRAWN and not self._has_warned:
            self._has_warned = True
            warn(
                f"{thing.name}: VTK's hardware picker sees only the nearest {_DRAWN} of the "
                f'{len(item_indices)} items there; plotter.ibr.pick and frustum picking see all'
            )
        item_indices = item_indices[:_DRAWN]
        for _ in range(len(item_indices) - len(self._drawn_actors)):
            self._drawn_actors.append(_actor(_vtk.vtkPolyDataMapper()))
            set_planes(self._drawn_actors[-1].GetMapper(), self._clip_planes)
            put_inner(self._renderer, self._drawn_actors[-1])
        self._drawn_indices, self._is_empty = item_indices, False
        for actor, index in zip(self._drawn_actors, item_indices, strict=False):
            actor.GetMapper().SetInputDataObject(_named(thing, index))
        self._show_drawn()

    def _show_drawn(self):
        for k, actor in enumerate(self._drawn_actors):
            actor.SetVisibility(k < len(self._drawn_indices))

    def _in_area(self, thing, frame) -> list[int]:
        centers, radii = thing.item_spheres()
        view, clip = frame.view_from_world, frame.clip_from_view
        view_points = centers @ view[:3, :3].T + view[:3, 3]
        clip_points = view_points @ clip[:, :3].T + clip[:, 3]
        depths, w = -view_points[:, 2], np.maximum(clip_points[:, 3], 1e-30)
        pixels = (clip_points[:, :2] / w[:, None] + 1) / 2 * frame.size + frame.origin
        pixel_radii = radii * frame.pixel_scale / (1.0 if frame.parallel else w)
        x0, y0, x1, y1 = self._renderer.GetSelector().GetArea()
        pixel_gaps = np.maximum((x0, y0) - pixels, pixels - (x1, y1)).max(1)
        overlaps = (pixel_gaps <= pixel_radii + 1) & (depths > 0) | (depths <= radii)
        in_area = np.flatnonzero(thing.drawn_items() & overlaps & (depths + radii > 0))
        return in_area[np.argsort(depths[in_area], kind='stable')].tolist()

    def index_of(self, actor) -> int | None:
        """Return the index of the item that a picked actor represents, or None."""
        for k, (stand_in, _) in enumerate(self._ray_actors):
            if stand_in is actor:
                return self._index_by_rank.get(k)
        pairs = zip(self._drawn_actors, self._drawn_indices, strict=False)
        return next((index for stand_in, index in pairs if stand_in is actor), None)

    def release(self, window):
        """Free GPU memory; the context is current."""
        for actor in self._drawn_actors if window is not None else ():
            actor.ReleaseGraphicsResources(window)


def _named(thing, index):
    mesh = thing.item_mesh(index)
    mesh.field_data['index'] = [index]
    return mesh


def _actor(mapper):
    mapper.ScalarVisibilityOff()
    actor = pv.Actor()
    actor.SetMapper(mapper)
    actor.SetObjectName(hidden_name('stand-in for pickers'))
    actor.UseBoundsOff()
    actor.VisibilityOff()
    return actor


def _lazy_actor(owner, k):
    """Return an actor whose mesh is made on demand, and its source."""
    source = _vtk.vtkProgrammableSource()
    # PyVista's pickers return the output itself, so it must be a PyVista mesh.
    output, owner = pv.PolyData(), weakref.ref(owner)
    source.GetExecutive().SetOutputData(0, output)

    def fill():
        # VTK holds the function; a reference to the thing would be a cycle through C++.
        stand_ins = owner()
        if stand_ins is not None:
            stand_ins.fill(k, output)

    source.SetExecuteMethod(fill)
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    return _actor(mapper), source
