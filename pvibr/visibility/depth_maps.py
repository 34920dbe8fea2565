"""Depth of meshes in the views of calibrated cameras and lights, without a plotter."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import release
from pvibr.gl.drawer import Drawer
from pvibr.gl.hidden_window import hidden_window
from pvibr.maths.views import corners
from pvibr.things.casters import Casters
from pvibr.things.depth_view import DepthView
from pvibr.things.frame import Frame
from pvibr.visibility.surface_samples import bounds_of, with_points

#: Texels along a side that every driver supports.
LARGEST_MAP = 16_384


def depth_maps(views, surfaces, resolution) -> list:
    """Return the depth of meshes in views, (n, n) each, drawn off screen."""
    with depth_scene(surfaces) as scene:
        return [scene.depth(view, resolution) for view in views]


@contextmanager
def depth_scene(surfaces):
    """Yield meshes in a hidden window, to draw their depth."""
    with hidden_window() as (_, renderer):
        scene = _Scene(renderer, surfaces)
        try:
            yield scene
        finally:
            scene.release()


class _Scene:
    """Meshes in a hidden window, centred on the origin for float precision."""

    def __init__(self, renderer, surfaces):
        self.renderer = renderer
        self.bounds = bounds_of(surfaces)
        bounds_corners = corners(self.bounds).reshape(-1, 3)
        self.center = (
            (bounds_corners.min(0) + bounds_corners.max(0)) / 2
            if len(bounds_corners)
            else np.zeros(3)
        )
        self.actors = [_actor(s, self.center) for s in surfaces if s.n_points]
        for actor in self.actors:
            renderer.AddActor(actor)
        self.drawer = Drawer(renderer)
        self._map: Any = None
        self._edges: list = []

    def depth(self, view, resolution):
        """Return the depth in a world-space view, (n, n)."""
        if self._map is None or self._map.resolution != resolution:
            release(self._map)
            self._map = DepthView(self.drawer, 1, resolution)
        shift = np.eye(4)
        shift[:3, 3] = self.center
        centred_view = replace(view, view_from_world=view.view_from_world @ shift, position=None)
        self._map.update(Frame.of(self.renderer), [centred_view], Casters(self.actors))
        return self._map.texture.download()[..., 0]

    def depth_of_edges(self):
        """Return the last depth with the edges and corners of all triangles drawn over it."""
        if not self._edges:
            for style in ('SetRepresentationToWireframe', 'SetRepresentationToPoints'):
                for actor in self.actors:
                    self._edges.append(_vtk.vtkActor())
                    self._edges[-1].SetMapper(_mapper(actor.GetMapper().GetInput()))
                    getattr(self._edges[-1].GetProperty(), style)()
        (view,), side = self._map.views, self._map.resolution
        with self._map.target.drawing():
            self.drawer.look(view, (0, 0, side, side), clear=False)
            self.drawer.draw(self._edges)
        self.drawer.done()
        self._map.keys = [None]
        return self._map.texture.download()[..., 0]

    def release(self):
        release(self._map, self.drawer)
        self.renderer.RemoveAllViewProps()
        for actor in (*self.actors, *self._edges):
            actor.ReleaseGraphicsResources(self.renderer.GetRenderWindow())


def _actor(surface, center):
    actor = _vtk.vtkActor()
    actor.SetMapper(_mapper(with_points(surface, surface.points - center)))
    return actor


def _mapper(surface):
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(surface)
    mapper.ScalarVisibilityOff()
    return mapper
