"""Levels of detail for foliage, from the mesh to one billboard."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pyvista as pv

from pvibr.instances.foliage_quads import Groups, clusters, components, dilated, quads
from pvibr.instances.mesh_pool import lendable
from pvibr.maths.facing import CLOSE
from pvibr.maths.flip import flip
from pvibr.maths.image_error import box_reduce, psnr, silhouette_iou
from pvibr.maths.vectors import as_units
from pvibr.meshes.decimate import lighter
from pvibr.meshes.materials import copy_texture
from pvibr.meshes.parts import Part, as_parts, check_triangles
from pvibr.meshes.surfaces import some_triangles
from pvibr.meshes.turntable import Turns

_SAMPLES = 4  # along a side of a texel of a turntable, and of a pixel of the reference
_SHARES = (0.5, 0.2)  # of the triangles of what stays a mesh, beside quads


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
        rows = zip(('mesh', 'parts', 'clusters'), self._meshes(), [0, *counts], strict=True)
        self.levels = [_of_meshes(*row) for row in rows]
        size = turntable['image'][0].shape[1::-1]
        self.levels.append(FoliageLevel('turntable', 4, 2, 1, [size] * turntable['views']))
        self.levels.append(FoliageLevel('billboard', 4, 2, 1, [size]))

    def _meshes(self) -> list:
        """Return the parts of each level of meshes."""
        count = len(self.parts[0].stand_ins)
        return [
            self.parts,
            *([q for p in self.parts for q in p.stand_ins[k]] for k in range(count)),
        ]

    def actors(self, name) -> list:
        """Return new actors that show a level of meshes, for ``plotter.add_actor``."""
        names = [level.name for level in self.levels[: len(self._meshes())]]
        if name not in names:
            raise ValueError(f'name is {name!r}; it must be one of {", ".join(names)}')
        return _actors(self._meshes()[names.index(name)])

    def measure(self, size=128, directions=6) -> FoliageLevels:
        """Measure the error of each level against the supersampled mesh."""
        shots = _Shots(self.parts, size, directions)
        truth = shots.take(_shown(self.parts), _SAMPLES)
        drawn = [shots.take(_shown(parts)) for parts in self._meshes()]
        drawn += [shots.take(_billboard(cards)) for cards in (self.turntable, self.billboard)]
        for level, pictures in zip(self.levels, drawn, strict=True):
            pairs = list(zip(pictures, truth, strict=True))
            colors = [(_on_white(a), _on_white(b)) for a, b in pairs]
            level.error = {
                'flip': float(np.mean([flip(a, b).mean() for a, b in colors])),
                'psnr': float(np.mean([psnr(a, b) for a, b in colors])),
                'iou': float(np.mean([silhouette_iou(a[..., 3], b[..., 3]) for a, b in pairs])),
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
    """Return ever cheaper levels of detail of foliage: many small parts, such as leaves.

    The mesh; a textured quad per part; quads per cluster of parts; a turntable of views about an
    axis on a billboard; one billboard. Large parts, such as a trunk, stay simplified meshes in the
    levels of quads.

    Parameters
    ----------
    mesh : dataset, MultiBlock, actor, trimesh object, path, list of Part or of actors
        As :meth:`plotter.ibr.add_instances` takes it, or a list of actors.
    labels : array_like of int, shape (m,), optional
        Part of each triangle of a mesh with one look; negative triangles stay a mesh. By default
        parts are connected components.
    largest : float
        Maximum size of a small part, as a share of the mesh's.
    n_clusters : int, optional
        Number of clusters; by default twice the root of the number of parts.
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
    if not any(small is not None for _, small, _ in divided):
        raise ValueError(
            f'mesh has no part below {largest} of its size; give labels, or raise largest'
        )
    joined, counts = [], np.zeros(len(_SHARES), int)
    for part, (kept, small, of_part) in zip(parts, divided, strict=True):
        sets: list = [[], []]
        if small is not None:
            groups = Groups.of(small.mesh, of_part)
            bunches = Groups.of(small.mesh, _clustered(groups, n_clusters)[of_part])
            sets = [[groups], [bunches.turned(k) for k in range(crossed)]]
        stand_ins = []
        for chosen, share in zip(sets, _SHARES, strict=True):
            level = [quads(small, chosen, texels=texels)] if chosen else []
            stand_ins.append(
                (*level, *([lighter(kept, share) or kept] if kept is not None else []))
            )
        counts += [sum(len(g.axes) for g in chosen) for chosen in sets]
        joined.append(replace(part, stand_ins=tuple(stand_ins)))
    axis = as_units('axis', axis)
    joined[0] = replace(joined[0], turns=Turns(tuple(axis.tolist()), int(views)))
    turntable = _turntable(parts, axis, views, view_size)
    return FoliageLevels(joined, counts.tolist(), turntable)


def _check(largest, crossed, views, view_size):
    if not 0 < largest < 1:
        raise ValueError(f'largest is {largest!r}; it must be between 0 and 1')
    if crossed not in (1, 2, 3):
        raise ValueError(f'crossed is {crossed!r}; it must be 1, 2 or 3')
    if views < 1 or view_size < 4:
        raise ValueError(f'views = {views!r}, view_size = {view_size!r}: must be 1 and 4 at least')


