"""Conversion of files, scenes, series and single meshes to figures."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import pyvista as pv

from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.figure_sources import series_of
from pvibr.core.files import existing
from pvibr.io.trimesh_meshes import as_dataset, is_trimesh
from pvibr.meshes.mesh_files import read_mesh

#: VRM is glTF by another name.
_GLTF = ('.glb', '.gltf', '.vrm')
_USD = 'Blender or usd2gltf'
#: What writes glTF from files that are not read.
_CONVERTERS = {
    '.fbx': 'Blender or FBX2glTF',
    **dict.fromkeys(('.usd', '.usda', '.usdc', '.usdz'), _USD),
    **dict.fromkeys(('.blend', '.abc', '.bvh'), 'Blender'),
    **dict.fromkeys(('.max', '.ma', '.mb', '.c4d'), 'the exporter of the program that made it'),
}


def as_figure(source):
    """Return a figure of anything that can be converted to one."""
    if isinstance(source, Figure):
        return source
    if isinstance(source, (str, PathLike)):
        return _of_file(source)
    if isinstance(source, (list, tuple, pv.MultiBlock)) or hasattr(
        source, 'set_active_time_value'
    ):
        return Figure.from_series(source)
    if is_trimesh(source, 'Scene'):
        return Figure.from_scene(source)
    return Figure([_as_mesh(source)])


def _of_file(path):
    kind = Path(path).suffix.lower()
    if kind in _GLTF:
        from pvibr.animation.read_gltf import read_gltf

        return read_gltf(path)
    if kind in _CONVERTERS:
        raise ValueError(
            f'figure must be in a format that pvibr reads, got {path}: save it as .glb, '
            f'with {_CONVERTERS[kind]}'
        )
    if _is_series(existing(path)):
        return Figure.from_series(path)
    loaded_data = read_mesh(path)
    if isinstance(loaded_data, pv.MultiBlock):
        leaves = loaded_data.recursive_iterator(skip_none=True, skip_empty=True)
        return Figure([_as_mesh(block) for block in leaves if block.n_points])
    return as_figure(loaded_data)


def _is_series(path):
    try:
        return hasattr(pv.get_reader(path), 'set_active_time_value')
    except Exception:  # a format that only trimesh reads
        return False


def _as_mesh(source):
    if isinstance(source, FigureMesh):
        return source
    if is_trimesh(source, 'Trimesh'):
        mesh, look = as_dataset(source)
        return FigureMesh(mesh, look=look)
    if isinstance(source, pv.DataSet):
        if not source.n_points:
            raise ValueError('figure must have points, got an empty mesh')
        (surface,), _ = series_of([source])
        return FigureMesh(surface)
    raise TypeError(
        'figure must be a pvibr.Figure, a .glb or .gltf file, a trimesh.Scene, a '
        f'mesh, or a list of meshes as a time series, got {type(source).__name__}'
    )
