"""Visibility from a camera and light on a mesh, as data, without a plotter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import as_array, checked_number, checked_whole, naming
from pvibr.core.params import checked_flag
from pvibr.maths.camera_views import view_of
from pvibr.maths.cameras import as_camera
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.vectors import unit_vectors
from pvibr.things.frame import Frame
from pvibr.things.light_views import light_views
from pvibr.things.lights import lights_of
from pvibr.visibility import depth_test
from pvibr.visibility.depth_maps import LARGEST_MAP, depth_maps, depth_scene
from pvibr.visibility.embree_rays import Rays, ray_method
from pvibr.visibility.surface_samples import Samples, bounds_of, sides_of, surface_of, surfaces_of

#: Texels along a side of the depth map of each sample of an area light: edges are blurred anyway.
_MAP_TEXELS = 4096
#: Texels by which adjacent faces may lie before a point's own, as at corners.
_TOUCHING_TEXELS = 1.5
#: Apparent diameter of the sun, degrees.
_SUN_DIAMETER = 0.53


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
        Rays are exact and need embree (``pip install "pvibr[rays]"``); a depth map resolves what
        is wider than its texels. By default rays if embree is installed.
    resolution : int, optional
        Texels along a side of the depth map.
    two_sided : bool, optional
        Whether back faces are visible; by default only if the mesh is open.

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
        inside_image = ((uv >= 0) & (uv <= 1)).all(1)
    toward = camera.toward(samples.points)
    facing_cosines = samples.facing(toward, sides_of(mesh, two_sided))
    candidates = np.flatnonzero(inside_image & (facing_cosines > 0))
    points, normals = samples.points[candidates], samples.turned(toward)[candidates]
    is_visible = np.zeros(len(inside_image))
    surfaces = [surface_of(mesh), *surfaces_of(casters)]
    if ray_method(method):
        ray_length = _away(camera, points)
        is_free = Rays(surfaces).free(points, normals, toward[candidates], ray_length)
        is_visible[candidates] = is_free & (ray_length > 0)
        return samples.most(is_visible) >= 0.5
    view = view_of(camera, bounds_of(surfaces), resolution)
    if view is not None and len(candidates):
        (depth,) = depth_maps([view], surfaces, resolution)
        is_visible[candidates] = depth_test.seen(view, depth, points, normals, OFFSET)
    return samples.most(is_visible) >= 0.5


def _check_has_size(camera):
    """Raise a ValueError for an intrinsic matrix without the size of its picture."""
    is_intrinsic = isinstance(camera, tuple | list | np.ndarray)
    if is_intrinsic or (isinstance(camera, dict) and 'size' not in camera):
        raise ValueError(
            "size must be the width and height of the camera's picture in pixels, got None; K "
            'does not contain them: pass for example size=(1920, 1080)'
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
        Rays are exact and need embree (``pip install "pvibr[rays]"``); a depth map may be wrong
        within a texel of a shadow's edge, and misses casters thinner than that. By default rays if
        embree is installed.
    resolution : int, optional
        Texels along a side of the light's depth map of all meshes. By default 4096, and 16384 in
        the parts where edges and thin casters leave samples in doubt.
    samples : int, optional
        Sample points on the light; more than 1 gives soft shadows.
    extent : float, optional
        Size of the light if `samples` is above 1: angular diameter of a directional light in
        degrees, by default the sun's 0.53; radius of a positional light in world units.
    two_sided : bool, optional
        Whether back faces are lit. By default they are not: closed meshes are lit from outside,
        open ones on the side that mostly faces the light.
    doubt : bool, optional
        Also return an error bound.

    Returns
    -------
    lit : numpy.ndarray, shape (n,), float64
        Lit fraction, 0 to 1; 0 on faces turned away.
    doubt : numpy.ndarray, shape (n,), float64
        With ``doubt=True``: the error bound of each value, 0 to 1. With a depth map it is 1 where
        a neighbouring texel disagrees or holds an edge of a caster thinner than a texel; with rays
        it is 0. Its sum bounds the error of counts of lit cells; for points, ignore a few texels
        around contacts.

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
    mesh_samples = Samples.of(mesh, to)
    surfaces = [surface_of(mesh), *surfaces_of(casters)]
    sides = sides_of(mesh, two_sided) or (0 if two_sided else _lit_side(light, mesh_samples))
    lit_sum = np.zeros(len(mesh_samples.points))
    light_points = _spread(_scene_light(light), samples, extent)
    doubt_sum = np.zeros(len(lit_sum))
    if by_rays:
        rays = Rays(surfaces)
        for light_point in light_points:
            lit_sum += _lit_by_rays(light_point, rays, mesh_samples, sides)
    else:
        texels = resolution or (None if samples == 1 else _MAP_TEXELS)
        touching = _TOUCHING_TEXELS if to == 'points' else 0.0
        with depth_scene(surfaces) as scene:
            for light_point in light_points:
                toward, reached = _reached(light_point, mesh_samples, sides)
                points = mesh_samples.points[reached]
                normals = mesh_samples.turned(toward)[reached]
                lit, is_doubtful = lit_by_maps(
                    scene, light_point, points, normals, texels, judge=doubt, touching=touching
                )
                lit_sum[reached] += lit
                doubt_sum[reached] += is_doubtful
    lit = mesh_samples.most(lit_sum / samples)
    return (lit, mesh_samples.most(doubt_sum / samples)) if doubt else lit


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
        In squared mesh units; half shadow counts half.

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
        raise ValueError(f'lit must have shape {sizes}, for cells or points, got {lit.shape}')
    face_lit = lit[faces.owner] if len(lit) == mesh.n_cells else lit[faces.corner].mean(1)
    return float((faces.area * (1 - face_lit)).sum())


def _away(camera, points):
    """Return the distance of points from a camera, or from its near plane if orthographic."""
    view_from_world = camera.view_from_world
    if isinstance(camera, Orthographic):
        return -(points @ view_from_world[2, :3] + view_from_world[2, 3]) - camera.near
    return np.linalg.norm(points @ view_from_world[:3, :3].T + view_from_world[:3, 3], axis=1)


# -- light --------------------------------------------------------------------------------------


def _check_light(light, samples, extent):
    if not hasattr(light, 'GetConeAngle') or not light.LightTypeIsSceneLight():
        raise ValueError(f"light must be a pv.Light of type 'scene light', got {light!r:.80}")
    if light.GetPosition() == light.GetFocalPoint():
        raise ValueError(f'light must have a direction, got focal_point = {light.GetPosition()}')
    checked_whole('samples', samples, 1, 1 << 20)
    if extent is not None:
        checked_number('extent', extent, 0.0)
    if samples > 1 and extent is None and light.GetPositional():
        raise ValueError('extent must be the radius of the light if samples > 1, got None')


def _scene_light(light):
    renderer = _vtk.vtkOpenGLRenderer()
    renderer.AddLight(light)
    (scene_light,) = lights_of(renderer)
    return scene_light


def _spread(scene_light, samples, extent):
    """Yield point lights that sample an area light."""
    if samples == 1:
        yield scene_light
        return
    light_position, ahead = np.array(scene_light.position), np.array(scene_light.direction)
    helper_axis = np.eye(3)[np.abs(ahead).argmin()]
    side_axis = np.cross(ahead, helper_axis) / np.linalg.norm(np.cross(ahead, helper_axis))
    disk_axes = np.stack([side_axis, np.cross(ahead, side_axis)])
    if not scene_light.positional:
        extent = np.tan(np.radians((_SUN_DIAMETER if extent is None else extent) / 2))
    for lens_offset in vogel_disk(int(samples)) * extent @ disk_axes:
        if scene_light.positional:
            yield replace(scene_light, position=tuple(light_position + lens_offset))
        else:
            direction = ahead + lens_offset
            yield replace(scene_light, direction=tuple(direction / np.linalg.norm(direction)))


def _lit_side(light, samples) -> int:
    """Return the side of an open mesh that mostly faces a light, 1 or -1."""
    weighted_normals = samples.area[:, None] * samples.normals
    toward = toward_light(_scene_light(light), samples.points)
    return 1 if np.einsum('ij,ij->', weighted_normals, toward) >= 0 else -1


def toward_light(light, points) -> np.ndarray:
    """Return unit vectors to a light, (m, 3)."""
    position = light.homogeneous()[:3]
    if light.positional:
        return unit_vectors(position - points)
    return np.broadcast_to(unit_vectors(position), points.shape)


def _views(scene, light, resolution) -> list:
    """Return the (view, depth) pairs of a point light."""
    return [(view, scene.depth(view, resolution)) for view in views_of(scene, light, resolution)]


def _reached(light, samples, sides):
    """Return unit vectors to a light, and which samples it would reach unoccluded."""
    toward = toward_light(light, samples.points)
    reached = samples.facing(toward, sides) > 0
    if light.kind == 'spot':
        reached &= -toward @ np.array(light.direction) > np.cos(np.radians(light.cone))
    return toward, reached


def _lit_by_rays(light, rays, samples, sides):
    """Return the visibility of a point light from each sample, 0 or 1, by rays."""
    toward, reached = _reached(light, samples, sides)
    lit = np.zeros(len(toward))
    reached_rows = slice(None) if reached.all() else np.flatnonzero(reached)
    points = samples.points[reached_rows]
    ray_length = np.full(len(points), np.inf)
    if light.positional:
        ray_length = np.linalg.norm(np.array(light.position) - points, axis=1)
    normals = samples.turned(toward)[reached_rows]
    lit[reached_rows] = rays.free(points, normals, toward[reached_rows], ray_length)
    return lit


def _lit(light, views, samples, sides):
    """Return the visibility of a point light from each sample, by depth maps."""
    toward, reached = _reached(light, samples, sides)
    normals = samples.turned(toward)
    nearest = nearest_view([view for view, _ in views], samples.points)
    lit = np.zeros(len(normals))
    for k, (view, depth) in enumerate(views):
        view_rows = np.flatnonzero(reached & (nearest == k))
        if len(view_rows):
            points, turned = samples.points[view_rows], normals[view_rows]
            lit[view_rows] = depth_test.seen(view, depth, points, turned, OFFSET)
    return lit


class Reach:
    """Lit fraction of samples among meshes, whose depth is drawn once per light."""

    def __init__(self, surfaces, lights, resolution, samples=1, extents=()):
        self._light_points: list = []
        extents = list(extents) or [None] * len(lights)
        if not any(surface.n_points for surface in surfaces):
            self._light_points = [[] for _ in lights]
            return
        with depth_scene(surfaces) as scene:
            for light, extent in zip(lights, extents, strict=True):
                points = _spread(light, samples, extent)
                self._light_points.append([(p, _views(scene, p, resolution)) for p in points])

    def of(self, light_index, samples) -> np.ndarray:
        """Return the lit fraction of samples that face a light, (m,), 0 to 1."""
        light_points = self._light_points[light_index]
        if not light_points:
            return np.ones(len(samples.points))
        lit = [_lit(light_point, views, samples, 0) for light_point, views in light_points]
        return np.mean(lit, axis=0)


#: Texels along a side of the map of the scene, and of refined maps of its parts.
_TEXELS, _FINER = 4096, 2048
#: Parts along a side of the map, and the most that are refined, those with most doubtful samples.
_PARTS, _MAX_PARTS = 8, 24
#: Offset of points along their normals, texels: less than in pictures, since one wrong corner
#: makes a point wrong.
OFFSET = 0.1
_EDGE = 4.0  # texels of margin around a part, for comparisons with neighbours


def views_of(scene, light, resolution) -> list:
    """Return the views of a point light that cover all meshes of a scene."""
    return light_views(light, scene.bounds, Frame.of(scene.renderer), resolution, 0)[0]


def nearest_view(views, points) -> np.ndarray:
    """Return the index of the view that faces each point best, (m,)."""
    texture_matrices = [view.texture_from_world()[3] for view in views]
    return np.argmax([points @ m[:3] + m[3] for m in texture_matrices], axis=0)


def lit_by_maps(scene, light, points, normals, resolution=None, *, judge=True, touching=0.0):
    """Return the lit fraction of points, 0 to 1, and whether it is in doubt, both (m,)."""
    # A point is in doubt if a neighbouring texel disagrees or holds the edge of a triangle thinner
    # than a texel. Without a resolution, the parts with doubtful points are redrawn finer.
    texels = resolution or _TEXELS
    lit_share, doubt = np.ones(len(points)), np.zeros(len(points), bool)
    views = views_of(scene, light, texels)
    nearest = nearest_view(views, points)
    for k, view in enumerate(views):
        view_rows = np.flatnonzero(nearest == k)
        jobs = [(view, texels, view_rows)] if len(view_rows) else []
        for part, side, inside in jobs:
            depth_query = part, scene.depth(part, side), points[inside], normals[inside]
            lit_share[inside] = depth_test.seen(*depth_query, OFFSET)
            if judge or resolution is None:
                edge_depth = scene.depth_of_edges()
                doubt[inside] = depth_test.uncertain(*depth_query, edge_depth, touching)
            if part is view and resolution is None:
                jobs += _parts(view, points, view_rows[doubt[view_rows]], _MAX_PARTS // len(views))
    return lit_share, doubt


def _parts(view, points, doubtful_rows, max_parts):
    """Yield (view, texels, points inside) of the parts of a view with most doubtful points."""
    matrix = view.texture_from_world()
    homogeneous = points[doubtful_rows] @ matrix[:, :3].T + matrix[:, 3]
    cells = np.floor(homogeneous[:, :2] / homogeneous[:, 3:] * _PARTS)
    cells = np.clip(cells, 0, _PARTS - 1).astype(int) @ [1, _PARTS]
    cell_numbers, sample_counts = np.unique(cells, return_counts=True)
    zoom = _PARTS / (1 + 2 * _EDGE / _FINER)
    for cell in cell_numbers[np.argsort(-sample_counts)][:max_parts]:
        crop = np.diag([zoom, zoom, 1.0, 1.0])
        cell_center = (2 * np.array([cell % _PARTS, cell // _PARTS]) + 1) / _PARTS - 1
        crop[:2, 3] = -zoom * cell_center
        inside = doubtful_rows[cells == cell]
        yield replace(view, clip_from_view=crop @ view.clip_from_view), _FINER, inside
