"""Meshes of every kind, made anew from a seed: sizes, shapes and looks vary with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.common.light_scenes import bare
from pvibr.meshes.parts import as_parts

#: Kinds that stand upright on a ground; the others are turned at random.
STANDING = 'terrain', 'foliage', 'parts', 'folds'
_COLORS = 'sienna', 'steelblue', 'olive', 'orchid', 'gold', 'lightgray', 'tomato'


def unseen(
    seed, triangles=(10_000, 100_000), kinds=None
) -> Iterator[tuple[str, Callable[[], list]]]:
    """Yield the name of each kind, and what makes the parts of a mesh of so many triangles."""
    for place, (name, make) in enumerate((KINDS if kinds is None else kinds).items()):
        yield name, partial(_make, make, [seed, place], triangles)


def _make(make, seed, triangles):
    rng = np.random.default_rng(seed)
    return make(rng, int(np.exp(rng.uniform(*np.log(triangles)))))


def _look(rng, **look):
    return {'color': str(rng.choice(_COLORS)), **look}


def _as_phong(parts):
    """Return parts shaded by the normals that they carry."""
    for part in parts:  # not smooth_shading, which computes them anew
        part.actor.prop.interpolation = 'Phong'
    return parts


def _grid(rows, columns, closed=False) -> np.ndarray:
    """Return the triangles of a grid of points; if closed, its columns are a ring."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - (not closed)), indexing='ij')
    a, b = i * columns + j, i * columns + (j + 1) % columns
    return np.stack([a, a + columns, b, b, a + columns, b + columns], -1).reshape(-1, 3)


def _tube(line, radius, sides) -> pv.PolyData:
    return pv.MultipleLines(line).tube(radius=radius, n_sides=sides).triangulate()


def _bumps(points, rng, size, terms=6) -> np.ndarray:
    """Return smooth noise at points: a few waves."""
    waves = rng.normal(size=(terms, 3)) * size
    phases = rng.uniform(0, 2 * np.pi, terms)
    return np.sin(points @ waves.T + phases) @ rng.uniform(0.3, 1.0, terms) / terms


def _ball(rng, count, size=2.5, height=0.5) -> pv.PolyData:
    """Return a bumpy ball with normals."""
    side = max(int(np.sqrt(count / 4)), 8)
    ball = bare(pv.Sphere(theta_resolution=2 * side, phi_resolution=side + 2, radius=1.0))
    ball.points *= 1 + height * _bumps(np.array(ball.points), rng, size)[:, None]
    return ball.compute_normals()


def _knot(rng, count):
    p, q = [(2, 3), (3, 2), (2, 5), (3, 4)][rng.integers(4)]
    sides = int(rng.integers(16, 32))
    t = np.linspace(0, 2 * np.pi, max(count // (2 * sides), 60))
    ring = rng.uniform(1.5, 2.5) + np.cos(q * t)
    line = np.c_[ring * np.cos(p * t), ring * np.sin(p * t), np.sin(q * t)]
    mesh = _tube(line, rng.uniform(0.2, 0.5), sides).compute_normals()
    return _as_phong(as_parts(mesh, **_look(rng, specular=0.4)))


def _gear(rng, count):
    """Return a toothed wheel whose points are split at its edges."""
    teeth = int(rng.integers(9, 24))
    rings = max(int(count / (2 * 8 * teeth)) - 1, 6)
    angle = np.linspace(0, 2 * np.pi, 8 * teeth, endpoint=False)
    outer = np.where(np.arange(8 * teeth) % 8 < 4, 1.0, rng.uniform(0.75, 0.88))
    hole, high = rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.6)
    # Around the section: up inside, out over the top, down outside, in below.
    around = np.linspace(0, 4, rings, endpoint=False)
    out = np.interp(around, [0, 1, 2, 3, 4], [0, 0, 1, 1, 0])
    z = np.interp(around, [0, 1, 2, 3, 4], [-high, high, high, -high, -high])
    radius = hole + (outer[:, None] - hole) * out
    points = np.stack([radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None],
                       np.broadcast_to(z, radius.shape)], -1)  # fmt: skip
    closed = np.concatenate([points, points[:1]]).reshape(-1, 3)
    mesh = pv.PolyData.from_regular_faces(closed, _grid(len(points) + 1, rings, closed=True))
    split = mesh.clean().compute_normals(split_vertices=True, feature_angle=25.0)
    return _as_phong(as_parts(split, **_look(rng)))


