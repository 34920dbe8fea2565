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
    split_meshes = [_split(mesh, angle) for mesh, angle in zip(figure.meshes, angles, strict=True)]
    if all(origins is None for _, origins in split_meshes):
        return figure
    correctives = figure.correctives
    if correctives is not None:
        shapes = {
            i: morphs if split_meshes[i][1] is None else _split_morphs(morphs, *split_meshes[i])
            for i, morphs in correctives.shapes.items()
        }
        correctives = Correctives(correctives.spaces, shapes)
    return Figure(
        [mesh for mesh, _ in split_meshes],
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
    normal_options = {'cell_normals': False, 'consistent_normals': False, 'feature_angle': angle}
    mesh = mesh.compute_normals(split_vertices=True, **normal_options)
    origins = np.array(mesh.point_data.pop(_ROW))
    mesh.point_data.pop('pyvistaOriginalPointIds', None)
    if mesh.n_points == figure_mesh.mesh.n_points:
        return figure_mesh, None
    skin, frames = figure_mesh.skin, figure_mesh.frames
    if skin is not None:
        skin = Skin(skin.nodes, skin.inverse_bind, skin.joints[origins], skin.weights[origins])
    if frames is not None:
        frames = replace(frames, positions=frames.positions[:, origins], normals=None)
    split = replace(figure_mesh, mesh=mesh, skin=skin, frames=frames, morphs=None)
    if figure_mesh.morphs is not None:
        split.morphs = _split_morphs(figure_mesh.morphs, split, origins)
    return split, origins


def _split_morphs(morphs, figure_mesh, origins):
    """Return the targets for split points; differences of normals are those of the polygons."""
    split_targets = {
        attribute: [
            _split_target(morphs.target(attribute, i), origins) for i in range(len(morphs))
        ]
        for attribute in WIDTHS
        if morphs.has(attribute)
    }
    split_targets.setdefault('positions', [None] * len(morphs))
    split = Morphs(**split_targets, names=morphs.names, weights=morphs.weights)
    return split.with_normals(figure_mesh.mesh) if morphs.has('normals') else split


def _split_target(target, origins):
    if target is None:
        return None
    where, values = target
    if isinstance(where, slice):
        return values[origins]
    dense = np.zeros((max(origins.max(), where.max(initial=0)) + 1, values.shape[1]), values.dtype)
    np.add.at(dense, where, values)
    changed_points = np.flatnonzero(np.isin(origins, where))
    return changed_points, dense[origins[changed_points]]
