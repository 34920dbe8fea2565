"""Meshes that several benches draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

import pvibr
from pvibr.scenes.trees import tree, with_looks

#: The project's data, where they are.
DATA = Path(pvibr.__file__).parents[2] / 'shared' / 'data'


def knot(cells) -> pv.PolyData:
    """Return a knot of about so many triangles, with normals."""
    t = np.linspace(0, 2 * np.pi, max(cells // 48, 12))
    ring = 2 + np.cos(3 * t)
    line = np.c_[ring * np.cos(2 * t), ring * np.sin(2 * t), np.sin(3 * t)]
    return pv.Spline(line, len(t)).tube(radius=0.5, n_sides=24).triangulate().compute_normals()


def torus(cells) -> pv.PolyData:
    """Return a torus of about so many triangles, with normals."""
    side = int(np.sqrt(cells / 4)) + 1
    return pv.ParametricTorus(u_res=2 * side, v_res=side).compute_normals()


def scatter(count, cells, spacing, seed=0) -> list:
    """Return actors on a square, turned at random, about 2 units large."""
    rng = np.random.default_rng(seed)
    meshes, columns = (knot(cells), torus(cells)), int(np.ceil(np.sqrt(count)))
    found = []
    for i in range(count):
        mesh = meshes[i % 2]
        actor = pv.Actor(mapper=pv.DataSetMapper(mesh.copy(deep=False)))
        actor.prop.color, actor.prop.interpolation = rng.random(3), 'Phong'
        actor.scale, actor.orientation = (2 / mesh.length,) * 3, rng.random(3) * 360
        place = np.array(divmod(i, columns)) - (columns - 1) / 2 + 0.5 * rng.random(2)
        actor.position = (*(spacing * place), 0.0)
        found.append(actor)
    return found


def _knot():
    t = np.linspace(0, 2 * np.pi, 500)
    r = 1 + 0.4 * np.cos(3 * t)
    line = np.column_stack([r * np.cos(2 * t), r * np.sin(2 * t), 0.5 * np.sin(3 * t)])
    knot = _tube(line, 0.12, 48)
    rod = pv.Cylinder(center=(0, 0, 0), direction=(0.2, 0.1, 1), radius=0.015, height=4.5)
    return pv.MultiBlock([knot, rod])


def _tube(line, radius, sides):
    return pv.lines_from_points(line).tube(radius=radius, n_sides=sides).triangulate()


def _statue():
    """Return a scanned statue where the project's data are, else a bumpy ellipsoid as slender."""
    path = DATA / 'meshes' / 'koala.obj'
    if path.is_file():
        return pv.read(path)
    ball = pv.Sphere(theta_resolution=200, phi_resolution=200)
    bumps = 1 + 0.1 * np.sin(9 * ball.points).prod(axis=1, keepdims=True)
    ball.points *= bumps * [0.5, 0.5, 1.0]
    return ball.compute_normals()


def _flat():
    plate = pv.Plane(i_size=10, j_size=10, i_resolution=160, j_resolution=160)
    x, y, _ = plate.cell_centers().points.T
    plate['pattern'] = np.where((np.floor(x) + np.floor(y)) % 2, 0.2, 0.8) + 0.1 * np.sin(3 * x)
    return plate


def _wires():
    rng = np.random.default_rng(3)
    feet = rng.normal(size=(24, 3))
    tips = feet + rng.normal(size=(24, 3))
    wires = [_tube(np.linspace(a, b, 40), 0.012, 12) for a, b in zip(feet, tips, strict=True)]
    return pv.merge([*wires, pv.Sphere(radius=0.5, theta_resolution=60, phi_resolution=60)])


MESHES = {
    'knot and rod': _knot,
    'torus': lambda: pv.ParametricTorus(u_res=150, v_res=100),
    'airplane': pv.examples.load_airplane,
    'tree': lambda: with_looks(tree('broadleaf'), 'broadleaf'),
    'statue': _statue,
    'flat plate': _flat,
    'wires': _wires,
}
