"""Levels of detail for foliage, from the mesh to one billboard."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pyvista as pv

from pvibr.instances.foliage_quads import Groups, clusters, components, quads
from pvibr.instances.mesh_pool import lendable
from pvibr.maths.filled_texels import dilated
from pvibr.maths.flip import flip
from pvibr.maths.image_error import box_reduce, psnr, silhouette_iou
from pvibr.maths.vectors import as_units
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts, check_triangles
from pvibr.meshes.surfaces import some_triangles
from pvibr.meshes.turntable import Turns
from pvibr.textures.material_textures import copy_texture

_SAMPLES = 4  # along a side of a texel of a turntable, and of a pixel of the reference
_SHARES = (0.5, 0.2)  # of its triangles that a trunk keeps in the levels of quads


@dataclass
class FoliageLevel:
    """One level."""

    name: str
    vertices: int
    triangles: int
    quads: int
    textures: list
    error: dict = field(default_factory=dict)


class FoliageLevels:
    """Levels of a plant; :func:`foliage_levels` makes them."""

    def __init__(self, parts, counts, turntable):
        self.parts, self.turntable = parts, turntable
        self.billboard = {**turntable, 'image': turntable['image'][:1], 'views': 1}
        mesh_levels = zip(('mesh', 'parts', 'clusters'), self._meshes(), [0, *counts], strict=True)
        self.levels = [_of_meshes(*row) for row in mesh_levels]
        view_size = turntable['image'][0].shape[1::-1]
        self.levels.append(FoliageLevel('turntable', 4, 2, 1, [view_size] * turntable['views']))
        self.levels.append(FoliageLevel('billboard', 4, 2, 1, [view_size]))

    def _meshes(self) -> list:
        """Return the parts of each level of meshes."""
        n_levels = len(self.parts[0].supplied_levels)
        return [
            self.parts,
            *([q for p in self.parts for q in p.supplied_levels[k]] for k in range(n_levels)),
        ]

    def actors(self, name) -> list:
        """Return new actors that show a level of meshes, for ``plotter.add_actor``."""
        names = [level.name for level in self.levels[: len(self._meshes())]]
        if name not in names:
            raise ValueError(f'name must be one of {", ".join(names)}, got {name!r}')
        return _actors(self._meshes()[names.index(name)])

    def measure(self, size=128, directions=6) -> FoliageLevels:
        """Measure the error of each level against the supersampled mesh."""
        views = _views_around(self.parts, directions)
        samples = _pictures(_shown(self.parts), views, [size * _SAMPLES] * 2)
        reference = [box_reduce(picture, _SAMPLES) for picture in samples]
        scenes = [_shown(parts) for parts in self._meshes()]
        scenes += [_billboard(cards) for cards in (self.turntable, self.billboard)]
        for level, add_actors in zip(self.levels, scenes, strict=True):
            pictures = _pictures(add_actors, views, [size] * 2)
            pairs = list(zip(pictures, reference, strict=True))
            color_pairs = [(_on_white(a), _on_white(b)) for a, b in pairs]
            alphas = [(a[..., 3], b[..., 3]) for a, b in pairs]
            level.error = {
                'flip': float(np.mean([flip(a, b).mean() for a, b in color_pairs])),
                'psnr': float(np.mean([psnr(a, b) for a, b in color_pairs])),
                'iou': float(np.mean([silhouette_iou(a, b) for a, b in alphas])),
            }
        return self

    def __str__(self):
        lines = [
            f'{"level":<10} {"vertices":>9} {"triangles":>9} {"quads":>7} {"texels":>10}  error'
        ]
        for level in self.levels:
            texels = sum(w * h for w, h in level.textures)
            error = ', '.join(f'{k} {v:.3g}' for k, v in level.error.items()) or '-'
            lines.append(
                f'{level.name:<10} {level.vertices:>9,} {level.triangles:>9,} {level.quads:>7,} '
                f'{texels:>10,}  {error}'
            )
        return '\n'.join(lines)


def foliage_levels(
    mesh,
    labels=None,
    *,
    largest=0.25,
    n_clusters=None,
    crossed=3,
    views=16,
    view_size=256,
    texels=1024,
    axis=(0.0, 0.0, 1.0),
    **looks,
) -> FoliageLevels:
    """Return levels of detail of foliage, objects of many small parts such as leaves.

    From the heaviest: the mesh; a textured quad per part; quads per cluster of parts; a billboard
    with a turntable of views about an axis; a billboard with one view. The levels of quads keep
    large parts, such as a trunk, as simplified meshes.

    Parameters
    ----------
    mesh : dataset, MultiBlock, actor, trimesh object, path, list of Part or of actors
        As :meth:`plotter.ibr.add_instances` takes it, or a list of actors.
    labels : array_like of int, shape (m,), optional
        Part of each triangle of a mesh with one look; triangles with negative labels stay a mesh.
        By default parts are connected components.
    largest : float
        Maximum size of a small part, relative to the size of the mesh.
    n_clusters : int, optional
        Number of clusters; by default twice the square root of the number of parts.
    crossed : {1, 2, 3}
        Quads per cluster: in the best-fit plane, and perpendicular to it.
    views : int
        Number of views of the turntable.
    view_size : int
        Texels along the longer side of a view.
    texels : int
        Maximum texels along a side of the quads' textures.
    axis : array_like, shape (3,)
        Axis of the turntable.
    **looks
        As in :meth:`pyvista.Plotter.add_mesh`.

    Returns
    -------
    FoliageLevels
        Levels for instances, chosen by their measured error; ``turntable`` and ``billboard`` are
        arguments of billboards.

    Raises
    ------
    ValueError
        If an argument is invalid, or there are no small parts.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> places = pv.PolyData(np.random.default_rng(0).uniform(size=(40, 3)))
    >>> ferns = places.glyph(geom=pv.Disc(inner=0, outer=0.03), scale=False, orient=False)
    >>> levels = pvibr.foliage_levels(ferns, views=4, view_size=32, texels=128, color='green')
    >>> [(level.name, level.quads) for level in levels.levels]
    [('mesh', 0), ('parts', 40), ('clusters', 39), ('turntable', 1), ('billboard', 1)]
    """
    _check(largest, crossed, views, view_size)
    parts = as_parts(mesh, **looks)
    check_triangles(parts)
    divided = _divided(parts, labels, largest)
    if not any(foliage is not None for _, foliage, _ in divided):
        raise ValueError(
            f'mesh must have parts below {largest} of its size, got none; pass labels or raise '
            'largest'
        )
    parts_with_levels, counts = [], np.zeros(len(_SHARES), int)
    for part, (rest, foliage, group_of_triangle) in zip(parts, divided, strict=True):
        level_groups: list = [[], []]
        if foliage is not None:
            leaf_groups = Groups.of(foliage.mesh, group_of_triangle)
            cluster_of_triangle = _clustered(leaf_groups, n_clusters)[group_of_triangle]
            cluster_groups = Groups.of(foliage.mesh, cluster_of_triangle)
            level_groups = [[leaf_groups], [cluster_groups.turned(k) for k in range(crossed)]]
        supplied_levels = []
        for groups, share in zip(level_groups, _SHARES, strict=True):
            level = [quads(foliage, groups, texels=texels)] if groups else []
            level += [] if rest is None else [lighter(rest, share) or rest]
            supplied_levels.append(tuple(level))
        counts += [sum(len(g.axes) for g in groups) for groups in level_groups]
        parts_with_levels.append(replace(part, supplied_levels=tuple(supplied_levels)))
    turns = Turns(tuple(as_units('axis', axis).tolist()), int(views))
    parts_with_levels[0] = replace(parts_with_levels[0], turns=turns)
    return FoliageLevels(parts_with_levels, counts.tolist(), _turntable(parts, turns, view_size))


def _check(largest, crossed, views, view_size):
    if not 0 < largest < 1:
        raise ValueError(f'largest must be between 0 and 1, got {largest!r}')
    if crossed not in (1, 2, 3):
        raise ValueError(f'crossed must be 1, 2 or 3, got {crossed!r}')
    if views < 1 or view_size < 4:
        raise ValueError(
            f'views must be at least 1 and view_size at least 4, got {views!r} and {view_size!r}'
        )


def _divided(parts, labels, largest):
    """Return of each part the rest, the foliage, and the groups of its triangles."""
    if labels is not None:
        count = parts[0].mesh.n_cells
        labels = np.asarray(labels)
        if len(parts) > 1 or labels.shape != (count,) or labels.dtype.kind not in 'iu':
            raise ValueError(
                f'labels must be ({count},) integers, one per triangle of a mesh with one look, '
                f'got shape {labels.shape}, dtype {labels.dtype}'
            )
        return [_split(parts[0], labels, labels >= 0)]
    all_bounds = np.array([p.mesh.bounds for p in parts]).reshape(-1, 3, 2)
    low, high = all_bounds[:, :, 0].min(0), all_bounds[:, :, 1].max(0)
    largest_size = largest * np.linalg.norm(high - low)
    divided = []
    for part in parts:
        part_labels = components(part.mesh)
        groups = Groups.of(part.mesh, part_labels)
        is_small = np.linalg.norm(groups.high - groups.low, axis=1) < largest_size
        divided.append(_split(part, part_labels, is_small[part_labels]))
    return divided


def _split(part, labels, is_small):
    if not is_small.any():
        return part, None, None
    group_of_triangle = np.unique(labels[is_small], return_inverse=True)[1].ravel()
    if is_small.all():
        return None, part, group_of_triangle
    rest, foliage = (
        part.with_mesh(some_triangles(part.mesh, np.flatnonzero(mask)))
        for mask in (~is_small, is_small)
    )
    return rest, foliage, group_of_triangle


def _clustered(groups, count):
    middles = (groups.low + groups.high) / 2
    centers = np.einsum('gij,gi->gj', groups.axes, middles)
    count = count or int(np.ceil(2 * np.sqrt(len(centers))))
    return clusters(centers, int(count))


def _turntable(parts, turns, view_size) -> dict:
    """Return arguments of billboards that show an object from around an axis."""
    first_axis, second_axis, axis = turns.sides()
    points = np.concatenate([np.asarray(p.mesh.points, float) for p in parts])
    heights = points @ axis
    radius = float(np.linalg.norm(points - heights[:, None] * axis, axis=1).max())
    lowest = float(heights.min())
    height = float(np.ptp(heights)) or radius
    focal_point, distance = (lowest + height / 2) * axis, 2 * (radius + height)
    azimuths = 2 * np.pi * np.arange(turns.views)[:, None] / turns.views
    directions = np.cos(azimuths) * first_axis + np.sin(azimuths) * second_axis
    views = [(direction, focal_point, axis, height / 2, distance) for direction in directions]
    texels_per_unit = view_size / max(2 * radius, height)
    window_size = [max(round(n * texels_per_unit), 1) * _SAMPLES for n in (2 * radius, height)]
    pictures = _pictures(_shown(parts), views, window_size)
    return {
        'image': [dilated(box_reduce(p, _SAMPLES)) for p in pictures],
        'size': np.array([[2 * radius, height]]),
        'facing': 'cylindrical',
        'axis': axis,
        'anchor': (0.5, -lowest / height),
        'views': turns.views,
    }


def _shown(parts):
    """Return a function that adds parts to a plotter."""

    def add_parts(plotter):
        for actor in _actors(parts):
            plotter.renderer.AddViewProp(actor)

    return add_parts


def _actors(parts):
    """Return independent actors of parts for another window."""
    actors = []
    for part in parts:
        actor = lendable(part, part.polydata_mapper())
        actor.SetTexture(copy_texture(part.actor.GetTexture()))
        actors.append(actor)
    return actors


def _billboard(cards):
    def add_cards(plotter):
        plotter.ibr.add_billboards([[0.0, 0, 0]], reset_camera=False, **cards)

    return add_cards


def _pictures(add_actors, views, size):
    """Return premultiplied RGBA, 0 to 1, of parallel views, top row first."""
    plotter = pv.Plotter(off_screen=True, window_size=size, theme=pv.themes.Theme())
    try:
        plotter.renderer.disable_anti_aliasing()
        plotter.renderer.set_background('black')
        add_actors(plotter)
        plotter.show(auto_close=False)
        camera, pictures = plotter.camera, []
        camera.parallel_projection = True
        for direction, focal_point, up, half_height, distance in views:
            camera.position = focal_point + distance * direction
            camera.focal_point, camera.up = focal_point, up
            camera.parallel_scale = half_height
            camera.clipping_range = 0.01 * distance, 2 * distance
            plotter.render()
            picture = np.asarray(plotter.screenshot(transparent_background=True), float) / 255
            picture[..., :3] *= picture[..., 3:]
            pictures.append(picture)
        return pictures
    finally:
        plotter.close()


def _views_around(parts, count) -> list:
    """Return views of an object from azimuths all around, at three elevations in turn."""
    bounds = np.array([p.mesh.bounds for p in parts]).reshape(-1, 3, 2)
    low, high = bounds[:, :, 0].min(0), bounds[:, :, 1].max(0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    views = []
    for k in range(count):
        azimuth, elevation = 2 * np.pi * (k + 0.3) / count, np.radians(30) * (k % 3) / 2
        horizontal = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) * np.cos(elevation)
        direction = horizontal + np.array([0, 0, np.sin(elevation)])
        views.append((direction, center, (0, 0, 1), radius, 3 * radius))
    return views


def _of_meshes(name, parts, count) -> FoliageLevel:
    textures = [t.GetInput().GetDimensions()[:2] for p in parts if (t := p.actor.GetTexture())]
    n_vertices = sum(p.mesh.n_points for p in parts)
    return FoliageLevel(name, n_vertices, sum(p.mesh.n_cells for p in parts), count, textures)


def _on_white(picture):
    return np.clip(picture[..., :3] + 1 - picture[..., 3:], 0, 1)
