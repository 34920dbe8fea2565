"""Levels of detail of one mesh: lighter meshes and an atlas, baked, measured and cached."""

from __future__ import annotations

import time
import weakref
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.progress import baking
from pvibr.gl.driver import driver_of
from pvibr.instances.atlas import Atlas, bounding_sphere
from pvibr.instances.bake import bake_parts, check_grid
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.instances.cost_model import why_not_baked
from pvibr.instances.hulls import hull_corners
from pvibr.instances.limits import SIDE_SHADERS, Limits, by_cost, depth_limits, limits_of
from pvibr.instances.measure import Reference, measure, mesh_needs, workers, worst
from pvibr.instances.memory import bytes_of, tiles
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.instances.smoothed import interpolated, smoothed
from pvibr.instances.stored_levels import from_arrays, to_arrays
from pvibr.meshes.decimate import Weldings, displacement, is_surface, lighter
from pvibr.meshes.parts import as_parts, check_triangles
from pvibr.meshes.texture_maps import emission_of
from pvibr.textures.material_textures import TEXTURE_MODES
from pvibr.things.content_key import textures_of

# Of the cache. Raise it with any change of bake, decimation, measurement, card shaders (errors are
# measured on their pictures), rules of errors (they decide what is measured) or stored arrays.
VERSION = 54
SHARE = 0.25  # triangles of a level relative to the next heavier one
#: The same for levels within these triangle counts, which are most of what frames draw.
_HALF, _HALVED = 0.5, (2_500, 40_000)
_ALIKE = 0.5  # px of `max_error`: views are taken of the lightest level that needs no more
_LIGHTEST = 150  # minimum triangles of the lightest level
_WORTH_A_LEVEL = 0.8  # of the mesh's triangles: a level with more saves hardly anything
#: Views along a side of the grid, texels along a side of a view. Magnified views blur, and fewer
#: views serve up to smaller sizes only; neighbouring views of cut-outs do not blend well.
_GRID, _CUT_GRID = (24, 128), (16, 128)
_ROUNDING = 1e-9  # tolerance of the bounds of a mesh's hull, relative to its size
# Atlases in use, by content: sets of the same mesh share one and its textures.
_atlases: weakref.WeakValueDictionary[str, Atlas] = weakref.WeakValueDictionary()


@dataclass
class LodModel:
    """The levels of a mesh, heaviest first, and the atlas of its images."""

    levels: list
    atlas: Atlas
    #: Why it has no images, empty if it has.
    why_unbaked: str = ''
    #: Free GPU memory, in bytes, from which it can have images.
    required_bytes: float = 0.0
    #: What the report adds about its tiles.
    note: str = ''
    #: Colour that replaces that of the images, and 1; or zeros.
    paint: tuple = (0.0, 0.0, 0.0, 0.0)
    _limits: dict = field(default_factory=dict)

    @property
    def is_draft(self) -> bool:
        """Whether its levels are drawn until a bake is done."""
        return False

    @cached_property
    def corners(self) -> np.ndarray:
        """Points on the convex hull of the mesh, model space."""
        return hull_corners(_drawn_points(self.levels[0].parts))

    def limits(self, max_error, driver=None) -> Limits:
        """Return the sizes at which levels change for a `max_error` in pixels."""
        driver = driver or driver_of()
        limits_key = max_error, driver
        if limits_key not in self._limits:
            accurate = limits_of(self.atlas.errors, len(self.levels), max_error)
            triangles = [level.triangles for level in self.levels]
            self._limits[limits_key] = by_cost(accurate, triangles, driver)
        return self._limits[limits_key]

    def depth_limits(self, max_error, aspect) -> Limits:
        """Return the same for depth maps, whose texels are `aspect` times as long as wide."""
        limits, triangles = self.limits(max_error), [level.triangles for level in self.levels]
        errors = self.atlas.errors
        return depth_limits(limits, errors, triangles, max_error, aspect) if errors else limits

    def to_arrays(self) -> dict:
        """Return everything that was baked as named arrays, for a file."""
        arrays = self.atlas.to_arrays() | {'corners': self.corners}
        are_supplied = supplied_level_count(self.levels[0].parts)
        return arrays if are_supplied else arrays | to_arrays(self.levels)

    def describe(self, limits) -> str:
        """Return views, bake time and the sizes at which levels change, as one line."""
        atlas = self.atlas
        if self.why_unbaked:
            triangles = self.levels[0].triangles
            return f'{triangles} triangles at any size, not baked: {self.why_unbaked}'
        names = SIDE_SHADERS & limits.side_cards.keys()
        side_spans = {f'{n} from the side': limits.side_cards[n] for n in sorted(names)}
        card_texts = [
            f'{name} to {_between(high)} px'
            for name, (low, high) in (side_spans | limits.cards).items()
            if (high > low).any()
        ]
        mesh_texts = [
            f'{level.triangles} triangles '
            + (f'to {_between(sizes)} px' if sizes.max() < 1e5 else 'at any size')
            for level, sizes in zip(self.levels[::-1], limits.mesh_to[::-1], strict=True)
            if (sizes > limits.mesh_from).any()
        ]
        summary = f'{atlas.views} x {atlas.views} views of {atlas.tile} texels{self.note}'
        summary += f', baked in {atlas.seconds:.1f} s'
        if atlas.animated:
            summary = f'{atlas.n_poses} poses of {summary}'
        return '; '.join([summary, *card_texts, *mesh_texts])


