"""The mesh of a view in exports: its surface, and lines where it shows edges."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.meshes.parts import as_parts
from pvibr.textures.material_textures import copied_property

_EDGE_FLAGS = _vtk.vtkDataSetAttributes.EDGEFLAG


def bake_cut(scene, owner, part, mesh):
    """Add a mesh with the look of a part, and the owner's material and range, to a scene."""
    prop, flags = owner.prop, mesh.GetPointData().GetAttribute(_EDGE_FLAGS)
    if flags is not None:
        has_edge = _vtk.vtk_to_numpy(flags).astype(bool)
        mesh.point_data.remove(flags.GetName())
    surface = part.with_mesh(mesh)
    surface.actor.SetProperty(prop)
    surface.actor.GetMapper().SetScalarRange(owner.GetMapper().GetScalarRange())
    if prop.GetEdgeVisibility() and flags is not None:
        # Exports show the edges of triangles, which divide the faces of a mesh.
        plain = copied_property(prop)
        plain.EdgeVisibilityOff()
        surface.actor.SetProperty(plain)
        edges = _edges(mesh, has_edge)
        edges.points = scene.frame.before(np.asarray(edges.points, float))
        lines = as_parts(edges, color=prop.GetEdgeColor(), lighting=False)
        lines[0].actor.prop.line_width = prop.GetLineWidth()
        scene.strokes(lines, np.eye(4)[None])
    scene.part(owner, surface)


def _edges(mesh, has_edge) -> pv.PolyData:
    """Return the edges that start at some corners of a mesh's triangles as lines."""
    faces = mesh.regular_faces
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    pairs = np.stack([starts, ends], 1)[has_edge[starts]]
    lines = np.insert(pairs, 0, 2, axis=1).ravel()
    return pv.PolyData(mesh.points, lines=lines)
