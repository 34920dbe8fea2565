"""Meshes, lights and files that tests of several rooms make."""

import errno
import io

import numpy as np
import pyvista as pv
from PIL import Image

from pvibr.core import _vtk


def grid(size=2.0, count=40):
    return pv.Plane(i_size=size, j_size=size, i_resolution=count, j_resolution=count)


#: What plotters enable beside pvibr.
ENABLED = {
    'nothing': lambda pl: None,
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'msaa': lambda pl: pl.enable_anti_aliasing('msaa'),
    'fxaa': lambda pl: pl.renderer.SetUseFXAA(True),
    'ssao': lambda pl: pl.enable_ssao(),
    'edl': lambda pl: pl.enable_eye_dome_lighting(),
    'peeling': lambda pl: pl.enable_depth_peeling(),
    'shadows': lambda pl: pl.enable_shadows(),
    'gradient': lambda pl: pl.set_background('black', top='white'),
}
#: Lit by what shines on it alone.
MATT = {'color': 'white', 'ambient': 0.0, 'diffuse': 1.0, 'specular': 0.0}


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


def turn_of(ahead, up=(0, 0, 1)):
    """Return the rotation of a camera of computer vision: right, down, ahead."""
    ahead = np.array(ahead, float)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(ahead, right), ahead])


#: Lamps over a square at half of their height or less, and half a side of its shadow.
OVER_A_SQUARE = (
    (lamp((0, 0, 9)), 0.25),
    (lamp((0, 0, 3), cone=90), 0.375),
    (lamp((0, 0, 3), cone=40), 0.375),
)


def plane(origin, normal):
    made = _vtk.vtkPlane()
    made.SetOrigin(*origin)
    made.SetNormal(*normal)
    return made


def png(pixels):
    file = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(file, 'PNG')
    return file.getvalue()


def full_disk(*_, **__):
    raise OSError(errno.ENOSPC, 'No space left on device')
