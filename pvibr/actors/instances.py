"""Many instances of heavy meshes, drawn with an error that the user chooses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr import _vtk
from pvibr.actors.bake import bake
from pvibr.actors.cards import Binder
from pvibr.actors.kind import Kind
from pvibr.actors.meshes import MeshLevel
from pvibr.actors.parts import as_meshes
from pvibr.actors.poses import as_poses


@dataclass(frozen=True)
class Limits:
    """On-screen diameters, in pixels, at which levels change.

    Attributes
    ----------
    cards : tuple of (str, float, float)
        Program, from, to.
    mesh : float
        From here on meshes are drawn.
    meshes : tuple of float
        For each mesh level the largest diameter at which it is good enough; the first is inf.
    """

    cards: tuple
    mesh: float
    meshes: tuple


class Instances:
    """First version."""

    def __init__(self, mesh, poses, *, index=None, max_error=1.0, **kw):
        meshes = as_meshes(mesh if isinstance(mesh, (list, tuple)) else [mesh], **kw)
        self.poses = as_poses(poses)
        index = np.zeros(len(self.poses), int) if index is None else np.asarray(index)
        self.max_error = max_error
        self.binder = Binder()
        self.kinds = []
        for k, parts in enumerate(meshes):
            ids = np.flatnonzero(index == k)
            if len(ids):
                self.kinds.append(Kind([MeshLevel(parts)], bake(parts), ids, self.poses))
        self.renderer = None
        self.limits = Limits((('far', 0, 8), ('middle', 8, 24), ('near', 24, 64)), 64, (np.inf,))
        self.stamp = None

    def attach(self, renderer):
        self.renderer = renderer

    def prepare(self, frame):
        stamp = (frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size)
        if stamp == self.stamp:
            return
        self.stamp = stamp
        b = np.array([k.bounds for k in self.kinds])
        bounds = np.empty(6)
        bounds[::2], bounds[1::2] = b[:, ::2].min(0), b[:, 1::2].max(0)
        for kind in self.kinds:
            if kind.cards is None:
                prop = _vtk.vtkProperty()
                prop.DeepCopy(kind.levels[0].parts[0].actor.GetProperty())
                kind.upload(frame.window, self.binder, prop, bounds)
                for a in kind.actors():
                    self.renderer.AddViewProp(a)
            for a in kind.select(frame, self.limits):
                self.renderer.AddViewProp(a)
