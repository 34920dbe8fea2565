"""The materials of several surfaces as one: their colours and images side by side in an atlas.

Where two materials meet, texture coordinates differ: it is a seam, which no triangle crosses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.large.joined_meshes import joined
from pvibr.large.merging import as_drawn, merged_rows
from pvibr.maths.tones import to_display, to_light
from pvibr.meshes.materials import look_key
from pvibr.textures.projected import as_rgba
from pvibr.textures.sheet import LARGEST, shelves

#: Array of the colours of points or cells; names of this kind are taken for colours.
COLORS = 'material_rgb'
#: Texels around each image: what interpolation reads beyond its edges, and mip levels do.
_MARGIN = 8
#: Texels of an atlas at most, about; of an image with its repeats, else it has seams between them.
_TEXELS, _REPEATED = 1 << 27, 1 << 20
#: What lies beyond an edge of an image by rounding alone.
_ROUNDING = 1e-5
#: Keywords that the atlas replaces.
_SHOWN = (
    *('color', 'opacity', 'texture', 'alpha_cutoff', 'pbr_textures', 'emissive_factor'),
    *('metallic', 'roughness'),
)
_OWN = (*_SHOWN, 'scalars', 'rgb', 'preference')


@dataclass
class _Tile:
    """A place in the atlas."""

    #: Images by name, (h, w, 4) bytes, lowest row first.
    images: dict[str, np.ndarray]
    #: Numbers of repeats along both axes.
    repeats: np.ndarray
    #: Whether what an image shows beyond its edges is its other end.
    wraps: bool

    @property
    def size(self) -> np.ndarray:
        """Width and height of the largest image, with its repeats."""
        return np.max([i.shape[1::-1] for i in self.images.values()], 0) * self.repeats

    def drawn(self, name, size) -> np.ndarray:
        """Return an image of some size, with its repeats and a margin."""
        image = _resized(self.images[name], size // self.repeats)
        image = np.tile(image, (self.repeats[1], self.repeats[0], 1))
        around = [(_MARGIN, _MARGIN), (_MARGIN, _MARGIN), (0, 0)]
        return np.pad(image, around, 'wrap' if self.wraps else 'edge')


def with_atlas(surfaces) -> tuple[pv.DataSet, dict]:
    """Return surfaces of triangles, each with a look, as one with one look."""
    looks = [look for _, look in surfaces]
    physical = any(look.get('pbr') for look in looks)
    names = _map_names(looks, physical=physical)
    tiles: dict[tuple, _Tile] = {}
    meshes, keys, coordinates = [], [], []
    for mesh, look in surfaces:
        wraps = _has_image(mesh, look) and bool(_images_of(look)[0].GetRepeat())
        images = _images(mesh, look, names, physical=physical)
        mesh, own, repeats = _in_tiles(mesh, look, images, wraps=wraps)
        shown = look_key({name: look[name] for name in _SHOWN if name in look})
        key = shown, tuple(repeats), _has_image(mesh, look), bool(look.get('scalars'))
        tiles.setdefault(key, _Tile(images, repeats, wraps))
        meshes.append(mesh)
        keys.append(key)
        coordinates.append(own / repeats)
    mesh, shared = joined(_with_colors(meshes, looks)), common_look(looks)
    if COLORS in mesh.array_names:
        mesh.set_active_scalars(COLORS)
        shared['scalars'] = COLORS
    if len(tiles) == 1 and tiles[keys[0]].size.max() == 1:  # one colour, and no seams
        return mesh, shared | {name: looks[0][name] for name in _SHOWN if name in looks[0]}
    corners, sizes, atlas = _packed(list(tiles.values()), names)
    numbers = {key: k for k, key in enumerate(tiles)}
    total = np.array(atlas[names[0]].shape[1::-1], float)
    in_atlas = np.concatenate(
        [
            (corners[numbers[key]] + _MARGIN + own * sizes[numbers[key]]) / total
            for key, own in zip(keys, coordinates, strict=True)
        ]
    )
    mesh.active_texture_coordinates = as_drawn(in_atlas)
    return mesh, shared | _textures(atlas, looks)


def common_look(looks) -> dict:
    """Return what all looks have in common, beside colours and images."""
    look = {
        name: value
        for name, value in looks[0].items()
        if name not in _OWN and all(own.get(name) == value for own in looks[1:])
    }
    for name in ('smooth_shading', 'pbr'):
        if any(own.get(name) for own in looks):
            look[name] = True
    return look


def _images_of(look) -> list:
    """Return the textures of a look."""
    textures = [look.get('texture'), *look.get('pbr_textures', {}).values()]
    return [texture for texture in textures if texture is not None]


def _has_image(mesh, look) -> bool:
    return mesh.active_texture_coordinates is not None and bool(_images_of(look))


def _properties(look) -> tuple[float, float]:
    return look.get('roughness', 0.5), look.get('metallic', 0.0)


def _map_names(looks, *, physical) -> list[str]:
    """Return the names of the images of the atlas: the colour first, then maps of properties."""
    maps = {name for look in looks for name in look.get('pbr_textures', {})}
    if physical and len({_properties(look) for look in looks}) > 1:
        maps.add('materialTex')
    if any(look.get('emissive_factor') for look in looks):
        maps.add('emissiveTex')
    return ['albedoTex' if physical else 'texture', *sorted(maps - {'albedoTex'})]


def _images(mesh, look, names, *, physical) -> dict[str, np.ndarray]:
    """Return the images of a look: its own, or one texel of its colours and properties."""
    maps = look.get('pbr_textures', {}) | {names[0]: look.get('texture')}
    maps = {'albedoTex': look.get('pbr_textures', {}).get('albedoTex')} | maps
    if physical and maps[names[0]] is None:
        maps[names[0]] = look.get('pbr_textures', {}).get('albedoTex')
    is_plain = look.get('scalars') is None and maps[names[0]] is None
    theme = look.get('theme') or pv.global_theme
    color = pv.Color(look.get('color') or (theme.color if is_plain else 'white')).float_rgb
    factors = {
        names[0]: (*color, look.get('opacity', 1.0)),
        'materialTex': (1.0, *_properties(look), 1.0),
        'emissiveTex': (*look.get('emissive_factor', (0.0, 0.0, 0.0)), 1.0),
    }
    images = {}
    for name in names:
        texture = maps.get(name) if _has_image(mesh, look) else None
        if name == 'normalTex':
            plain = np.array([[(128, 128, 255, 255)]], np.uint8)
            images[name] = plain if texture is None else as_rgba(texture)[::-1]
            continue
        image = np.full((1, 1, 4), 255, np.uint8) if texture is None else as_rgba(texture)[::-1]
        is_linear = physical and name in ('albedoTex', 'emissiveTex')
        images[name] = _scaled(image, np.array(factors.get(name, (1.0,) * 4)), linear=is_linear)
    cutoff = look.get('alpha_cutoff')
    if cutoff is not None:  # that of all is a half
        image = images[names[0]].copy()
        alpha = image[..., 3] + 255 * (0.5 - cutoff * look.get('opacity', 1.0))
        image[..., 3] = np.clip(alpha, 0, 255)
        images[names[0]] = image
    return images


def _scaled(image, factor, *, linear) -> np.ndarray:
    """Return an image times a colour, which multiplies light if it is linear."""
    if (factor == 1).all():
        return image
    if linear:
        colors = np.arange(256) / 255
        light = to_light(colors)
        tables = [to_display(light * f) for f in factor[:3]] + [colors * factor[3]]
    else:
        tables = [np.arange(256) / 255 * f for f in factor]
    tables = np.rint(255 * np.clip(tables, 0, 1)).astype(np.uint8)
    return np.stack([table[image[..., k]] for k, table in enumerate(tables)], -1)


def _in_tiles(mesh, look, images, *, wraps) -> tuple[pv.PolyData, np.ndarray, np.ndarray]:
    """Return a surface, texture coordinates from 0, and how many images they reach over."""
    once = np.ones(2, int)
    if not _has_image(mesh, look):
        return mesh, np.full((mesh.n_points, 2), 0.5), once
    coordinates = np.nan_to_num(np.asarray(mesh.active_texture_coordinates)[:, :2].astype(float))
    if not wraps:
        return mesh, np.clip(coordinates, 0, 1), once
    low = np.floor(coordinates.min(0) + _ROUNDING)
    repeats = _counts(coordinates.max(0) - low)
    texels = max(image.shape[0] * image.shape[1] for image in images.values())
    if repeats.prod() > 1 and repeats.prod() * texels > _REPEATED:
        corners = coordinates[mesh.regular_faces]
        shifts = np.floor(corners.min(1) + _ROUNDING)
        own_repeats = _counts((corners.max(1) - shifts).max(0))
        if own_repeats.prod() < repeats.prod():
            mesh, points, shifts = _divided(mesh, shifts)
            return mesh, coordinates[points] - shifts, own_repeats
    return mesh, coordinates - low, repeats


def _counts(extents) -> np.ndarray:
    return np.maximum(np.ceil(extents - _ROUNDING), 1).astype(int)


def _divided(mesh, shifts) -> tuple[pv.PolyData, np.ndarray, np.ndarray]:
    """Return a surface with a point for each shift of its triangles; the points, and these."""
    corners = np.asarray(mesh.regular_faces).ravel()
    own = np.repeat(shifts, 3, axis=0).astype(np.int32)
    rows = np.column_stack([corners.astype(np.int32), own]).view(np.uint32)
    first, places = merged_rows(rows)
    points = corners[first]
    divided = pv.PolyData.from_regular_faces(mesh.points[points], places.reshape(-1, 3))
    for name in mesh.point_data:
        divided.point_data[name] = np.asarray(mesh.point_data[name])[points]
    divided.point_data.active_normals_name = mesh.point_data.active_normals_name
    for name in mesh.cell_data:
        divided.cell_data[name] = mesh.cell_data[name]
    return divided, points, own[first]


def _with_colors(meshes, looks) -> list[pv.PolyData]:
    """Return surfaces with colours of their points, or of cells if all have these, else white."""
    if not any(look.get('scalars') for look in looks):
        return meshes
    on_cells = all(look.get('preference') == 'cell' for look in looks if look.get('scalars'))
    colors = []
    for mesh, look in zip(meshes, looks, strict=True):
        name = look.get('scalars')
        if name and not on_cells and name not in mesh.point_data:
            mesh = mesh.cell_data_to_point_data()
        data = mesh.cell_data if on_cells else mesh.point_data
        count = mesh.n_cells if on_cells else mesh.n_points
        colors.append(np.asarray(data[name]) if name else np.full((count, 3), 255, np.uint8))
    channels = max(own.shape[1] for own in colors)
    colored = []
    for mesh, look, own in zip(meshes, looks, colors, strict=True):
        mesh = mesh.copy(deep=False)
        if look.get('scalars'):
            (mesh.cell_data if look.get('preference') == 'cell' else mesh.point_data).remove(
                look['scalars']
            )
        alpha = np.full((len(own), channels - own.shape[1]), 255, np.uint8)
        (mesh.cell_data if on_cells else mesh.point_data)[COLORS] = np.column_stack([own, alpha])
        colored.append(mesh)
    return colored


def _packed(tiles, names) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return the corners and sizes of tiles in an atlas, and its images."""
    sizes, repeats = (np.array([getattr(t, name) for t in tiles]) for name in ('size', 'repeats'))
    scale = min(np.sqrt(_TEXELS / sizes.prod(1).sum()), 1.0)
    while True:
        own = np.maximum((sizes * scale / repeats).astype(int), 1) * repeats
        try:
            corners, (width, height) = shelves(own + 2 * _MARGIN, LARGEST)
            break
        except ValueError:
            scale *= 0.8
    atlas = {name: np.full((height, width, 4), 255, np.uint8) for name in names}
    for tile, (x, y), size in zip(tiles, corners, own, strict=True):
        for name, image in atlas.items():
            drawn = tile.drawn(name, size)
            image[y : y + drawn.shape[0], x : x + drawn.shape[1]] = drawn
    return corners, own, atlas


