"""Unit spheres and cylinders as meshes, in levels of detail."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.meshes.parts import as_parts
from pvibr.textures.material_textures import copy_property

#: Number of sides of each level.
_SIDES = (48, 24, 12, 6)
_OUTLINE_ERROR = 0.5  # px


def balls(prop) -> tuple[list, tuple]:
    """Return the levels of a sphere of radius 1, and their size limits."""
    meshes = [pv.Sphere(radius=1.0, theta_resolution=n, phi_resolution=n // 2) for n in _SIDES]
    return [_level(mesh, prop, True) for mesh in meshes], _largest()


def tubes(prop, capped) -> tuple[list, tuple]:
    """Return the levels of a cylinder of radius 1 along z from -1 to 1, and their size limits."""
    sizes = {'direction': (0, 0, 1), 'radius': 1.0, 'height': 2.0, 'capping': capped}
    meshes = [pv.Cylinder(resolution=n, **sizes).triangulate() for n in _SIDES]
    return [_level(mesh, prop, capped) for mesh in meshes], _largest()


def _level(mesh, prop, closed):
    (part,) = as_parts(mesh, color=prop.color, lighting=prop.lighting, smooth_shading=False)
    copy_property(part.actor.prop, prop)
    part.actor.prop.SetBackfaceCulling(closed)  # or both sides of a translucent one are drawn
    return [part]


def _largest():
    return (np.inf, *(2 * _OUTLINE_ERROR / (1 - np.cos(np.pi / n)) for n in _SIDES[1:]))


def along(middles, halves, radii) -> np.ndarray:
    """Return the matrices of cylinders, (n, 4, 4)."""
    units = halves / np.linalg.norm(halves, axis=1, keepdims=True)
    aside = np.eye(3)[np.abs(units).argmin(1)]
    right = np.cross(units, aside)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    matrices = np.tile(np.eye(4), (len(middles), 1, 1))
    matrices[:, :3, 0] = right * radii[:, None]
    matrices[:, :3, 1] = np.cross(units, right) * radii[:, None]
    matrices[:, :3, 2] = halves
    matrices[:, :3, 3] = middles
    return matrices


def linear(middles, axes) -> np.ndarray:
    """Return matrices of linear parts and translations, (n, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(middles), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = axes, middles
    return matrices