def _between(sizes) -> str:
    """Return the range of sizes as text."""
    ends = f'{sizes.min():.0f}', f'{sizes.max():.0f}'
    return ends[0] if ends[0] == ends[1] else ' to '.join(ends)


def bake(mesh, *, views=None, tile=None, half=False, cache=True, progress=None, **looks) -> Atlas:
    """Return the atlas of a mesh, with measured errors."""
    parts = as_parts(mesh, **looks)
    check_triangles(parts)
    grid = {'views': views, 'tile': tile, 'half': half}
    return make_model(parts, cache=cache, progress=progress, **grid).atlas


def make_model(
    parts,
    *,
    count=None,
    max_bytes=None,
    half=False,
    cache=True,
    progress=None,
    views=None,
    tile=None,
) -> LodModel:
    """Return the levels of a mesh, baked and measured, or cached."""
    grid = {'half': half, 'views': views, 'tile': tile}
    planned = plan_of(parts, count=count, max_bytes=max_bytes, cache=cache, **grid)
    return planned.bake(progress) if isinstance(planned, BakePlan) else planned


@dataclass
class BakePlan:
    """A bake that is to be done: its images are not in the cache."""

    parts: list
    #: As of :func:`plan_of`: views, tile and half.
    grid: dict
    cache: AtlasCache | None
    #: Key in the cache; empty without one.
    key: str
    #: What the report adds about its tiles.
    note: str = ''

    @property
    def nbytes(self) -> int:
        """Bytes of GPU memory of the images."""
        return bytes_of(self.grid['views'], self.grid['tile'])

    def with_key(self) -> BakePlan:
        """Return the same with the key that it would have in a cache."""
        key = self.key or atlas_key(content_key(self.parts), *self.grid.values())
        return replace(self, key=key)

    def bake(self, progress=None, on_levels=None) -> LodModel:
        """Return the levels, baked here or meanwhile by another process."""
        # `on_levels` is called with the levels as soon as these are there, if they are simplified.
        if self.cache is None:
            return self._noted(_new_model(self.parts, progress, on_levels, **self.grid))
        with self.cache.locked(self.key):  # one process bakes, others wait for it
            return self.load() or self._stored(
                _new_model(self.parts, progress, on_levels, **self.grid)
            )

    def load(self) -> LodModel | None:
        """Return the levels from the cache, None if they are not there."""
        if self.cache is None:
            return None
        model = self.cache.load(self.key, lambda arrays: _from_cache(self.parts, arrays))
        if model is None:
            return None
        model.atlas = _atlases.setdefault(self.key, model.atlas)
        return self._noted(model)

    def _noted(self, model) -> LodModel:
        model.note = self.note
        return model

    def _stored(self, model) -> LodModel:
        if self.cache is not None and not model.why_unbaked:
            self.cache.put(self.key, model.to_arrays())
            _atlases[self.key] = model.atlas
        return self._noted(model)


