"""Materials of a glTF file as keywords of ``add_mesh``."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from pvibr.animation.gltf.pictures import Pictures
from pvibr.formats.gltf_file import GltfFile, follow
from pvibr.formats.gltf_schema import Material, Metallic
from pvibr.maths.tones import to_display

#: Name of the array of vertex colours.
COLORS = 'gltf_colors'
_SRGB = ('base_color_texture', 'emissive_texture')
#: VTK's texture names by those of glTF.
_VTK = {
    'base_color_texture': 'albedoTex',
    'metallic_roughness_texture': 'materialTex',
    'occlusion_texture': 'materialTex',
    'emissive_texture': 'emissiveTex',
    'normal_texture': 'normalTex',
}
#: Textures that are shown with any shading.
_ALWAYS = ('base_color_texture', 'emissive_texture', 'normal_texture')
#: Channels of a texture in use; the others are set to 1.
_CHANNELS = {'metallic_roughness_texture': 'GB', 'occlusion_texture': 'R'}


class Looks:
    """The materials and textures of a file, each read once."""

    def __init__(self, file: GltfFile, pbr):
        self._file, self._pbr = file, pbr
        self._pictures = Pictures(file)

    def material(self, index, place) -> Material:
        """Return a material."""
        if index is None:
            return Material()
        material = follow(self._file.document.materials, index, place, 'materials')
        older = material.extensions.specular_glossiness
        if older is None:
            return material
        if self._pbr:
            self._file.leave_out('specular colours', f'materials[{index}]')
        surface = Metallic(
            base_color_factor=older.diffuse_factor,
            base_color_texture=older.diffuse_texture,
            metallic_factor=0.0,
            roughness_factor=1.0 - older.glossiness_factor,
        )
        return msgspec.structs.replace(material, pbr_metallic_roughness=surface)

    def look(self, material, place, surface):
        """Return the keywords for ``add_mesh`` of a surface."""
        look: dict[str, Any] = {} if surface.wires else {'smooth_shading': True}
        used = self._used(material, surface.tiles) if surface.coordinates else {}
        look |= _physical(material) if self._is_physical(material) else {}
        shines = _only_shines(material) and 'emissive_texture' not in used
        look |= _maps(material, used, 'pbr' in look, shines)
        if surface.colors:
            look |= {'scalars': COLORS, 'rgb': True, 'preference': 'point'}
        else:
            # VTK expects linear colours with physically based shading.
            look['color'] = _color(material, shines, linear='pbr' in look)
            look |= _opacity(material)
        if material.extensions.unlit is not None or shines or (surface.wires and not surface.lit):
            look['lighting'] = False
        if material.alpha_mode == 'MASK':
            look |= _mask(material, 1.0 if surface.colors else _alpha(material))
        if not material.double_sided and not surface.wires:
            look['culling'] = 'back'
        self._leave_out(material, place, used)
        return look

    def vertex_colors(self, material, colors):
        """Return vertex colours multiplied by the material's colour."""
        shown = (255 * self._shown(material, colors) + 0.5).astype(np.uint8)
        # With an alpha channel VTK would sort the mesh as translucent.
        opaque = material.alpha_mode == 'OPAQUE' or (shown[:, 3] == 255).all()
        return np.ascontiguousarray(shown[:, :3]) if opaque else shown

    def color_difference(self, material, colors, difference):
        """Return the change of displayed colours by a morph target."""
        moved = _with_alpha(colors, 1.0) + _with_alpha(difference, 0.0)
        change = self._shown(material, moved) - self._shown(material, colors)
        return change.astype(np.float32)

    def _shown(self, material, colors):
        factor = np.array(material.pbr_metallic_roughness.base_color_factor)
        light = np.clip(_with_alpha(colors, 1.0) * factor, 0, 1)
        if self._is_physical(material):  # VTK expects linear colours
            return light
        return np.column_stack([to_display(light[:, :3]), light[:, 3]])

    def coordinates(self, material):
        """Return the index of the texture coordinates in use, and their transform (2, 3)."""
        return _coordinates(self._first_info(material))

    def tiles(self, material, coordinates):
        """Return the :class:`Tiles` that the textures need for coordinates (n, 2), or None."""
        info = self._first_info(material)
        return None if info is None else self._pictures.tiles(info, coordinates)

    def _first_info(self, material):
        """Return the texture whose coordinates are those of the mesh, or None."""
        return next((i for i in self._infos(material).values() if i is not None), None)

    def _is_physical(self, material):
        # VTK does not sort surfaces that only the alpha of such a texture makes translucent.
        blended = material.alpha_mode == 'BLEND'
        textured = material.pbr_metallic_roughness.base_color_texture is not None
        return self._pbr and material.extensions.unlit is None and not (blended and textured)

    def _infos(self, material):
        """Return the references to textures that the shading shows, by their glTF names."""
        infos = _references(material)
        if self._is_physical(material):
            return infos
        shown = _ALWAYS if material.extensions.unlit is None else _ALWAYS[:1]
        return {name: infos[name] for name in shown}

    def _used(self, material, tiles):
        """Return the textures that are shown by their glTF names."""
        found = {}
        where = self.coordinates(material)
        infos = self._infos(material)
        physical = self._is_physical(material)
        both = _same_image(
            *(infos.get(f'{n}_texture') for n in ('metallic_roughness', 'occlusion'))
        )
        for name, info in infos.items():
            if info is None or not _alike(_coordinates(info), where):
                continue  # a mesh has one set of texture coordinates
            opaque = material.alpha_mode == 'OPAQUE' or name != 'base_color_texture'
            channels = 'RGB' if both else _CHANNELS.get(name, 'RGB')
            if name == 'occlusion_texture' and not both and 'metallic_roughness_texture' in found:
                continue  # VTK reads both from one image
            srgb = name in _SRGB and (physical or name == 'emissive_texture')
            texture = self._pictures.texture(info, opaque, srgb, channels, tiles)
            if texture is not None:
                found[name] = texture
        return found

    def _leave_out(self, material, place, used):
        if self._pbr and not self._is_physical(material) and material.extensions.unlit is None:
            self._file.leave_out('physically based shading of glass', f'{place}.material')
        for name, info in _references(material).items():
            if info is not None and name not in used and name != 'base_color_texture':
                self._file.leave_out(name.replace('_', ' '), f'{place}.material')


