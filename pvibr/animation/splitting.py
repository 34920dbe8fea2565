"""Meshes that move with other points, copies of theirs or fewer: what deforms them follows."""

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
    pairs = enumerate(zip(figure.meshes, angles, strict=True))
    split_meshes = {i: _split(mesh.mesh, angle) for i, (mesh, angle) in pairs}
    split_meshes = {i: split for i, split in split_meshes.items() if split is not None}
    return with_points(figure, split_meshes, other_normals=True) if split_meshes else figure


def _split(mesh, angle):
    """Return a mesh with split edges and the former number of each point, None if none splits."""
    if angle is None or not (mesh.n_strips or mesh.GetNumberOfPolys()):
        return None
    point_count, mesh = mesh.n_points, mesh.copy(deep=False)
    mesh.point_data[_ROW] = np.arange(point_count)
    normal_options = {'cell_normals': False, 'consistent_normals': False, 'feature_angle': angle}
    mesh = mesh.compute_normals(split_vertices=True, **normal_options)
    origins = np.array(mesh.point_data.pop(_ROW))
    mesh.point_data.pop('pyvistaOriginalPointIds', None)
    return None if mesh.n_points == point_count else (mesh, origins)


def with_points(figure, meshes, *, other_normals=False) -> Figure:
    """Return a figure with other points of some meshes: {index: (mesh, former numbers)}.

    If they have other normals than before, those of deformed meshes are computed.
    """
    figure_meshes, correctives = list(figure.meshes), figure.correctives
    shapes = {} if correctives is None else dict(correctives.shapes)
    for i, (mesh, origins) in meshes.items():
        figure_meshes[i] = _with_points(figure.meshes[i], mesh, origins, other_normals)
        if i in shapes:
            shapes[i] = _morphs_of(shapes[i], figure_meshes[i], origins, other_normals)
    if correctives is not None:
        correctives = Correctives(correctives.spaces, shapes)
    return Figure(
        figure_meshes,
        figure.skeleton,
        figure.clips,
        correctives,
        figure.cameras,
        figure.lights,
        figure.name,
    )


def _with_points(figure_mesh, mesh, origins, other_normals):
    skin, frames = figure_mesh.skin, figure_mesh.frames
    if skin is not None:
        skin = Skin(skin.nodes, skin.inverse_bind, skin.joints[origins], skin.weights[origins])
    if frames is not None:
        normals = None if other_normals else frames.normals[:, origins]
        frames = replace(frames, positions=frames.positions[:, origins], normals=normals)
    changed = replace(figure_mesh, mesh=mesh, skin=skin, frames=frames, morphs=None)
    if figure_mesh.morphs is not None:
        changed.morphs = _morphs_of(figure_mesh.morphs, changed, origins, other_normals)
    return changed


def _morphs_of(morphs, figure_mesh, origins, other_normals):
    """Return the targets for other points; other normals change as those of the polygons."""
    targets = {
        attribute: [_target_of(morphs.target(attribute, i), origins) for i in range(len(morphs))]
        for attribute in WIDTHS
        if morphs.has(attribute)
    }
    targets.setdefault('positions', [None] * len(morphs))
    split = Morphs(**targets, names=morphs.names, weights=morphs.weights)
    is_computed = other_normals and morphs.has('normals')
    return split.with_normals(figure_mesh.mesh) if is_computed else split


def _target_of(target, origins):
    if target is None:
        return None
    where, values = target
    if isinstance(where, slice):
        return values[origins]
    dense = np.zeros((max(origins.max(), where.max(initial=0)) + 1, values.shape[1]), values.dtype)
    np.add.at(dense, where, values)
    changed_points = np.flatnonzero(np.isin(origins, where))
    return changed_points, dense[origins[changed_points]]
