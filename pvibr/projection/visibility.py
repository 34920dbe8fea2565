"""Visibility from a camera and light on a mesh, as data: no plotter is needed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.params import checked_flag
from pvibr.maths import depth_test
from pvibr.maths.arguments import as_array, checked_number, checked_whole, naming
from pvibr.maths.cameras import as_camera
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.vectors import unit_vectors
from pvibr.projection.depth_maps import LARGEST_MAP, depth_maps, depth_scene, view_of
from pvibr.projection.lit_by_maps import OFFSET, lit_by_maps, nearest_view, views_of
from pvibr.projection.rays import Rays, ray_method
from pvibr.projection.samples import Samples, bounds_of, sides_of, surface_of, surfaces_of
from pvibr.scene.lights import lights_of

#: Texels along a side of a map of a light of some size: edges are blurred.
_TEXELS = 4096
#: Texels that faces beside a point may be before its own: each corner is one.
_BESIDE = 1.5
#: Apparent diameter of the sun, degrees.
_SUN = 0.53


def visible(
    mesh,
    camera,
    *,
    casters=(),
    to='points',
    size=None,
    method='auto',
    resolution=4096,
    two_sided=None,
):
    """Return which points or cells of a mesh a camera sees.

    Parameters
    ----------
    mesh : pyvista.DataSet
        World units; the surface of volumes.
    camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
        See :func:`pvibr.maths.cameras.as_camera`.
    casters : sequence of pyvista.DataSet, actors or things of pvibr, optional
        Other occluders.
    to : {'points', 'cells'}
        Result per point or per cell. A point is visible if an adjacent face is.
    size : tuple of 2 int, optional
        Width and height of the image in pixels, if the camera has none: required with ``K``, and
        PyVista's window size by default for others.
    method : {'auto', 'rays', 'map'}
        Rays are exact, and need embree (``pip install "pvibr[rays]"``); a depth map finds what is
        wider than its texels. By default rays where embree is installed.
    resolution : int, optional
        Texels along a side of the depth map.
    two_sided : bool, optional
        Whether back faces are visible; by default if the mesh is not closed.

    Returns
    -------
    numpy.ndarray, shape (n,), bool
        False outside the image, behind the camera, on back faces and where occluded.

    Raises
    ------
    ValueError
        If an argument is invalid.
    ModuleNotFoundError
        If rays are asked for without embree.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pvibr import Orthographic
    >>> above = Orthographic.from_extent(-1, 1, -1, 1, zmax=5)
    >>> roof = pv.Plane(center=(0, 0, 1), i_size=1.2)
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.visible(ground, above, casters=[roof], to='cells').tolist()
    [True, False, False, True]
    """
    if size is None:
        _check_has_size(camera)
        size = getattr(camera, 'size', None) or pv.global_theme.window_size
    with naming('camera', camera):
        camera = as_camera(camera, size)
    resolution = checked_whole('resolution', resolution, 1, LARGEST_MAP)
    samples = Samples.of(mesh, to)
    uv, _ = camera.project(samples.points)
    with np.errstate(invalid='ignore'):
        inside = ((uv >= 0) & (uv <= 1)).all(1)
    toward = camera.toward(samples.points)
    facing = samples.facing(toward, sides_of(mesh, two_sided))
    rows = np.flatnonzero(inside & (facing > 0))
    found = np.zeros(len(inside))
    surfaces = [surface_of(mesh), *surfaces_of(casters)]
    if ray_method(method):
        reach = _away(camera, samples.points[rows])
        free = Rays(surfaces).free(
            samples.points[rows], samples.turned(toward)[rows], toward[rows], reach
        )
        found[rows] = free & (reach > 0)
        return samples.most(found) >= 0.5
    view = view_of(camera, bounds_of(surfaces), resolution)
    if view is not None and len(rows):
        (depth,) = depth_maps([view], surfaces, resolution)
        normals = samples.turned(toward)[rows]
        found[rows] = depth_test.seen(view, depth, samples.points[rows], normals, OFFSET)
    return samples.most(found) >= 0.5


def _check_has_size(camera):
    """Raise a ValueError for an intrinsic matrix without the size of its picture."""
    rows = isinstance(camera, tuple | list | np.ndarray)
    if rows or (isinstance(camera, dict) and 'size' not in camera):
        raise ValueError(
            'size = None: must be width and height of the picture of camera in pixels, as in '
            'size=(1920, 1080): K does not tell them'
        )


def shadow_mask(
    mesh,
    light,
    casters=(),
    *,
    to='points',
    method='auto',
    resolution=None,
    samples=1,
    extent=None,
    two_sided=None,
    doubt=False,
):
    """Return the lit fraction of a mesh.

    Parameters
    ----------
    mesh : pyvista.DataSet
        World units; it shadows itself.
    light : pyvista.Light
        Directional or positional; nothing is lit outside the cone of a spot.
    casters : sequence of pyvista.DataSet, actors or things of pvibr, optional
        Other casters.
    to : {'points', 'cells'}
        Result per point or per cell.
    method : {'auto', 'rays', 'map'}
        Rays are exact, and need embree (``pip install "pvibr[rays]"``); a depth map may be wrong
        within a texel of a shadow's edge, and loses casters thinner than that. By default rays
        where embree is installed.
    resolution : int, optional
        Texels along a side of a depth map of what the light sees of all meshes. By default 4096,
        and 16384 in those of its parts where samples are in doubt beside edges and thin casters.
    samples : int, optional
        Samples on the light; more than 1 gives soft shadows.
    extent : float, optional
        Size of the light for more than one sample: angular diameter of a directional light in
        degrees, by default 0.53 as the sun; radius of a positional light in world units.
    two_sided : bool, optional
        Whether back faces are lit. By default they are not: closed meshes are lit from outside,
        others on the side that mostly faces the light.
    doubt : bool, optional
        Return a bound of the error too.

    Returns
    -------
    lit : numpy.ndarray, shape (n,), float64
        Lit fraction, 0 to 1; 0 on faces turned away.
    doubt : numpy.ndarray, shape (n,), float64
        If asked for: by how much each value may be wrong, 0 to 1. Of a depth map it is 1 where a
        texel beside tells otherwise, or holds an edge of a caster that is thinner than a texel; of
        rays it is 0. Its sum is the most that counts of lit cells may be off by; for points, leave
        some texels around what touches them aside.

    Raises
    ------
    ValueError
        If an argument is invalid, or the light has no direction or is a headlight.
    ModuleNotFoundError
        If rays are asked for without embree.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> sun = pv.Light(position=(0, 0, 5), light_type='scene light')
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.shadow_mask(ground, sun, [pv.Plane(center=(0, 0, 1))], to='cells').tolist()
    [1.0, 0.0, 0.0, 1.0]
    """
    _check_light(light, samples, extent)
    if resolution is not None:
        resolution = checked_whole('resolution', resolution, 1, LARGEST_MAP)
    doubt = checked_flag('doubt', doubt)
    by_rays = ray_method(method)
    found = Samples.of(mesh, to)
    surfaces = [surface_of(mesh), *surfaces_of(casters)]
    sides = sides_of(mesh, two_sided) or (0 if two_sided else _lit_side(light, found))
    total = np.zeros(len(found.points))
    places = _spread(_scene_light(light), samples, extent)
    wrong = np.zeros(len(total))
    if by_rays:
        rays = Rays(surfaces)
        for place in places:
            total += _lit_by_rays(place, rays, found, sides)
    else:
        texels = resolution or (None if samples == 1 else _TEXELS)
        with depth_scene(surfaces) as scene:
            for place in places:
                toward, reached = _reached(place, found, sides)
                rows, normals = np.flatnonzero(reached), found.turned(toward)[reached]
                points = found.points[rows]
                how = {'judge': doubt, 'touching': _BESIDE if to == 'points' else 0.0}
                lit, unsure = lit_by_maps(scene, place, points, normals, texels, **how)
                total[rows] += lit
                wrong[rows] += unsure
    lit = found.most(total / samples)
    return (lit, found.most(wrong / samples)) if doubt else lit


def shadowed_area(mesh, lit) -> float:
    """Return the shadowed area of a mesh.

    Parameters
    ----------
    mesh : pyvista.DataSet
        The mesh of :func:`shadow_mask`.
    lit : array_like, shape (n,)
        Lit fraction per point or cell.

    Returns
    -------
    float
        In the square of the mesh's unit; half shadow counts half.

    Raises
    ------
    ValueError
        If `lit` has neither a value per point nor per cell.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.shadowed_area(ground, [1.0, 0.0, 0.5, 1.0])
    1.5
    """
    faces = Samples.of(mesh, 'cells')
    lit = as_array('lit', lit, float)
    if lit.shape not in ((mesh.n_cells,), (mesh.n_points,)):
        sizes = f'({mesh.n_cells},) or ({mesh.n_points},)'
        raise ValueError(
            f'lit has the shape {lit.shape}; it must be {sizes}, as mesh has cells and points.'
        )
    own = lit[faces.owner] if len(lit) == mesh.n_cells else lit[faces.corner].mean(1)
    return float((faces.area * (1 - own)).sum())


def _away(camera, points):
    """Return how far points are from a camera: from where it is, or from its near plane."""
    matrix = camera.view_from_world
    if isinstance(camera, Orthographic):
        return -(points @ matrix[2, :3] + matrix[2, 3]) - camera.near
    return np.linalg.norm(points @ matrix[:3, :3].T + matrix[:3, 3], axis=1)


# -- light --------------------------------------------------------------------------------------


def _check_light(light, samples, extent):
    if not hasattr(light, 'GetConeAngle') or not light.LightTypeIsSceneLight():
        raise ValueError(
            f"light is {light!r:.100}; it must be a pyvista.Light of light_type 'scene light'."
        )
    if light.GetPosition() == light.GetFocalPoint():
        raise ValueError(
            f'light.position and focal_point are both {light.GetPosition()}: no direction.'
        )
    checked_whole('samples', samples, 1, 1 << 20)
    if extent is not None:
        checked_number('extent', extent, 0.0)
    if samples > 1 and extent is None and light.GetPositional():
        raise ValueError(
            'extent is None; samples of a positional light need its radius in world units.'
        )


def _scene_light(light):
    renderer = _vtk.vtkOpenGLRenderer()
    renderer.AddLight(light)
    (found,) = lights_of(renderer)
    return found


def _spread(found, samples, extent):
    """Yield point-like lights that sample an extended one."""
    if samples == 1:
        yield found
        return
    middle, ahead = np.array(found.position), np.array(found.direction)
    helper = np.eye(3)[np.abs(ahead).argmin()]
    right = np.cross(ahead, helper) / np.linalg.norm(np.cross(ahead, helper))
    axes = np.stack([right, np.cross(ahead, right)])
    if not found.positional:
        extent = np.tan(np.radians((_SUN if extent is None else extent) / 2))
    for aside in vogel_disk(int(samples)) * extent @ axes:
        if found.positional:
            yield replace(found, position=tuple(middle + aside))
        else:
            way = ahead + aside
            yield replace(found, direction=tuple(way / np.linalg.norm(way)))


def _lit_side(light, samples) -> int:
    """Return the side of an open mesh that mostly faces a light, 1 or -1."""
    weighted = samples.area[:, None] * samples.normals
    toward = toward_light(_scene_light(light), samples.points)
    return 1 if np.einsum('ij,ij->', weighted, toward) >= 0 else -1


def toward_light(light, points) -> np.ndarray:
    """Return unit vectors to a light, (m, 3)."""
    place = light.homogeneous()[:3]
    if light.positional:
        return unit_vectors(place - points)
    return np.broadcast_to(unit_vectors(place), points.shape)


def _views(scene, light, resolution) -> list:
    """Return the views of a point-like light, and their depth."""
    views = views_of(scene, light, resolution)
    return [(view, scene.depth(view, resolution)) for view in views]


def _reached(light, samples, sides):
    """Return unit vectors to a light, and which samples it reaches if nothing hides it."""
    toward = toward_light(light, samples.points)
    reached = samples.facing(toward, sides) > 0
    if light.kind == 'spot':
        reached &= -toward @ np.array(light.direction) > np.cos(np.radians(light.cone))
    return toward, reached


def _lit_by_rays(light, rays, samples, sides):
    """Return the visibility of a point-like light from each sample, 0 or 1."""
    toward, reached = _reached(light, samples, sides)
    found = np.zeros(len(toward))
    rows = slice(None) if reached.all() else np.flatnonzero(reached)
    points = samples.points[rows]
    reach = np.full(len(points), np.inf)
    if light.positional:
        reach = np.linalg.norm(np.array(light.position) - points, axis=1)
    found[rows] = rays.free(points, samples.turned(toward)[rows], toward[rows], reach)
    return found


def _lit(light, views, samples, sides):
    """Return the visibility of a point-like light from each sample, by depth in its views."""
    toward, reached = _reached(light, samples, sides)
    normals = samples.turned(toward)
    nearest = nearest_view([view for view, _ in views], samples.points)
    found = np.zeros(len(normals))
    for k, (view, depth) in enumerate(views):
        rows = np.flatnonzero(reached & (nearest == k))
        if len(rows):
            points, turned = samples.points[rows], normals[rows]
            found[rows] = depth_test.seen(view, depth, points, turned, OFFSET)
    return found


class Reach:
    """How much of some lights reaches places among meshes, which are drawn once for each light."""

    def __init__(self, surfaces, lights, resolution, samples=1, extents=()):
        self._places: list = []
        extents = list(extents) or [None] * len(lights)
        if not any(surface.n_points for surface in surfaces):
            self._places = [[] for _ in lights]
            return
        with depth_scene(surfaces) as scene:
            for light, extent in zip(lights, extents, strict=True):
                places = _spread(light, samples, extent)
                self._places.append([(p, _views(scene, p, resolution)) for p in places])

    def of(self, number, samples) -> np.ndarray:
        """Return how much of a light reaches samples that are turned to it, (m,), 0 to 1."""
        places = self._places[number]
        if not places:
            return np.ones(len(samples.points))
        return np.mean([_lit(place, views, samples, 0) for place, views in places], axis=0)