def plan_of(
    parts, *, count=None, max_bytes=None, half=False, cache=True, views=None, tile=None
) -> LodModel | BakePlan:
    """Return the levels of a mesh, or the bake that they need."""
    # With a count of instances the mesh is baked only if that pays; with max_bytes of GPU memory
    # its tiles shrink until they fit.
    if reason := no_images(parts, count):
        return unbaked(parts, reason)
    default_views, default_tile = _grid(parts)
    views = default_views if views is None else views
    tile = default_tile if tile is None else tile
    check_grid(views, tile)
    atlas_cache = None if cache is False else AtlasCache(None if cache is True else cache)
    content_hash = None if atlas_cache is None else content_key(parts)
    tile_size = tile if max_bytes is None else _fitting(content_hash, views, tile, half, max_bytes)
    if not tile_size:
        reason = 'GPU memory for images is at its limit'
        return unbaked(parts, reason, required_bytes=bytes_of(views, min(tiles(tile))))
    cache_key = '' if atlas_cache is None else atlas_key(content_hash, views, tile_size, half)
    note = f', not {tile}, as GPU memory is limited' if tile_size < tile else ''
    grid = {'views': views, 'tile': tile_size, 'half': half}
    plan = BakePlan(parts, grid, atlas_cache, cache_key, note)
    return plan.load() or plan


def _grid(parts) -> tuple[int, int]:
    """Return views along a side of the grid and texels along a side of a view."""
    is_cut_out = any(p.alpha_cutoff is not None or p.supplied_levels for p in parts)
    return _CUT_GRID if is_cut_out or _turntable_of(parts) is not None else _GRID


def _fitting(content, views, tile, half, max_bytes) -> int:
    """Return the largest size of tiles that fits max_bytes, 0 if none does."""

    def fits(size):
        is_shared = content is not None and atlas_key(content, views, size, half) in _atlases
        return is_shared or bytes_of(views, size) <= max_bytes

    return next(filter(fits, tiles(tile)), 0)


def _new_model(parts, progress, on_levels=None, **grid) -> LodModel:
    """Bake and measure; without images if the driver fails."""
    try:
        return _baked(parts, progress, on_levels, **grid)
    except RuntimeError as error:
        warn(
            f'image cards are disabled, and meshes are drawn instead: {error}. Run `pvibr '
            'doctor`, or update the graphics driver.'
        )
        return unbaked(parts, str(error) or 'the bake failed', required_bytes=np.inf)


def _from_cache(parts, arrays) -> LodModel:
    """Return a model from arrays of the cache, checked."""
    levels = _levels(parts) if supplied_level_count(parts) else from_arrays(parts, arrays)
    model = LodModel(levels, Atlas.from_arrays(arrays))
    if not model.atlas.errors:
        raise ValueError('it has no error table')
    model.limits(1.0)
    model.corners = _checked_corners(parts, np.asarray(arrays['corners'], float))
    return model


def _checked_corners(parts, corners) -> np.ndarray:
    """Return points, checked to be on the convex hull of a mesh."""
    points = _drawn_points(parts)
    # A hull may leave out points beyond its faces by rounding errors.
    tolerance = _ROUNDING * np.ptp(points, axis=0).max()
    extent, mesh_extent = (np.stack([p.min(0), p.max(0)]) for p in (corners, points))
    if corners.ndim != 2 or not np.allclose(extent, mesh_extent, rtol=0, atol=tolerance):
        raise ValueError('its corners are not those of the mesh')
    return corners


def _drawn_points(parts) -> np.ndarray:
    return np.concatenate([np.asarray(part.drawn_points(), float) for part in parts])


def no_images(parts, count=None) -> str:
    """Return why parts cannot have images, or need none for `count` instances; else empty."""
    reason = next((part.ineligibility for part in parts if part.ineligibility), '')
    if not reason and count is not None and _turntable_of(parts) is None:
        reason = why_not_baked(MeshLevel(parts).triangles, count)
    return reason


def unbaked(parts, why, required_bytes=0.0) -> LodModel:
    """Return a model without images, drawn as the mesh at every size."""
    blank = Atlas.blank(_points(parts))
    return LodModel([MeshLevel(list(parts))], blank, why, required_bytes)


