"""Lines and vertices of copies of meshes, as plain meshes."""

from __future__ import annotations

import numpy as np
import pyvista as pv

COLORS = 'colors'


def add_strokes(plotter, part, matrices, colors):
    """Add a part's lines and vertices at matrices (k, 4, 4), with colours or None."""
    ends = part.strokes
    world_ends = np.einsum('kij,nsj->knsi', matrices[:, :3, :3], ends)
    world_ends += matrices[:, None, None, :3, 3]
    is_vertex = (ends[:, 0] == ends[:, 1]).all(1)
    for pieces in (world_ends[:, ~is_vertex], world_ends[:, is_vertex, :1]):
        if pieces.size:
            _add(plotter, pieces, part.actor.GetProperty(), colors)


def _add(plotter, stroke_points, prop, colors):
    copy_count, stroke_count, points_per_stroke, _ = stroke_points.shape
    mesh = pv.PolyData(stroke_points.reshape(-1, 3))
    if points_per_stroke == 2:
        mesh.verts = np.zeros(0, int)
        point_ids = np.arange(2 * copy_count * stroke_count).reshape(-1, 2)
        mesh.lines = np.insert(point_ids, 0, 2, axis=1).ravel()
    color_options = {'color': prop.GetColor()}
    if colors is not None:
        mesh[COLORS] = np.repeat(colors[:, :3], stroke_count * points_per_stroke, 0)
        color_options = {'scalars': COLORS, 'rgb': True}
    plotter.add_mesh(
        mesh,
        **color_options,
        opacity=prop.GetOpacity(),
        line_width=prop.GetLineWidth(),
        point_size=prop.GetPointSize(),
        lighting=prop.GetLighting(),
        reset_camera=False,
        render=False,
        show_scalar_bar=False,
    )
