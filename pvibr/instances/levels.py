"""Levels of detail of one mesh, and the sizes at which they change."""

from __future__ import annotations

import time
import weakref
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.progress import baking
from pvibr.instances.atlas import Atlas, bounding_sphere
from pvibr.instances.bake import bake_parts, check_grid
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.instances.limits import SIDES, Limits, by_cost, cast, limits_of
from pvibr.instances.measure import Reference, measure, mesh_needs, worst
from pvibr.instances.memory import bytes_of, tiles
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.instances.stored_levels import from_arrays, to_arrays
from pvibr.instances.worth import why_not
from pvibr.maths.hulls import hull_corners
from pvibr.meshes.decimate import displacement, is_surface, lighter
from pvibr.meshes.maps import emission_of
from pvibr.meshes.materials import TEXTURE_MODES
from pvibr.meshes.parts import as_parts, check_triangles
from pvibr.meshes.smoothed import interpolated, smoothed
from pvibr.scene.content_key import textures_of

VERSION = 53  # of what is kept in the cache: a change of bake, measure or decimation raises it
SHARE = 0.25  # of a level's triangles, in the next lighter
#: The same of levels of so many triangles, which are most of what frames draw.
_HALF, _HALVED = 0.5, (2_500, 40_000)
_ALIKE = 0.5  # of what is allowed of lighter meshes: views are taken of what has no more
_LIGHTEST = 150  # triangles of the lightest level, at least
_WORTH_A_LEVEL = 0.8  # of a mesh's triangles: what has more saves hardly anything
#: Views along a side of the grid, and texels along that of one: what is magnified is blurred, and
#: fewer views serve to smaller sizes; cut-outs are of details that neighbouring views mix up.
_GRID, _CUT_GRID = (24, 128), (16, 128)
_ROUNDING = 1e-9  # of a mesh's size, by which the bounds of its hull may differ from its own
# Those in use, by their content: sets of the same mesh share one, and its textures.
_atlases: weakref.WeakValueDictionary[str, Atlas] = weakref.WeakValueDictionary()


@dataclass
class LodModel:
    """A mesh, its lighter levels (the mesh first), and the atlas of its pictures."""

    levels: list
    atlas: Atlas
    #: Why it has no pictures, empty if it has.
    unbaked: str = ''
    #: Bytes of room on the GPU with which it may have some.
    needs: float = 0.0
    #: What is to be said of its tiles.
    note: str = ''
    #: Colour shown in place of that in the pictures, and 1; or zeros.
    paint: tuple = (0.0, 0.0, 0.0, 0.0)
    _limits: dict = field(default_factory=dict)

    @cached_property
    def corners(self) -> np.ndarray:
        """Points on the convex hull of the mesh, model coordinates."""
        return hull_corners(_drawn_points(self.levels[0].parts))

    def limits(self, max_error) -> Limits:
        """Return the sizes at which levels change, for a greatest error in pixels."""
        if max_error not in self._limits:
            accurate = limits_of(self.atlas.errors, len(self.levels), max_error)
            self._limits[max_error] = by_cost(accurate, [level.triangles for level in self.levels])
        return self._limits[max_error]

    def cast_limits(self, max_error, aspect) -> Limits:
        """Return the same for depth maps, by the long side of their texels."""
        found, triangles = self.limits(max_error), [level.triangles for level in self.levels]
        errors = self.atlas.errors
        return cast(found, errors, triangles, max_error, aspect) if errors else found

    def describe(self, limits) -> str:
        """Return views, bake time and the sizes at which levels change, in one line."""
        a = self.atlas
        if self.unbaked:
            return f'{self.levels[0].triangles} triangles at any size, not baked: {self.unbaked}'
        sides = {f'{n} from the side': span for n, span in limits.level.items() if n in SIDES}
        cards = [
            f'{name} to {_between(high)} px'
            for name, (low, high) in (sides | limits.cards).items()
            if (high > low).any()
        ]
        meshes = [
            f'{level.triangles} triangles '
            + (f'to {_between(sizes)} px' if sizes.max() < 1e5 else 'at any size')
            for level, sizes in zip(self.levels[::-1], limits.meshes[::-1], strict=True)
            if (sizes > limits.mesh).any()
        ]
        head = f'{a.views} x {a.views} views of {a.tile} texels{self.note}'
        head += f', baked in {a.seconds:.1f} s'
        if a.animated:
            head = f'{a.n_poses} poses of {head}'
        return '; '.join([head, *cards, *meshes])


