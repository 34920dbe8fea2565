"""Sharp edges of meshes that move: points are split, and what deforms them follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.animation.correctives import Correctives
from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import Skin
from pvibr.animation.morphs import WIDTHS, Morphs

_ROW = 'ibr_point'


def split_figure(figure, angles):
    """Return a figure with edges split that are sharper than an angle, in degrees for each mesh.

    None leaves a mesh as it is; if nothing is split, the figure itself is returned.
    """
    found = [_split(mesh, angle) for mesh, angle in zip(figure.meshes, angles, strict=True)]
    if all(rows is None for _, rows in found):
        return figure
    correctives = figure.correctives
    if correctives is not None:
        shapes = {
            i: morphs if found[i][1] is None else _morphs_of(morphs, *found[i])
            for i, morphs in correctives.shapes.items()
        }
        correctives = Correctives(correctives.spaces, shapes)
    return Figure(
        [mesh for mesh, _ in found],
        figure.skeleton,
        figure.clips,
        correctives,
        figure.cameras,
        figure.lights,
        figure.name,
    )


def _split(figure_mesh, angle):
    """Return a mesh with split edges and the former number of each point, else itself and None."""
    mesh = figure_mesh.mesh
    if angle is None or not (mesh.n_strips or mesh.GetNumberOfPolys()):
        return figure_mesh, None
    mesh = mesh.copy(deep=False)
    mesh.point_data[_ROW] = np.arange(mesh.n_points)
    how = {'cell_normals': False, 'consistent_normals': False, 'feature_angle': angle}
    mesh = mesh.compute_normals(split_vertices=True, **how)
    rows = np.array(mesh.point_data.pop(_ROW))
    mesh.point_data.pop('pyvistaOriginalPointIds', None)
    if mesh.n_points == figure_mesh.mesh.n_points:
        return figure_mesh, None
    skin, frames = figure_mesh.skin, figure_mesh.frames
    if skin is not None:
        skin = Skin(skin.nodes, skin.inverse_bind, skin.joints[rows], skin.weights[rows])
    if frames is not None:
        frames = replace(frames, positions=frames.positions[:, rows], normals=None)
    split = replace(figure_mesh, mesh=mesh, skin=skin, frames=frames, morphs=None)
    if figure_mesh.morphs is not None:
        split.morphs = _morphs_of(figure_mesh.morphs, split, rows)
    return split, rows


def _morphs_of(morphs, figure_mesh, rows):
    """Return the targets for split points; differences of normals are those of the polygons."""
    several = {
        what: [_rows_of(morphs.target(what, i), rows) for i in range(len(morphs))]
        for what in WIDTHS
        if morphs.has(what)
    }
    several.setdefault('positions', [None] * len(morphs))
    split = Morphs(**several, names=morphs.names, weights=morphs.weights)
    return split.with_normals(figure_mesh.mesh) if morphs.has('normals') else split


def _rows_of(target, rows):
    if target is None:
        return None
    where, values = target
    if isinstance(where, slice):
        return values[rows]
    whole = np.zeros((max(rows.max(), where.max(initial=0)) + 1, values.shape[1]), values.dtype)
    np.add.at(whole, where, values)
    moved = np.flatnonzero(np.isin(rows, where))
    return moved, whole[rows[moved]]