def _baked(parts, progress, on_levels, **grid):
    start = time.perf_counter()
    turns = _turntable_of(parts)
    model = LodModel([MeshLevel(list(parts))], Atlas.blank(_points(parts), half=grid['half']))
    bounding = model.atlas.center, model.atlas.radius
    with baking(progress) as advance, workers() as pool:
        lighter_levels = _levels_later(parts, pool)
        with Reference(model, pool) as reference:
            advance(0.1)
            model.levels += lighter_levels.result()
            if on_levels is not None and not supplied_level_count(parts):
                on_levels(model.levels)
            reference.add_levels(model, lambda d: advance(0.1 + 0.4 * d))
        bake_level = _bake_level(model.levels, reference, grid['tile'])
        baked_parts = _lightest_parts(model.levels[: bake_level + 1])
        model.atlas = atlas = bake_parts(
            baked_parts,
            sphere=bounding,
            turns=turns,
            progress=lambda d: advance(0.5 + 0.25 * d),
            **grid,
        )
        atlas.errors = measure(model, lambda d: advance(0.75 + 0.25 * d), reference)
    atlas.seconds = time.perf_counter() - start
    return model


def _turntable_of(parts):
    """Return the turntable views that parts ask for, or None."""
    return next((p.turns for p in parts if p.turns is not None), None)


def supplied_level_count(parts) -> int:
    """Return the number of lighter levels supplied with the parts."""
    return max(len(p.supplied_levels) for p in parts)


def _levels(parts):
    return [MeshLevel(list(parts)), *(supplied_levels(parts) or _lighter_levels(parts, parts))]


def supplied_levels(parts) -> list:
    """Return the lighter levels supplied with the parts."""
    count = supplied_level_count(parts)
    return [
        MeshLevel([q for p in parts for q in (p.supplied_levels or ((p,),) * count)[k]])
        for k in range(count)
    ]


def _levels_later(parts, pool) -> Future:
    """Return what will be the lighter levels of a mesh, simplified in a thread."""
    if supplied_level_count(parts):
        return pool.submit(supplied_levels, parts)
    # With actors of their own: those of the mesh are drawn meanwhile.
    copies = [part.with_mesh(part.mesh) for part in parts]
    return pool.submit(_lighter_levels, parts, copies)


def _lighter_levels(parts, copies) -> list:
    """Return lighter levels of parts, made from copies of them."""
    radius, weld = bounding_sphere(_points(parts))[1], Weldings()
    are_surfaces = [is_surface(part, weld) for part in copies]
    levels = [MeshLevel(list(copies)), *_with_whole_leaves(copies, are_surfaces, weld)]
    while (share := _share(levels[-1].triangles)) * levels[-1].triangles > _LIGHTEST:
        level = MeshLevel([lighter(p, share, weld) or p for p in levels[-1].parts])
        if level.triangles > share**0.5 * levels[-1].triangles:
            break
        levels.append(level)
    if all(are_surfaces):  # else images tell: twigs vanishing among leaves do not matter
        for level in levels[1:]:
            pairs = zip(copies, level.parts, strict=True)
            level.error = max(displacement(*pair, weld) for pair in pairs) / radius
    return [_fitted(parts, copies, level, weld) for level in levels[1:]]


def _with_whole_leaves(parts, surfaces, weld) -> list:
    """Return a level whose surfaces are simplified and foliage is not, if there are both."""
    if all(surfaces) or not any(surfaces):
        return []
    pairs = zip(parts, surfaces, strict=True)
    level = MeshLevel(
        [(is_bark and lighter(part, SHARE, weld)) or part for part, is_bark in pairs]
    )
    triangle_count = sum(part.mesh.n_cells for part in parts)
    return [level] if level.triangles < _WORTH_A_LEVEL * triangle_count else []


def _share(triangles) -> float:
    """Return the triangles of the next lighter level relative to this one."""
    return _HALF if _HALVED[0] < triangles <= _HALVED[1] else SHARE


def _points(parts) -> np.ndarray:
    return np.concatenate([p.mesh.points for p in parts])