def _between(sizes) -> str:
    """Return the least and the greatest of the sizes, or both as one."""
    ends = f'{sizes.min():.0f}', f'{sizes.max():.0f}'
    return ends[0] if ends[0] == ends[1] else ' to '.join(ends)


def bake(mesh, *, views=None, tile=None, half=False, cache=True, progress=None, **looks) -> Atlas:
    """Return the atlas of a mesh, with its error measured."""
    parts = as_parts(mesh, **looks)
    check_triangles(parts)
    grid = {'views': views, 'tile': tile, 'half': half}
    return make_model(parts, cache=cache, progress=progress, **grid).atlas


def make_model(
    parts, *, count=None, room=None, half=False, cache=True, progress=None, views=None, tile=None
) -> LodModel:
    """Return the levels of a mesh, baked and measured, or cached."""
    # With a count of instances it is baked only if that pays; with room, bytes on the GPU, its
    # tiles shrink until they fit.
    if why := no_images(parts, count):
        return unbaked(parts, why)
    own = _grid(parts)
    views, tile = own[0] if views is None else views, own[1] if tile is None else tile
    check_grid(views, tile)
    store = None if cache is False else AtlasCache(None if cache is True else cache)
    content = None if store is None else content_key(parts)
    size = tile if room is None else _fitting(content, views, tile, half, room)
    if not size:
        why = 'GPU memory for images is at its limit'
        return unbaked(parts, why, needs=bytes_of(views, min(tiles(tile))))
    key = '' if store is None else atlas_key(content, views, size, half)
    found = store.load(key, lambda arrays: _read(parts, arrays)) if store is not None else None
    if found is not None:
        found.atlas = _atlases.setdefault(key, found.atlas)
    else:
        found = _new_model(parts, store, key, progress, views=views, tile=size, half=half)
    if size < tile:
        found.note = f', not {tile}, as GPU memory is limited'
    return found


def _grid(parts) -> tuple[int, int]:
    """Return the views along a side of the grid and the texels along that of one."""
    cut = any(p.alpha_cutoff is not None or p.stand_ins for p in parts)
    return _CUT_GRID if cut or _turns(parts) is not None else _GRID


def _fitting(content, views, tile, half, room) -> int:
    """Return the largest size of tiles for which there is room, 0 if none is large enough."""

    def fits(size):
        held = content is not None and atlas_key(content, views, size, half) in _atlases
        return held or bytes_of(views, size) <= room

    return next(filter(fits, tiles(tile)), 0)


def _new_model(parts, store, key, progress, **grid) -> LodModel:
    """Bake and measure; meshes alone are left where the driver fails."""
    try:
        model = _baked(_levels(parts), progress, **grid)
    except RuntimeError as error:
        warn(
            f'cards are off, meshes are drawn instead: {error}. Look at `pvibr doctor`, or update '
            'the graphics driver.'
        )
        return unbaked(parts, str(error) or 'the bake failed', needs=np.inf)
    if store is not None:
        kept = {} if given(parts) else to_arrays(model.levels)
        store.put(key, model.atlas.to_arrays() | kept | {'corners': model.corners})
        _atlases[key] = model.atlas
    return model


def _read(parts, arrays) -> LodModel:
    """Return a model from arrays of the cache, checked."""
    levels = _levels(parts) if given(parts) else from_arrays(parts, arrays)
    model = LodModel(levels, Atlas.from_arrays(arrays))
    if not model.atlas.errors:
        raise ValueError('it has no errors of levels')
    model.limits(1.0)
    model.corners = _checked_corners(parts, np.asarray(arrays['corners'], float))
    return model


