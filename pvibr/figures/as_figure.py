"""Conversion of files, scenes, series and single meshes to figures."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import pyvista as pv

from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.sources import series_of
from pvibr.core.files import existing
from pvibr.formats.trimesh_meshes import as_dataset, is_trimesh
from pvibr.meshes.files import read_mesh

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


def as_figure(thing):
    """Return a figure of anything that can be converted to one."""
    if isinstance(thing, Figure):
        return thing
    if isinstance(thing, (str, PathLike)):
        return _of_file(thing)
    if isinstance(thing, (list, tuple, pv.MultiBlock)) or hasattr(thing, 'set_active_time_value'):
        return Figure.from_series(thing)
    if is_trimesh(thing, 'Scene'):
        return Figure.from_scene(thing)
    return Figure([_as_mesh(thing)])


def _of_file(path):
    kind = Path(path).suffix.lower()
    if kind in _GLTF:
        from pvibr.animation.gltf.read import read_gltf

        return read_gltf(path)
    if kind in _CONVERTERS:
        raise ValueError(f'{path} is not read: save it as .glb, with {_CONVERTERS[kind]}.')
    if _is_series(existing(path)):
        return Figure.from_series(path)
    found = read_mesh(path)
    if isinstance(found, pv.MultiBlock):
        return Figure([_as_mesh(block) for block in _leaves(found)])
    return as_figure(found)


def _is_series(path):
    try:
        return hasattr(pv.get_reader(path), 'set_active_time_value')
    except Exception:  # a format that only trimesh reads
        return False


def _leaves(blocks):
    leaves = blocks.recursive_iterator(skip_none=True, skip_empty=True)
    return [block for block in leaves if block.n_points]


def _as_mesh(thing):
    if isinstance(thing, FigureMesh):
        return thing
    if is_trimesh(thing, 'Trimesh'):
        mesh, look = as_dataset(thing)
        return FigureMesh(mesh, look=look)
    if isinstance(thing, pv.DataSet):
        (surface,), _ = series_of([thing])
        return FigureMesh(surface)
    raise TypeError(
        f'figure is a {type(thing).__name__}: must be a pvibr.Figure, a .glb or .gltf file, a '
        'trimesh.Scene, a mesh, or a list of meshes as a time series'
    )