def _references(material):
    """Return all references to textures by their glTF names."""
    metallic = material.pbr_metallic_roughness
    return {
        'base_color_texture': metallic.base_color_texture,
        'metallic_roughness_texture': metallic.metallic_roughness_texture,
        'occlusion_texture': material.occlusion_texture,
        'emissive_texture': material.emissive_texture,
        'normal_texture': material.normal_texture,
    }


def _physical(material):
    """Return the keywords of physically based shading."""
    metallic = material.pbr_metallic_roughness
    return {
        'pbr': True,
        'metallic': _share(metallic.metallic_factor),
        'roughness': _share(metallic.roughness_factor),
    }


def _maps(material, textures, physical, shines):
    """Return the keywords of textures and of emitted light, unless it is all that is shown."""
    look: dict[str, Any] = {}
    if not physical and 'base_color_texture' in textures:
        look['texture'] = textures['base_color_texture']
    used = textures if physical else textures.keys() - {'base_color_texture'}
    if used:
        look['pbr_textures'] = {_VTK[name]: textures[name] for name in used}
    dark = not any(material.emissive_factor) or material.extensions.unlit is not None
    if not (dark or shines):
        strength = material.extensions.emissive.emissive_strength
        look['emissive_factor'] = tuple(strength * x for x in material.emissive_factor)
    return look


def _coordinates(info):
    """Return the index of the texture coordinates of a texture, and their transform."""
    flip = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])
    if info is None:
        return 0, flip
    transform = info.extensions.transform
    if transform is None:
        return info.tex_coord, flip
    c, s = math.cos(transform.rotation), math.sin(transform.rotation)
    (sx, sy), (tx, ty) = transform.scale, transform.offset
    matrix = np.array([[c * sx, s * sy, tx], [-s * sx, c * sy, ty], [0.0, 0.0, 1.0]])
    number = info.tex_coord if transform.tex_coord is None else transform.tex_coord
    return number, flip @ matrix


def _alike(a, b):
    return a[0] == b[0] and np.array_equal(a[1], b[1])


def _same_image(a, b):
    return a is not None and b is not None and a.index == b.index


def _only_shines(material):
    """Return True if a material emits light and reflects none."""
    black = not any(material.pbr_metallic_roughness.base_color_factor[:3])
    return black and any(material.emissive_factor)


def _with_alpha(colors, alpha):
    """Return colours with four channels, float64."""
    rgba = np.full((len(colors), 4), alpha)
    rgba[:, : colors.shape[1]] = colors
    return rgba


def _color(material, shines, linear):
    """Return the colour of a surface, linear or for display."""
    light = np.array(material.pbr_metallic_roughness.base_color_factor[:3])
    if shines:
        light = np.array(material.emissive_factor)
        light = light * material.extensions.emissive.emissive_strength
    return tuple(np.clip(light if linear else to_display(light), 0, 1).round(9).tolist())


def _share(value):
    return min(max(value, 0.0), 1.0)


def _alpha(material):
    return _share(material.pbr_metallic_roughness.base_color_factor[3])


def _opacity(material):
    alpha = _alpha(material)
    return {'opacity': alpha} if material.alpha_mode == 'BLEND' and alpha < 1 else {}


def _mask(material, alpha):
    """Return how a mask shows textures whose alpha is multiplied by a factor: opaque or not."""
    if material.alpha_cutoff > alpha:
        return {'opacity': 0.0}
    return {'alpha_cutoff': material.alpha_cutoff / (alpha or 1.0)}