def _checked_corners(parts, corners) -> np.ndarray:
    """Return points that are to be those on the convex hull of a mesh."""
    points = _drawn_points(parts)
    # A hull leaves out points that lie beyond its faces by rounding errors.
    room = _ROUNDING * np.ptp(points, axis=0).max()
    if corners.ndim != 2 or not np.allclose(_ends(corners), _ends(points), rtol=0, atol=room):
        raise ValueError('its corners are not those of the mesh')
    return corners


def _drawn_points(parts) -> np.ndarray:
    return np.concatenate([np.asarray(part.drawn_points(), float) for part in parts])


def _ends(points):
    return np.stack([points.min(0), points.max(0)])


def no_images(parts, count=None) -> str:
    """Return why parts have no images, or need none for a `count` of instances; else nothing."""
    why = next((part.ineligibility for part in parts if part.ineligibility), '')
    if not why and count is not None and _turns(parts) is None:
        why = why_not(MeshLevel(parts).triangles, count)
    return why


def unbaked(parts, why, needs=0.0) -> LodModel:
    """Return a mesh without pictures, drawn as it is at every size."""
    blank = Atlas.blank(_points(parts))
    return LodModel([MeshLevel(list(parts))], blank, why, needs)


def _baked(levels, progress, **grid):
    start = time.perf_counter()
    turns = _turns(levels[0].parts)
    model = LodModel(levels, Atlas.blank(_points(levels[0].parts), half=grid['half']))
    sphere = model.atlas.center, model.atlas.radius
    with baking(progress) as advance:
        reference = Reference(model, progress=lambda d: advance(d / 3))
        shown = _bake_parts(levels[: _bake_level(levels, reference, grid['tile']) + 1])
        model.atlas = atlas = bake_parts(
            shown, sphere=sphere, turns=turns, progress=lambda d: advance((1 + d) / 3), **grid
        )
        atlas.errors = measure(model, lambda d: advance((2 + d) / 3), reference)
    atlas.seconds = time.perf_counter() - start
    return model


def _turns(parts):
    """Return the turntable views asked for, or None."""
    return next((p.turns for p in parts if p.turns is not None), None)


def given(parts) -> int:
    """Return the number of lighter levels that come with the parts."""
    return max(len(p.stand_ins) for p in parts)


def _levels(parts):
    levels = [MeshLevel(list(parts))]
    if count := given(parts):
        coarser = [
            [q for p in parts for q in (p.stand_ins or ((p,),) * count)[k]] for k in range(count)
        ]
        return levels + [MeshLevel(level) for level in coarser]
    return levels + _lighter_levels(parts)


def _lighter_levels(parts) -> list:
    radius, surfaces = bounding_sphere(_points(parts))[1], [is_surface(part) for part in parts]
    levels = [MeshLevel(list(parts)), *_with_whole_leaves(parts, surfaces)]
    while (share := _share(levels[-1].triangles)) * levels[-1].triangles > _LIGHTEST:
        level = MeshLevel([lighter(p, share) or p for p in levels[-1].parts])
        if level.triangles > share**0.5 * levels[-1].triangles:
            break
        levels.append(level)
    if all(surfaces):  # else pictures tell: twigs that vanish within leaves are not missed
        for level in levels[1:]:
            pairs = zip(parts, level.parts, strict=True)
            level.error = max(displacement(*pair) for pair in pairs) / radius
    return [_fitted(parts, level) for level in levels[1:]]


def _with_whole_leaves(parts, surfaces) -> list:
    """Return the level of parts of which bark is simplified and leaves are not, if they differ."""
    if all(surfaces) or not any(surfaces):
        return []
    pairs = zip(parts, surfaces, strict=True)
    level = MeshLevel([lighter(part, SHARE) or part if bark else part for part, bark in pairs])
    total = sum(part.mesh.n_cells for part in parts)
    return [level] if level.triangles < _WORTH_A_LEVEL * total else []


def _share(triangles) -> float:
    """Return the share of a level's triangles that the next lighter one has."""
    return _HALF if _HALVED[0] < triangles <= _HALVED[1] else SHARE


