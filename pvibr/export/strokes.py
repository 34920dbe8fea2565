"""Lines and vertices of copies of meshes, as plain meshes."""

from __future__ import annotations

import numpy as np
import pyvista as pv

COLORS = 'colors'


def add_strokes(plotter, part, matrices, colors):
    """Add the lines and vertices of a part at matrices, (k, 4, 4), with colours or None."""
    ends = part.strokes
    placed = np.einsum('kij,nsj->knsi', matrices[:, :3, :3], ends) + matrices[:, None, None, :3, 3]
    dots = (ends[:, 0] == ends[:, 1]).all(1)
    for pieces in (placed[:, ~dots], placed[:, dots, :1]):
        if pieces.size:
            _add(plotter, pieces, part.actor.GetProperty(), colors)


def _add(plotter, pieces, prop, colors):
    copies, count, corners, _ = pieces.shape
    mesh = pv.PolyData(pieces.reshape(-1, 3))
    if corners == 2:
        mesh.verts = np.zeros(0, int)
        numbers = np.arange(2 * copies * count).reshape(-1, 2)
        mesh.lines = np.insert(numbers, 0, 2, axis=1).ravel()
    look = {'color': prop.GetColor()}
    if colors is not None:
        mesh[COLORS] = np.repeat(colors[:, :3], count * corners, 0)
        look = {'scalars': COLORS, 'rgb': True}
    plotter.add_mesh(
        mesh,
        **look,
        opacity=prop.GetOpacity(),
        line_width=prop.GetLineWidth(),
        point_size=prop.GetPointSize(),
        lighting=prop.GetLighting(),
        reset_camera=False,
        render=False,
        show_scalar_bar=False,
    )
