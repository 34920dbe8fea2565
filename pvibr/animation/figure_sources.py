"""Conversion of arrays, series of meshes and trimesh scenes to figures."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike

import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import FigureMesh, Skin
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton
from pvibr.animation.skinning import MAX_INFLUENCES
from pvibr.core.errors import warn
from pvibr.core.files import existing
from pvibr.io.trimesh_meshes import as_dataset

#: Data derived from the points, which are recomputed.
_DERIVED = ('Normals', 'Tangents')
#: A quarter turn about x, (w, x, y, z).
_Z_UP = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def surface_of(points, faces, normals=None):
    """Return arrays as a checked mesh."""
    points = np.asarray(points)
    points = points if points.dtype.kind == 'f' else points.astype(np.float64)
    faces = np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError(
            f'points must be finite numbers of shape (v, 3), got {points.dtype} of shape '
            f'{points.shape}'
        )
    if faces.dtype.kind not in 'iu' or faces.ndim not in (1, 2):
        raise ValueError(
            f'faces must be whole numbers, (f, 3) or flat, got {faces.dtype} of shape '
            f'{faces.shape}'
        )
    if faces.ndim == 2:
        mesh = pv.PolyData.from_regular_faces(points, faces)
    else:
        mesh = pv.PolyData(points, faces)
    point_ids = mesh.GetPolys().GetConnectivityArray()
    low, high = point_ids.GetRange() if point_ids.GetNumberOfValues() else (0, -1)
    if low < 0 or high >= len(points):
        raise ValueError(f'faces must be from 0 to {len(points) - 1}, got {low:g} to {high:g}')
    if normals is not None:
        mesh.point_data.active_normals = np.asarray(normals, dtype=np.float64)
    return mesh


def skeleton_and_skin(joints, weights, parents, rest, inverse_bind=None, names=None):
    """Return a skeleton and a skin on all its joints, or None for what is missing."""
    if (parents is None) != (rest is None):
        raise ValueError('parents and rest must be given together, got only one')
    if joints is not None and weights is None:
        raise ValueError('weights must be given with joints, got None')
    if parents is None:
        if weights is not None:
            raise ValueError('parents and rest must be given with weights, got neither')
        return None, None
    skeleton = Skeleton(parents, rest, names)
    if weights is None:
        return skeleton, None
    if joints is None:
        joints, weights = heaviest(weights, len(skeleton))
    if inverse_bind is None:
        figure_from_joint = skeleton.world(skeleton.rest)
        singular_joints = np.flatnonzero(np.linalg.det(figure_from_joint[:, :3, :3]) == 0)
        if len(singular_joints):
            raise ValueError(
                f'rest[{singular_joints[0]}] must be invertible, got a singular matrix; give '
                'inverse_bind'
            )
        inverse_bind = np.linalg.inv(figure_from_joint)
    return skeleton, Skin(np.arange(len(skeleton)), inverse_bind, joints, weights)


def heaviest(weights, joint_count):
    """Return the joints (v, k) that influence each vertex, and weights, from dense weights."""
    weights = np.asarray(weights, dtype=np.float64)
    if weights.ndim != 2 or weights.shape[1] != joint_count:
        raise ValueError(f'weights without joints must be (v, {joint_count}), got {weights.shape}')
    counts = (weights != 0).sum(1)
    if counts.max(initial=0) > MAX_INFLUENCES:
        worst_vertex = counts.argmax()
        raise ValueError(
            f'weights[{worst_vertex}] must have at most {MAX_INFLUENCES} joints, got '
            f'{counts[worst_vertex]}'
        )
    joints = np.argsort(np.abs(weights), axis=1)[:, ::-1][:, : max(counts.max(initial=0), 1)]
    return joints, np.take_along_axis(weights, joints, 1)


def series_of(meshes, times=None):
    """Return the surfaces of a series and their times."""
    if isinstance(meshes, (str, PathLike)):
        meshes = pv.get_reader(existing(meshes))
    if hasattr(meshes, 'set_active_time_value'):
        reader, meshes, reader_times = meshes, [], list(meshes.time_values)
        for time in reader_times:
            reader.set_active_time_value(time)
            meshes.append(reader.read())
        times = reader_times if times is None else times
    elif hasattr(meshes, 'read'):
        raise ValueError(
            f'meshes must be a series, got {type(meshes).__name__}, which reads a single '
            'mesh; give a list of files'
        )
    surfaces = [_surface(mesh, f'meshes[{i}]') for i, mesh in enumerate(meshes)]
    _warn_of_data(surfaces)
    return surfaces, times


def scene_of(scene):
    """Return the meshes and the skeleton of a trimesh scene."""
    edges = {child: (parent, data) for parent, child, data in scene.graph.to_edgelist()}
    names = [scene.graph.base_frame, *(n for n in scene.graph.nodes if n in edges)]
    joint_index = {node: i for i, node in enumerate(names)}
    parents = [joint_index[edges[name][0]] if name in edges else -1 for name in names]
    local = [edges[n][1].get('matrix', np.eye(4)) if n in edges else np.eye(4) for n in names]
    textures: dict = {}
    meshes = []
    for node, (_, data) in edges.items():
        geometry = scene.geometry.get(data.get('geometry'))
        if geometry is None:
            continue
        is_surface = hasattr(geometry, 'faces')  # else a path or a point cloud
        mesh, look = (
            as_dataset(geometry, textures=textures) if is_surface else (pv.wrap(geometry), {})
        )
        meshes.append(FigureMesh(mesh, joint_index[node], look=look, name=str(node)))
    return meshes, Skeleton(parents, Pose.from_matrices(local, name='rest'), names)


def upright(meshes, skeleton):
    """Return the same meshes and joints below a root joint that turns them from y up to z up."""
    root, rest = len(skeleton), skeleton.rest
    pose = Pose(
        np.vstack([rest.translation, np.zeros(3)]),
        np.vstack([rest.rotation, _Z_UP]),
        np.vstack([rest.scale, np.ones(3)]),
    )
    parents = np.append(np.where(skeleton.parents < 0, root, skeleton.parents), -1)
    # Meshes without a joint turn, too.
    turned = [replace(mesh, node=root) if mesh.node < 0 else mesh for mesh in meshes]
    return turned, Skeleton(parents, pose, [*skeleton.names, 'upright'])


def _surface(mesh, name):
    if isinstance(mesh, (str, PathLike)):
        mesh = pv.read(existing(mesh))
    if isinstance(mesh, pv.MultiBlock):
        leaves = [block for block in mesh.recursive_iterator(skip_none=True) if block.n_points]
        if len(leaves) != 1:
            raise ValueError(
                f'{name} must hold one mesh, got {len(leaves)}; merge them, or make a '
                'series of each'
            )
        (mesh,) = leaves
    if mesh is None:
        raise ValueError(f'{name} must be a mesh, got None')
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(f'{name} must be a mesh, got {type(mesh).__name__}')
    return mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm=None)


def _warn_of_data(surfaces):
    """Warn of data arrays that change over the series."""
    changing = [
        name
        for mesh in surfaces[:1]
        for data_kind in ('point_data', 'cell_data')
        for name, values in getattr(mesh, data_kind).items()
        if name not in _DERIVED
        and not all(_same(values, getattr(m, data_kind).get(name, values)) for m in surfaces)
    ]
    if changing:
        names = ', '.join(repr(name) for name in changing[:5]) + ', ...' * (len(changing) > 5)
        warn(f'{names} differ between meshes: the figure shows those of the first mesh')


def _same(first_values, other_values):
    return first_values.shape == other_values.shape and np.array_equal(
        first_values, other_values, equal_nan=first_values.dtype.kind in 'fc'
    )
