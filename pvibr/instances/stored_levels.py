"""Lighter meshes as arrays, cached beside their atlas."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.instances.mesh_pool import MeshLevel
from pvibr.meshes.decimate import ACTIVE


def to_arrays(levels) -> dict[str, np.ndarray]:
    """Return the lighter levels of a mesh as named arrays."""
    errors = [np.nan if level.error is None else level.error for level in levels[1:]]
    stored = {'levels': np.array(errors, float)}
    for i, level in enumerate(levels[1:]):
        for j, part in enumerate(level.parts):
            if part is not levels[0].parts[j]:
                shading = np.array(part.actor.GetProperty().GetInterpolation())
                part_arrays = {**_mesh_arrays(part.mesh), 'shading': shading}
                stored |= {f'level{i}.{j}.{k}': a for k, a in part_arrays.items()}
    return stored


def _mesh_arrays(mesh):
    arrays = {'points': np.asarray(mesh.points), 'faces': np.asarray(mesh.regular_faces)}
    for side in ('point', 'cell'):
        data = getattr(mesh, f'{side}_data')
        arrays |= {f'{side}:{name}': np.asarray(data[name]) for name in data}
        arrays[f'{side}.active'] = np.array([getattr(data, name) or '' for name in ACTIVE])
    return arrays


def from_arrays(parts, arrays) -> list[MeshLevel]:
    """Return the levels of a mesh from arrays; invalid ones raise ValueError or KeyError."""
    levels = [MeshLevel(list(parts))]
    for i, error in enumerate(np.asarray(arrays['levels'], float)):
        lighter_parts = [
            _part(part, _below(arrays, f'level{i}.{j}.')) for j, part in enumerate(parts)
        ]
        levels.append(MeshLevel(lighter_parts, None if np.isnan(error) else float(error)))
    return levels


def _below(arrays, prefix):
    return {
        name[len(prefix) :]: array for name, array in arrays.items() if name.startswith(prefix)
    }


def _part(part, arrays):
    if not arrays:
        return part
    points, faces = arrays['points'], arrays['faces']
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError(f'points must be finite, (n, 3), got shape {points.shape}')
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.min() < 0 or faces.max() >= len(points):
        raise ValueError(
            f'faces must be (m, 3) indices of {len(points)} points, got shape {faces.shape}'
        )
    mesh = pv.PolyData.from_regular_faces(np.array(points), np.array(faces))
    for side in ('point', 'cell'):
        data = getattr(mesh, f'{side}_data')
        for name, values in _below(arrays, f'{side}:').items():
            data[name] = np.array(values)
        data.active_scalars_name = None  # PyVista activates any array that is added
        for kind, name in zip(ACTIVE, arrays[f'{side}.active'].tolist(), strict=True):
            if name:
                setattr(data, kind, name)
    return part.with_mesh(mesh, int(arrays['shading']))