def _divided(parts, labels, largest):
    """Return for each part the rest as a mesh, the foliage, and its labels."""
    if labels is not None:
        count = parts[0].mesh.n_cells
        labels = np.asarray(labels)
        if len(parts) > 1 or labels.shape != (count,) or labels.dtype.kind not in 'iu':
            raise ValueError(
                f'labels has shape {labels.shape}, dtype {labels.dtype}; it must be integers, one '
                f'for each of the {count} triangles of a mesh with one look'
            )
        return [_split(parts[0], labels, labels >= 0)]
    whole = np.array([p.mesh.bounds for p in parts]).reshape(-1, 3, 2)
    limit = largest * np.linalg.norm(whole[:, :, 1].max(0) - whole[:, :, 0].min(0))
    out = []
    for part in parts:
        found = components(part.mesh)
        groups = Groups.of(part.mesh, found)
        sizes = np.linalg.norm(groups.high - groups.low, axis=1)
        out.append(_split(part, found, sizes[found] < limit))
    return out


def _split(part, labels, small):
    if not small.any():
        return part, None, None
    of_part = np.unique(labels[small], return_inverse=True)[1].ravel()
    kept = None if small.all() else _only(part, ~small)
    return kept, part if kept is None else _only(part, small), of_part


def _only(part, chosen) -> Part:
    """Return a part with some of its triangles."""
    return part.with_mesh(some_triangles(part.mesh, np.flatnonzero(chosen)))


def _clustered(groups, count):
    middles = (groups.low + groups.high) / 2
    centers = np.einsum('gij,gi->gj', groups.axes, middles)
    count = count or int(np.ceil(2 * np.sqrt(len(centers))))
    return clusters(centers, int(count))


def _turntable(parts, axis, views, size) -> dict:
    """Return arguments of billboards that show an object from its sides."""
    points = np.concatenate([np.asarray(p.mesh.points, float) for p in parts])
    along = points @ axis
    radius = float(np.linalg.norm(points - along[:, None] * axis, axis=1).max())
    low, height = float(along.min()), float(np.ptp(along))
    height = height or radius
    side = np.array([1.0, 0, 0] if abs(axis[0]) < CLOSE else [0, 1.0, 0])
    first = as_units('axis', side - axis * (axis @ side))
    second = np.cross(axis, first)
    focus = (low + height / 2) * axis
    reach = 2 * (radius + height)
    cameras = []
    for angle in 2 * np.pi * np.arange(views) / views:
        back = np.cos(angle) * first + np.sin(angle) * second
        cameras.append((focus + reach * back, focus, axis, height / 2, reach))
    texels = size / max(2 * radius, height)
    window = [max(round(2 * radius * texels), 1), max(round(height * texels), 1)]
    pictures = _pictures(_shown(parts), cameras, [n * _SAMPLES for n in window])
    images = [dilated(box_reduce(p, _SAMPLES)) for p in pictures]
    return {
        'image': images,
        'size': np.array([[2 * radius, height]]),
        'facing': 'cylindrical',
        'axis': axis,
        'anchor': (0.5, -low / height),
        'views': views,
    }


def _shown(parts):
    """Return a function that adds parts to a plotter."""

    def put(plotter):
        for actor in _actors(parts):
            plotter.renderer.AddViewProp(actor)

    return put


def _actors(parts):
    """Return independent actors of parts for another window."""
    out = []
    for part in parts:
        actor = lendable(part, part.polydata_mapper())
        actor.SetTexture(copy_texture(part.actor.GetTexture()))
        out.append(actor)
    return out


def _billboard(cards):
    def put(plotter):
        plotter.ibr.add_billboards([[0.0, 0, 0]], reset_camera=False, **cards)

    return put


def _pictures(put, cameras, size):
    """Return premultiplied RGBA, 0 to 1, of parallel views, top row first."""
    plotter = pv.Plotter(off_screen=True, window_size=size, theme=pv.themes.Theme())
    try:
        plotter.renderer.disable_anti_aliasing()
        plotter.renderer.set_background('black')
        put(plotter)
        plotter.show(auto_close=False)
        camera, out = plotter.camera, []
        camera.parallel_projection = True
        for eye, focus, up, half, reach in cameras:
            camera.position, camera.focal_point, camera.up = eye, focus, up
            camera.parallel_scale = half
            camera.clipping_range = 0.01 * reach, 2 * reach
            plotter.render()
            picture = np.asarray(plotter.screenshot(transparent_background=True), float) / 255
            picture[..., :3] *= picture[..., 3:]
            out.append(picture)
        return out
    finally:
        plotter.close()


class _Shots:
    """Renders foliage and its levels from all around."""

    def __init__(self, parts, size, directions):
        bounds = np.array([p.mesh.bounds for p in parts]).reshape(-1, 3, 2)
        low, high = bounds[:, :, 0].min(0), bounds[:, :, 1].max(0)
        focus, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        self.size, self.cameras = size, []
        for k in range(directions):
            azimuth = 2 * np.pi * (k + 0.3) / directions
            height = np.radians(30) * (k % 3) / 2
            flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) * np.cos(height)
            back = flat + np.array([0, 0, np.sin(height)])
            self.cameras.append((focus + 3 * radius * back, focus, (0, 0, 1), radius, 3 * radius))

    def take(self, put, samples=1):
        """Return images supersampled by a factor along a side."""
        pictures = _pictures(put, self.cameras, [self.size * samples] * 2)
        return [box_reduce(p, samples) for p in pictures]


def _of_meshes(name, parts, count) -> FoliageLevel:
    textures = [t.GetInput().GetDimensions()[:2] for p in parts if (t := p.actor.GetTexture())]
    vertices, cells = (sum(getattr(p.mesh, n) for p in parts) for n in ('n_points', 'n_cells'))
    return FoliageLevel(name, vertices, cells, count, textures)


def _on_white(picture):
    return np.clip(picture[..., :3] + 1 - picture[..., 3:], 0, 1)