def _rock(rng, count):
    """Return a faceted grain: flat-shaded, without normals."""
    mesh = bare(_ball(rng, count))
    for _ in range(int(rng.integers(6, 14))):  # cut flat
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        over = np.maximum(np.array(mesh.points) @ normal - rng.uniform(0.6, 0.9), 0)
        mesh.points = np.array(mesh.points) - over[:, None] * normal
    return as_parts(mesh, **_look(rng))


def _terrain(rng, count):
    side = max(int(np.sqrt(count / 2)), 8)
    tile = bare(pv.Plane(i_size=2, j_size=2, i_resolution=side, j_resolution=side))
    points = np.array(tile.points)
    heights = sum(0.5**k * _bumps(points, rng, 2.0**k * 2.5) for k in range(4))
    points[:, 2] = tile['height'] = rng.uniform(0.4, 1.0) * heights
    tile.points = points
    cmap = str(rng.choice(['viridis', 'gist_earth']))
    return _as_phong(as_parts(tile.compute_normals(), scalars='height', cmap=cmap))


def _lattice(rng, count):
    """Return thin tubes between points."""
    sides = 8
    struts = max(count // (2 * sides * 12), 20)
    nodes = rng.uniform(-1, 1, (max(struts // 3, 6), 3))
    pairs = rng.integers(0, len(nodes), (struts, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    radius = rng.uniform(0.008, 0.03)
    lines = [np.linspace(nodes[a], nodes[b], 13) for a, b in pairs]
    return as_parts(pv.merge([_tube(line, radius, sides) for line in lines]), **_look(rng))


def _textured(rng, count):
    side = max(int(np.sqrt(count / 4)), 8)
    u, v = np.meshgrid(np.linspace(0, 1, 2 * side), np.linspace(0, 1, side), indexing='ij')
    radius = 1 + rng.uniform(0.1, 0.4) * np.sin(2 * np.pi * rng.integers(2, 6) * u) * np.sin(
        np.pi * v
    )
    longitude, latitude = 2 * np.pi * u, np.pi * v
    points = np.stack([np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude),
                       np.cos(latitude)], -1) * radius[..., None]  # fmt: skip
    mesh = pv.PolyData.from_regular_faces(points.reshape(-1, 3), _grid(*u.shape))
    mesh.active_texture_coordinates = np.stack([u, v], -1).reshape(-1, 2).astype(np.float32)
    n = int(rng.choice([4, 8, 16]))
    image = rng.integers(0, 255, (n, 2 * n, 3), np.uint8).repeat(256 // n, 0).repeat(256 // n, 1)
    return as_parts(mesh, texture=pv.Texture(image))


def _soup(rng, count):
    """Return triangles that share no points, as files of type STL have them."""
    ball = _ball(rng, count, size=4.0, height=0.3)
    points = np.array(ball.points)[ball.regular_faces].reshape(-1, 3)
    faces: np.ndarray = np.arange(len(points)).reshape(-1, 3)
    return as_parts(pv.PolyData.from_regular_faces(points, faces), **_look(rng))


def _shell(rng, count):
    """Return an open bowl without thickness."""
    side = max(int(np.sqrt(count / 4)), 8)
    u, v = np.meshgrid(
        np.linspace(0, 2 * np.pi, 2 * side), np.linspace(0.02, 1, side), indexing='ij'
    )
    bend, wave = rng.uniform(0.8, 2.2), rng.uniform(0.0, 0.2)
    angle = bend * v * (1 + wave * np.cos(5 * u))
    points = np.stack([np.cos(u) * np.sin(angle), np.sin(u) * np.sin(angle), -np.cos(angle)], -1)
    mesh = pv.PolyData.from_regular_faces(points.reshape(-1, 3), _grid(*u.shape)).clean()
    return _as_phong(as_parts(mesh.compute_normals(), **_look(rng)))


def _foliage(rng, count):
    """Return bent leaves around a stem."""
    n = max(count // 4, 50)
    feet = rng.normal(size=(n, 3)) * [0.45, 0.45, 0.35] + [0, 0, 1.2]
    along, aside = rng.normal(size=(2, n, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside -= (aside * along).sum(1, keepdims=True) * along
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    across = np.cross(along, aside)
    size = rng.uniform(0.02, 0.06)
    shape = np.array(
        [[-1, 0, 0], [1, 0, 0], [-1, 1.4, 0.3], [1, 1.4, 0.3], [-0.4, 2.6, 0], [0.4, 2.6, 0]]
    )
    axes = np.stack([0.6 * aside, along, across], 1)
    points = (feet[:, None] + size * np.einsum('kc,ncj->nkj', shape, axes)).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]])
    leaves = pv.PolyData.from_regular_faces(
        points, (np.arange(n)[:, None, None] * 6 + faces).reshape(-1, 3)
    )
    stem = _tube(np.c_[np.zeros((8, 2)), np.linspace(0, 1.4, 8)], 0.05, 12)
    return as_parts(leaves, color='forestgreen') + as_parts(stem, color='saddlebrown')


def _parts(rng, count):
    """Return a body on wheels, each with a look of its own."""
    body = bare(_ball(rng, count // 2, height=0.2))
    points = np.clip(np.array(body.points) * [1.2, 0.7, 0.6], -0.9, 0.9)
    body.points = points + np.array([0.0, 0.0, 0.8])
    parts = as_parts(body, **_look(rng, specular=0.6, specular_power=20))
    side = max(int(np.sqrt(count / 32)), 8)
    for x in (-0.6, 0.6):
        for y in (-0.6, 0.6):
            wheel = bare(pv.ParametricTorus(0.3, 0.1, u_res=2 * side, v_res=side))
            wheel = wheel.rotate_x(90.0).translate((x, y, 0.35)).compute_normals()
            parts += _as_phong(as_parts(wheel, color='dimgray'))
    return parts


def _painted(rng, count):
    ball = _ball(rng, count, height=0.6)
    points = np.array(ball.points)
    colors = [_bumps(points, rng, size) > 0 for size in (3.0, 5.0, 8.0)]
    ball['paint'] = np.where(np.stack(colors, 1), 230, 60).astype(np.uint8)
    return _as_phong(as_parts(ball, scalars='paint', rgb=True))


def _measured(rng, count):
    """Return a ring with a value in each cell."""
    side = max(int(np.sqrt(count / 4)), 8)
    ring = bare(pv.ParametricTorus(1.0, rng.uniform(0.2, 0.5), u_res=2 * side, v_res=side))
    ring.cell_data['value'] = _bumps(ring.cell_centers().points, rng, 6.0)
    return as_parts(ring, scalars='value', cmap='coolwarm')


def _glass(rng, count):
    ball = _ball(rng, count)
    return _as_phong(as_parts(ball, **_look(rng, opacity=float(rng.uniform(0.3, 0.7)))))


def _folds(rng, count):
    """Return walls of which three or more meet in a line: no manifold."""
    walls = int(rng.integers(5, 9))
    side = max(int(np.sqrt(count / 2 / walls)), 6)
    r, z = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1.5, side), indexing='ij')
    meshes = []
    for k in range(walls):
        angle = 2 * np.pi * k / walls + rng.uniform(0.2, 0.6) * np.sin(3 * z) * r
        points = np.stack([r * np.cos(angle), r * np.sin(angle), z], -1).reshape(-1, 3)
        meshes.append(pv.PolyData.from_regular_faces(points, _grid(side, side)))
    return as_parts(pv.merge(meshes).clean(), **_look(rng))


KINDS = {
    'knot': _knot,
    'gear, split edges': _gear,
    'faceted rock': _rock,
    'terrain': _terrain,
    'thin lattice': _lattice,
    'textured': _textured,
    'soup': _soup,
    'open shell': _shell,
    'foliage': _foliage,
    'parts': _parts,
    'vertex colours': _painted,
    'cell scalars': _measured,
    'translucent': _glass,
    'folds': _folds,
}


# -- heavier kinds --------------------------------------------------------------------------------


def _isosurface(levels, count) -> pv.PolyData:
    """Return the surface where a function of points (n, 3) in a cube of side 2 is 0.

    The grid is as fine as about so many triangles need, which go with the square of its side.
    """
    side = 24
    for _ in range(2):
        grid = pv.ImageData(
            dimensions=(side,) * 3, spacing=(2 / (side - 1),) * 3, origin=(-1,) * 3
        )
        grid['level'] = levels(np.array(grid.points))
        surface = grid.contour([0.0], scalars='level')
        side = max(round(side * np.sqrt(count / max(surface.n_cells, 1))), 12)
    return bare(surface).compute_normals(auto_orient_normals=False)


def _gyroid(rng, count):
    periods, shift = rng.uniform(1.0, 2.5), rng.uniform(0, 2 * np.pi, 3)

    def levels(points):
        x, y, z = (np.pi * periods * points + shift).T
        return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)

    return _as_phong(as_parts(_isosurface(levels, count), **_look(rng, specular=0.3)))


def _blobs(rng, count):
    """Return drops that flow into one another."""
    centers = rng.uniform(-0.6, 0.6, (int(rng.integers(8, 20)), 3))
    radii = rng.uniform(0.12, 0.25, len(centers))

    def levels(points):
        away = np.stack([((points - c) ** 2).sum(1) for c in centers])
        return np.exp(-away / radii[:, None] ** 2).sum(0) - 0.4

    mesh = _isosurface(levels, count)
    return _as_phong(as_parts(mesh, **_look(rng, specular=0.7, specular_power=30)))


def _box_lattice(rng, count):
    """Return square beams along all edges of cubes side by side."""
    n = max(round((count / 36) ** (1 / 3) + 1 / 3), 3)  # nodes along a side: 3 n^2 (n - 1) beams
    half = rng.uniform(0.08, 0.16) / (n - 1)
    nodes = np.linspace(-1, 1, n)
    beam, axes = pv.Box(quads=False), np.eye(3)
    beams = []
    for along in range(3):
        places = np.stack(np.meshgrid(nodes, nodes, (nodes[1:] + nodes[:-1]) / 2), -1)
        places = np.roll(places.reshape(-1, 3), along + 1, axis=1)
        sides = np.where(axes[along], 1 / (n - 1) - half, half)
        beams.append(np.array(beam.points) * sides + places[:, None])
    points = np.concatenate(beams)
    offsets: np.ndarray = beam.n_points * np.arange(len(points))[:, None, None]
    faces = (np.asarray(beam.regular_faces) + offsets).reshape(-1, 3)
    return as_parts(pv.PolyData.from_regular_faces(points.reshape(-1, 3), faces), **_look(rng))


def _crystals(rng, count):
    """Return hexagonal prisms with pointed ends that grow from one another, flat-shaded."""
    angle = np.linspace(0, 2 * np.pi, 7)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], 1)
    top = ring + np.array([0.0, 0.0, 4.0])
    points = np.concatenate([ring, top, [[0, 0, 5.2], [0, 0, 0]]])
    i, j = np.arange(6), np.roll(np.arange(6), -1)
    sides = np.stack([i, j, j + 6, i, j + 6, i + 6], 1).reshape(-1, 3)
    ends = np.concatenate(
        [np.stack([i + 6, j + 6, i * 0 + 12], 1), np.stack([j, i, i * 0 + 13], 1)]
    )
    one = pv.PolyData.from_regular_faces(points, np.concatenate([sides, ends])).subdivide(2)
    prisms = []
    for _ in range(max(round(count / one.n_cells), 4)):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn[:, 2] *= np.linalg.det(turn)
        size = rng.uniform(0.03, 0.12) * np.array([1, 1, rng.uniform(0.6, 2.0)])
        foot = rng.normal(size=3) * 0.25
        prism = bare(one)
        prism.points = (np.array(prism.points) * size) @ turn.T + foot
        prisms.append(prism)
    return as_parts(pv.merge(prisms), **_look(rng))


def _ribbon(rng, count):
    """Return a band that is twisted on its way around, with rings of colours."""
    across = int(rng.integers(24, 40))
    along = max(count // (2 * (across - 1)), 60)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, along), np.linspace(-1, 1, across), indexing='ij')
    turns, waves = int(rng.integers(2, 6)), int(rng.integers(2, 4))
    width, twist = rng.uniform(0.2, 0.35), turns * u
    ring = 1 + width * v * np.cos(twist)
    points = np.stack([ring * np.cos(u), ring * np.sin(u),
                       width * v * np.sin(twist) + 0.3 * np.sin(waves * u)], -1)  # fmt: skip
    band = pv.PolyData.from_regular_faces(points.reshape(-1, 3), _grid(along, across))
    band['turn'] = np.sin(int(rng.integers(8, 25)) * u).ravel()
    return _as_phong(as_parts(band.compute_normals(), scalars='turn', cmap='hsv'))


def _thin_tubes(rng, count):
    """Return long thin tubes that wind through one another."""
    sides, tubes = 8, int(rng.integers(6, 16))
    steps = max(count // (2 * sides * tubes), 30)
    t = np.linspace(0, 2 * np.pi, steps)
    meshes = []
    for _ in range(tubes):
        waves, phases = rng.integers(1, 5, (3, 3)), rng.uniform(0, 2 * np.pi, (3, 3))
        line = np.sin(t[:, None, None] * waves + phases).mean(2)
        meshes.append(_tube(line, rng.uniform(0.008, 0.02), sides).compute_normals())
    return _as_phong(as_parts(pv.merge(meshes), **_look(rng)))


HEAVY_KINDS = {
    'gyroid': _gyroid,
    'box lattice': _box_lattice,
    'crystals': _crystals,
    'ribbon': _ribbon,
    'blobs': _blobs,
    'thin tubes': _thin_tubes,
}