def _fitted(parts, copies, level, weld) -> MeshLevel:
    fitted = []
    for part, copy, light in zip(parts, copies, level.parts, strict=True):
        fit = interpolated(copy, smoothed(copy, light, weld), weld)
        fitted.append(part if fit is copy else fit)
    return MeshLevel(fitted, level.error)


def _bake_level(levels, reference, tile) -> int:
    """Return the index of the lightest level that looks like the mesh at a tile's texels."""
    if any(p.supplied_levels for p in levels[0].parts):
        return 0  # supplied levels may be textured quads
    is_within_tile = reference.sizes <= max(tile, reference.sizes[0])
    errors = reference.meshes
    level_rows = (errors[f'mesh{i}'][is_within_tile] for i in range(1, len(levels)))
    looks_alike = [worst(mesh_needs(row)).mean(1).max() <= _ALIKE for row in level_rows]
    return int(np.argmin([*looks_alike, False]))


def _lightest_parts(levels):
    """Return the lightest parts to bake: surfaces may be simplified, foliage may not."""
    parts = list(levels[0].parts)
    for level in levels[1:]:
        for i, part in enumerate(level.parts):
            if part.alpha_cutoff is None and part.mesh.active_texture_coordinates is None:
                parts[i] = part
    return parts


def atlas_key(content, views, tile, half) -> str:
    """Return a hash of everything that an atlas depends on."""
    return key_of(content, views, tile, half)


def content_key(parts) -> str:
    """Return a hash of everything that images of a mesh show."""
    content_values = [VERSION, _turntable_of(parts)]
    supplied_parts = [q for p in parts for level in p.supplied_levels for q in level]
    for part in [*parts, *supplied_parts]:
        content_values += [part.alpha_cutoff, *_mesh_values(part.mesh), *look_values(part.actor)]
    return key_of(*content_values)


def _mesh_values(mesh):
    arrays = [np.asarray(mesh.points), np.asarray(mesh.regular_faces)]
    for data in (mesh.point_data, mesh.cell_data):
        for name in sorted(data.keys()):
            arrays += [name, np.ascontiguousarray(data[name])]
        arrays += [data.active_scalars_name, data.active_normals_name]
    return arrays


def look_values(actor) -> list:
    """Return the values of an actor's look that images show."""
    prop, mapper = actor.GetProperty(), actor.GetMapper()
    back_property = actor.GetBackfaceProperty()
    look_state = [list(prop.GetDiffuseColor()), prop.GetInterpolation(), prop.GetRepresentation()]
    look_state += [None if back_property is None else list(back_property.GetDiffuseColor())]
    look_state += [prop.GetShowTexturesOnBackface(), prop.GetBackfaceCulling()]
    look_state += [prop.GetFrontfaceCulling(), prop.GetOpacity()]
    look_state += [mapper.GetScalarVisibility(), mapper.GetScalarMode(), mapper.GetColorMode()]
    if mapper.GetScalarVisibility():
        look_state += [list(mapper.GetScalarRange()), mapper.GetInterpolateScalarsBeforeMapping()]
        look_state += [mapper.GetArrayName() or '', *_table_values(mapper.GetLookupTable())]
    look_state += [emission_of(actor)]
    for texture in textures_of(actor):
        image = texture.GetInput()
        if image is None:
            continue
        scalars = image.GetPointData().GetScalars()
        look_state += [list(image.GetDimensions()), _vtk.vtk_to_numpy(scalars)]
        look_state += [getattr(texture, f'Get{name}')() for name in TEXTURE_MODES]
        look_state += [list(texture.GetBorderColor()), *_table_values(texture.GetLookupTable())]
    return look_state


def _table_values(table):
    if table is None or not hasattr(table, 'GetTable'):
        return [str(table)] if table is not None else []
    colors = [
        list(c)
        for c in (table.GetNanColor(), table.GetBelowRangeColor(), table.GetAboveRangeColor())
    ]
    range_flags = [table.GetUseBelowRangeColor(), table.GetUseAboveRangeColor(), table.GetScale()]
    return [_vtk.vtk_to_numpy(table.GetTable()), list(table.GetRange()), colors, range_flags]
