"""Balls and tubes of size 1 as meshes, in levels of ever fewer triangles."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.actors.parts import as_parts, copy_property

#: Sides around of each level.
_SIDES = (48, 24, 12, 6)
_CLOSE = 0.5  # px by which an outline may be off


def balls(prop) -> tuple[list, tuple]:
    """Return spheres of radius 1.

    Parameters
    ----------
    prop : pyvista.Property
        How they look.

    Returns
    -------
    levels : list of list of pvibr.actors.parts.Part
        The best first.
    largest : tuple of float
        The largest diameter in pixels at which each is good enough.

    Examples
    --------
    >>> import pyvista as pv
    >>> levels, largest = balls(pv.Property())
    >>> len(levels) == len(largest), largest[0]
    (True, inf)
    """
    meshes = [pv.Sphere(radius=1.0, theta_resolution=n, phi_resolution=n // 2) for n in _SIDES]
    return [_level(mesh, prop, True) for mesh in meshes], _largest()


def tubes(prop, capped) -> tuple[list, tuple]:
    """Return cylinders of radius 1 along z from -1 to 1.

    Parameters
    ----------
    prop : pyvista.Property
        How they look.
    capped : bool
        Whether their ends are closed.

    Returns
    -------
    levels : list of list of pvibr.actors.parts.Part
        The best first.
    largest : tuple of float
        The largest diameter in pixels at which each is good enough.
    """
    sizes = {'direction': (0, 0, 1), 'radius': 1.0, 'height': 2.0, 'capping': capped}
    made = [pv.Cylinder(resolution=n, **sizes).triangulate() for n in _SIDES]
    return [_level(mesh, prop, capped) for mesh in made], _largest()


def _level(mesh, prop, closed):
    (part,) = as_parts(mesh, color=prop.color, lighting=prop.lighting, smooth_shading=False)
    copy_property(part.actor.prop, prop)
    part.actor.prop.SetBackfaceCulling(closed)  # else both sides of what is translucent are seen
    return [part]


def _largest():
    return (np.inf, *(2 * _CLOSE / (1 - np.cos(np.pi / n)) for n in _SIDES[1:]))


def along(middles, halves, radii) -> np.ndarray:
    """Return what brings the cylinder of size 1 to some places, (n, 4, 4).

    Parameters
    ----------
    middles, halves : numpy.ndarray, shape (n, 3)
        Middles, and from them to the second ends, world units; halves have a length.
    radii : numpy.ndarray, shape (n,)
        World units.

    Examples
    --------
    >>> import numpy as np
    >>> along(np.zeros((1, 3)), np.array([[2.0, 0, 0]]), np.ones(1))[0, :3, 2].tolist()
    [2.0, 0.0, 0.0]
    """
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
    """Return matrices of linear parts and places, (n, 4, 4).

    Parameters
    ----------
    middles : numpy.ndarray, shape (n, 3)
        World units.
    axes : numpy.ndarray, shape (n, 3, 3)
        Columns are where x, y and z go.
    """
    matrices = np.tile(np.eye(4), (len(middles), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = axes, middles
    return matrices