def _points(parts) -> np.ndarray:
    return np.concatenate([p.mesh.points for p in parts])


def _fitted(parts, level) -> MeshLevel:
    pairs = zip(parts, level.parts, strict=True)
    fitted = [interpolated(part, smoothed(part, light)) for part, light in pairs]
    return MeshLevel(fitted, level.error)


def _bake_level(levels, reference, tile) -> int:
    """Return the index of the lightest level that tiles of some texels show as the mesh."""
    if any(p.stand_ins for p in levels[0].parts):
        return 0  # quads with pictures are no place to take pictures from
    shown = reference.sizes <= max(tile, reference.sizes[0])
    rows = (reference.meshes[f'mesh{i}'][shown] for i in range(1, len(levels)))
    alike = [worst(mesh_needs(row)).mean(1).max() <= _ALIKE for row in rows]
    return int(np.argmin([*alike, False]))


def _bake_parts(levels):
    """Return the lightest parts to bake: surfaces may be simplified, foliage not."""
    out = list(levels[0].parts)
    for level in levels[1:]:
        for i, part in enumerate(level.parts):
            if part.alpha_cutoff is None and part.mesh.active_texture_coordinates is None:
                out[i] = part
    return out


def atlas_key(content, views, tile, half) -> str:
    """Return a hash of everything that the atlas of a mesh depends on."""
    return key_of(content, views, tile, half)


def content_key(parts) -> str:
    """Return a hash of what images of a mesh show."""
    values = [VERSION, _turns(parts)]
    stand_ins = [q for p in parts for level in p.stand_ins for q in level]
    for part in [*parts, *stand_ins]:
        values += [part.alpha_cutoff, *_mesh_values(part.mesh), *look_values(part.actor)]
    return key_of(*values)


def _mesh_values(mesh):
    arrays = [np.asarray(mesh.points), np.asarray(mesh.regular_faces)]
    for data in (mesh.point_data, mesh.cell_data):
        for name in sorted(data.keys()):
            arrays += [name, np.ascontiguousarray(data[name])]
        arrays += [data.active_scalars_name, data.active_normals_name]
    return arrays


def look_values(actor) -> list:
    """Return the values of an actor's look that its atlas depends on."""
    prop, mapper = actor.GetProperty(), actor.GetMapper()
    back = actor.GetBackfaceProperty()
    values = [list(prop.GetDiffuseColor()), prop.GetInterpolation(), prop.GetRepresentation()]
    values += [None if back is None else list(back.GetDiffuseColor())]
    values += [prop.GetShowTexturesOnBackface(), prop.GetBackfaceCulling()]
    values += [prop.GetFrontfaceCulling(), prop.GetOpacity()]
    values += [mapper.GetScalarVisibility(), mapper.GetScalarMode(), mapper.GetColorMode()]
    if mapper.GetScalarVisibility():
        values += [list(mapper.GetScalarRange()), mapper.GetInterpolateScalarsBeforeMapping()]
        values += [mapper.GetArrayName() or '', *_table_values(mapper.GetLookupTable())]
    values += [emission_of(actor)]
    for texture in textures_of(actor):
        image = texture.GetInput()
        if image is None:
            continue
        scalars = image.GetPointData().GetScalars()
        values += [list(image.GetDimensions()), _vtk.vtk_to_numpy(scalars)]
        values += [getattr(texture, f'Get{name}')() for name in TEXTURE_MODES]
        values += [list(texture.GetBorderColor()), *_table_values(texture.GetLookupTable())]
    return values


def _table_values(table):
    if table is None or not hasattr(table, 'GetTable'):
        return [str(table)] if table is not None else []
    colors = [
        list(c)
        for c in (table.GetNanColor(), table.GetBelowRangeColor(), table.GetAboveRangeColor())
    ]
    flags = [table.GetUseBelowRangeColor(), table.GetUseAboveRangeColor(), table.GetScale()]
    return [_vtk.vtk_to_numpy(table.GetTable()), list(table.GetRange()), colors, flags]
