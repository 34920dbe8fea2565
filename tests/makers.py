"""Meshes, lights and files that tests of several rooms make."""

from __future__ import annotations

import io

import numpy as np
import pyvista as pv
from PIL import Image

from pvibr.core import _vtk


def grid(size=2.0, count=40):
    return pv.Plane(i_size=size, j_size=size, i_resolution=count, j_resolution=count)


def soup(mesh):
    """Return triangles that share no points."""
    return pv.PolyData.from_regular_faces(
        mesh.points[mesh.regular_faces].reshape(-1, 3), np.arange(3 * mesh.n_cells).reshape(-1, 3)
    )


def sheet(points):
    """Return triangles between each three neighbours of a list of points."""
    rows = np.arange(len(points) - 2)[:, None] + range(3)
    return pv.PolyData.from_regular_faces(points, rows)


def lamp(position, focus=(0, 0, 0), cone=None):
    light = pv.Light(position=position, focal_point=focus, light_type='scene light')
    if cone is not None:
        light.positional, light.cone_angle = True, cone
    return light


def plane(origin, normal):
    made = _vtk.vtkPlane()
    made.SetOrigin(*origin)
    made.SetNormal(*normal)
    return made


def png(pixels):
    file = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(file, 'PNG')
    return file.getvalue()
