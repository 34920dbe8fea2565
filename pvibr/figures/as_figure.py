"""Conversion of files, scenes, series and single meshes to figures."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import pyvista as pv

from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.sources import series_of
from pvibr.formats.trimesh_meshes import as_dataset, is_trimesh


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
    if Path(path).suffix.lower() in ('.glb', '.gltf'):
        from pvibr.animation.gltf.read import read_gltf

        return read_gltf(path)
    return Figure.from_series(path)


def _as_mesh(thing):
    if isinstance(thing, FigureMesh):
        return thing
    if is_trimesh(thing, 'Trimesh'):
        mesh, look = as_dataset(thing)
        return FigureMesh(mesh, look=look)
    if isinstance(thing, pv.DataSet):
        (surface,), _ = series_of([thing])
        return FigureMesh(surface)
    msg = (
        f'figure is a {type(thing).__name__}: must be a pvibr.Figure, a .glb or .gltf file, a '
        'trimesh.Scene, a mesh, or a list of meshes as a time series'
    )
    raise TypeError(msg)
