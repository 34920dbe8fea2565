"""Silhouettes of meshes as lines."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import checked_whole, naming
from pvibr.core.params import checked_flag
from pvibr.maths.camera_views import view_of
from pvibr.maths.cameras import as_camera
from pvibr.maths.silhouettes import LitMesh, edge_table
from pvibr.maths.vectors import unit_vectors
from pvibr.visibility.depth_maps import LARGEST_MAP, depth_maps
from pvibr.visibility.surface_samples import bounds_of, edges_of, surface_of, surfaces_of

_OFF_EDGE = 1.5  # texels off a line, away from its own surface, where depth is sampled
_MIN_GAP = 8.0  # texels by which an occluder must lie before a line
_PIECE = 4.0  # texels tested as one piece


def silhouette_lines(
    mesh, camera, *, casters=(), hidden=False, size=None, resolution=4096
) -> pv.PolyData:
    """Return the silhouette and the boundary edges of a mesh as lines in world space.

    Parameters
    ----------
    mesh : pyvista.DataSet or actor
        World units; the surface of volumes.
    camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
        See :func:`pvibr.maths.cameras.as_camera`.
    casters : sequence of pyvista.DataSet or actors, optional
        Other occluders.
    hidden : bool, optional
        Whether to include lines that are occluded or outside the image.
    size : tuple of 2 int, optional
        Width and height of the image in pixels, if the camera has none; by default PyVista's
        window size.
    resolution : int, optional
        Texels along a side of the depth map for occlusion.

    Returns
    -------
    pyvista.PolyData
        Polylines in float64: the edges between front-facing and back-facing triangles, or their
        visible parts.

    Raises
    ------
    TypeError
        If an argument is not a mesh.
    ValueError
        If the camera is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pvibr import Orthographic
    >>> above = Orthographic.from_extent(-1, 1, -1, 1, zmax=5)
    >>> pvibr.silhouette_lines(pv.Cube(), above, hidden=True).length ** 2
    2.0
    """
    if size is None:
        size = getattr(camera, 'size', None) or pv.global_theme.window_size
    hidden = checked_flag('hidden', hidden)
    resolution = checked_whole('resolution', resolution, 1, LARGEST_MAP)
    with naming('camera', camera):
        camera = as_camera(camera, size)
    with naming('mesh', mesh):
        surface = surface_of(mesh).triangulate()
    surfaces = [surface, *surfaces_of(casters)]
    view = view_of(camera, bounds_of(surfaces), resolution)
    if view is None:
        return pv.PolyData()
    edges = edge_table(np.asarray(surface.points), surface.regular_faces)
    light = np.append(view.view_from_world[2, :3], 0.0) if view.parallel else [*view.eye, 1.0]
    pairs, _ = LitMesh(edges, light).silhouette
    ends = (edges.points + edges.origin)[pairs]
    if not hidden:
        away_directions = _away(view, ends, _inner(edges, pairs) + edges.origin)
        ends = _visible_parts(view, ends, away_directions, surfaces, resolution)
    return _lines(ends)


def _inner(edges, pairs):
    """Return a point on the triangles of each edge but off the edge, (k, 3)."""
    corners = edges.triangles
    sides = edges_of(corners)
    opposite = np.roll(corners, -2, 1).T.ravel()
    n = len(edges.points)
    keys = np.sort(sides, 1) @ [n, 1]
    order = np.argsort(keys)
    pair_keys = np.sort(pairs, 1) @ [n, 1]
    first_face = np.searchsorted(keys[order], pair_keys)
    last_face = np.searchsorted(keys[order], pair_keys, side='right') - 1
    opposite = edges.points[opposite[order]]
    return (opposite[first_face] + opposite[last_face]) / 2


def _texels(view, points):
    """Return texture coordinates and depth of points, (..., 3), and w."""
    homogeneous = points @ view.texture_from_world()[:, :3].T + view.texture_from_world()[:, 3]
    with np.errstate(divide='ignore', invalid='ignore'):
        return homogeneous[..., :3] / homogeneous[..., 3:], homogeneous[..., 3]


def _away(view, ends, inner):
    """Return unit image vectors across the edges, away from their triangles, (k, 2)."""
    places, _ = _texels(view, np.concatenate([ends, inner[:, None]], 1))
    along, to_inner = places[:, 1, :2] - places[:, 0, :2], places[:, 2, :2] - places[:, 0, :2]
    across = np.stack([-along[:, 1], along[:, 0]], 1)
    across = np.where((across * to_inner).sum(1, keepdims=True) > 0, -across, across)
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)


def _visible_parts(view, ends, away, surfaces, resolution):
    """Return the visible parts of edges, (k, 2, 3)."""
    (depth,) = depth_maps([view], surfaces, resolution)
    side = len(depth)
    places, w = _texels(view, ends)
    in_front = (w > 0).all(1) & np.isfinite(places).all((1, 2))
    ends, away, places = ends[in_front], away[in_front], places[in_front]
    texel_length = np.linalg.norm(np.diff(places[..., :2], axis=1)[:, 0], axis=1) * side
    piece_count = np.clip(np.ceil(texel_length / _PIECE), 1, side).astype(int)
    owner = np.repeat(np.arange(len(ends)), piece_count)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(piece_count) - piece_count, piece_count)
    cuts = np.stack([step, step + 1], 1) / piece_count[owner][:, None]
    pieces = ends[owner, :1] + cuts[..., None] * (ends[owner, 1:] - ends[owner, :1])
    is_visible = _is_unoccluded(view, pieces.mean(1), away[owner], depth)
    # Join runs of visible pieces.
    joins_next = is_visible[1:] & is_visible[:-1] & (owner[1:] == owner[:-1])
    starts_run = is_visible & ~np.append(False, joins_next)
    ends_run = is_visible & ~np.append(joins_next, False)
    return np.stack([pieces[starts_run, 0], pieces[ends_run, 1]], 1)


def _is_unoccluded(view, points, away, depth):
    side = len(depth)
    toward = view.view_from_world[2, :3] if view.parallel else view.eye - points
    # Width of a texel at each point, world units.
    texel_scale = 2 / (view.clip_from_view[1, 1] * side)
    toward = unit_vectors(toward)
    view_depth = -(points @ view.view_from_world[2, :3] + view.view_from_world[2, 3])
    texel = texel_scale * (np.ones(len(points)) if view.parallel else view_depth)
    places, _ = _texels(view, points)
    in_front, _ = _texels(view, points + _MIN_GAP * texel[:, None] * toward)
    column, row = np.floor((places[:, :2] + _OFF_EDGE * away / side) * side).astype(int).T
    inside_map = ((places[:, :2] >= 0) & (places[:, :2] <= 1)).all(1)
    clipped = depth[np.clip(row, 0, side - 1), np.clip(column, 0, side - 1)]
    return inside_map & (in_front[:, 2] <= clipped)


def _lines(ends) -> pv.PolyData:
    """Return edges as polylines, joined where they meet."""
    if not len(ends):
        return pv.PolyData()
    points, index = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
    pairs = index.reshape(-1, 2)
    lines = np.column_stack([np.full(len(pairs), 2), pairs])
    segments = pv.PolyData(points, lines=lines.ravel())
    return segments.strip(join=True, max_length=max(len(pairs) + 1, 2))