def _resized(image, size) -> np.ndarray:
    """Return an image of some width and height."""
    if image.shape[1::-1] == tuple(size):
        return image
    if image.shape[:2] == (1, 1):
        return np.broadcast_to(image, (size[1], size[0], 4))
    from PIL import Image  # only images of several sizes, or too large ones, need it

    return np.asarray(Image.fromarray(image).resize(tuple(size), Image.Resampling.BOX))


def _modes(looks) -> tuple[bool, bool]:
    """Return whether any texture is interpolated, and whether any has mip levels."""
    textures = [texture for look in looks for texture in _images_of(look)]
    return any(t.GetInterpolate() for t in textures), any(t.GetMipmap() for t in textures)


def _textures(atlas, looks) -> dict:
    """Return the keywords of `add_mesh` that show an atlas."""
    textures = {}
    for name, image in atlas.items():
        is_opaque = (image[..., 3] == 255).all() or name not in ('texture', 'albedoTex')
        pixels = np.ascontiguousarray(image[::-1, :, : 3 if is_opaque else 4])
        textures[name] = pv.Texture(pixels)
        textures[name].interpolate, textures[name].mipmap = _modes(looks)
        textures[name].wrap = pv.Texture.WrapType.CLAMP_TO_EDGE
    look: dict = {'color': 'white'}
    if 'texture' in textures:
        look['texture'] = textures.pop('texture')
    if textures:
        look['pbr_textures'] = textures
    if 'emissiveTex' in textures:
        look['emissive_factor'] = (1.0, 1.0, 1.0)
    if 'materialTex' in textures:
        look |= {'metallic': 1.0, 'roughness': 1.0}
    elif 'albedoTex' in textures:
        look |= dict(zip(('roughness', 'metallic'), _properties(looks[0]), strict=True))
    if any(own.get('alpha_cutoff') is not None for own in looks):
        look['alpha_cutoff'] = 0.5
    return look
