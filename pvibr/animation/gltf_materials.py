"""Materials of a glTF file as keywords of ``add_mesh``."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from pvibr.animation.gltf_images import Pictures
from pvibr.io.gltf_file import GltfFile, follow
from pvibr.io.gltf_schema import Material, Metallic
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
_METAL = 'metallic_roughness_texture'
_CHANNELS = {_METAL: 'GB', 'occlusion_texture': 'R'}


class Looks:
    """The materials and textures of a file, each read once."""

    def __init__(self, gltf_file: GltfFile, pbr):
        self._file, self._pbr = gltf_file, pbr
        self._pictures = Pictures(gltf_file)

    def material(self, material_index, json_path) -> Material:
        """Return a material."""
        if material_index is None:
            return Material()
        material = follow(self._file.document.materials, material_index, json_path, 'materials')
        specular_glossiness = material.extensions.specular_glossiness
        if specular_glossiness is None:
            return material
        if self._pbr:
            self._file.leave_out('specular colours', f'materials[{material_index}]')
        surface = Metallic(
            base_color_factor=specular_glossiness.diffuse_factor,
            base_color_texture=specular_glossiness.diffuse_texture,
            metallic_factor=0.0,
            roughness_factor=1.0 - specular_glossiness.glossiness_factor,
        )
        return msgspec.structs.replace(material, pbr_metallic_roughness=surface)

    def look(self, material, json_path, surface):
        """Return the keywords for ``add_mesh`` of a surface."""
        look: dict[str, Any] = {} if surface.wires else {'smooth_shading': True}
        textures = self._active_textures(material, surface.tiles) if surface.coordinates else {}
        look |= _physical(material) if self._is_physical(material) else {}
        only_emits = _only_emits(material) and 'emissive_texture' not in textures
        look |= _maps(material, textures, 'pbr' in look, only_emits)
        if surface.colors:
            look |= {'scalars': COLORS, 'rgb': True, 'preference': 'point'}
        else:
            # VTK expects linear colours with physically based shading.
            look['color'] = _color(material, only_emits, linear='pbr' in look)
            look |= _opacity(material)
        is_unlit = material.extensions.unlit is not None or only_emits
        if is_unlit or (surface.wires and not surface.lit):
            look['lighting'] = False
        if material.alpha_mode == 'MASK':
            look |= _mask(material, 1.0 if surface.colors else _alpha(material))
        if not material.double_sided and not surface.wires:
            look['culling'] = 'back'
        self._leave_out(material, json_path, textures)
        return look

    def vertex_colors(self, material, colors):
        """Return vertex colours multiplied by the material's colour."""
        display_colors = (255 * self._shown_colors(material, colors) + 0.5).astype(np.uint8)
        # With an alpha channel VTK would sort the mesh as translucent.
        is_opaque = material.alpha_mode == 'OPAQUE' or (display_colors[:, 3] == 255).all()
        return np.ascontiguousarray(display_colors[:, :3]) if is_opaque else display_colors

    def color_difference(self, material, colors, difference):
        """Return the change of displayed colours by a morph target."""
        morphed = _with_alpha(colors, 1.0) + _with_alpha(difference, 0.0)
        change = self._shown_colors(material, morphed) - self._shown_colors(material, colors)
        return change.astype(np.float32)

    def _shown_colors(self, material, colors):
        base_color = np.array(material.pbr_metallic_roughness.base_color_factor)
        linear_colors = np.clip(_with_alpha(colors, 1.0) * base_color, 0, 1)
        if self._is_physical(material):  # VTK expects linear colours
            return linear_colors
        return np.column_stack([to_display(linear_colors[:, :3]), linear_colors[:, 3]])

    def coordinates(self, material):
        """Return the index of the texture coordinates in use, and their transform (2, 3)."""
        return _coordinates(self._first_info(material))

    def tiles(self, material, coordinates):
        """Return the :class:`Tiles` that the textures need for coordinates (n, 2), or None."""
        texture_info = self._first_info(material)
        return None if texture_info is None else self._pictures.tiles(texture_info, coordinates)

    def _first_info(self, material):
        """Return the texture whose coordinates are those of the mesh, or None."""
        return next((i for i in self._texture_infos(material).values() if i is not None), None)

    def _is_physical(self, material):
        # VTK does not sort surfaces that only the alpha of such a texture makes translucent.
        is_blended = material.alpha_mode == 'BLEND'
        has_texture = material.pbr_metallic_roughness.base_color_texture is not None
        return self._pbr and material.extensions.unlit is None and not (is_blended and has_texture)

    def _texture_infos(self, material):
        """Return the references to textures that the shading shows, by their glTF names."""
        texture_infos = _references(material)
        if self._is_physical(material):
            return texture_infos
        visible_names = _ALWAYS if material.extensions.unlit is None else _ALWAYS[:1]
        return {name: texture_infos[name] for name in visible_names}

    def _active_textures(self, material, tiles):
        """Return the textures that are shown by their glTF names."""
        active_textures = {}
        mesh_coordinates = self.coordinates(material)
        infos = self._texture_infos(material)
        is_physical = self._is_physical(material)
        is_shared = _same_image(*map(infos.get, _CHANNELS))
        for name, info in infos.items():
            if info is None or not _alike(_coordinates(info), mesh_coordinates):
                continue  # a mesh has one set of texture coordinates
            is_opaque = material.alpha_mode == 'OPAQUE' or name != 'base_color_texture'
            channels = 'RGB' if is_shared else _CHANNELS.get(name, 'RGB')
            if name == 'occlusion_texture' and not is_shared and _METAL in active_textures:
                continue  # VTK reads both from one image
            is_srgb = name in _SRGB and (is_physical or name == 'emissive_texture')
            texture = self._pictures.texture(info, is_opaque, is_srgb, channels, tiles)
            if texture is not None:
                active_textures[name] = texture
        return active_textures

    def _leave_out(self, material, json_path, active_textures):
        if self._pbr and not self._is_physical(material) and material.extensions.unlit is None:
            self._file.leave_out('physically based shading of glass', f'{json_path}.material')
        for name, texture_info in _references(material).items():
            is_optional = texture_info is not None and name != 'base_color_texture'
            if is_optional and name not in active_textures:
                self._file.leave_out(name.replace('_', ' '), f'{json_path}.material')


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


def _maps(material, textures, is_physical, only_emits):
    """Return the keywords of textures and of emitted light, unless it is all that is shown."""
    look: dict[str, Any] = {}
    if not is_physical and 'base_color_texture' in textures:
        look['texture'] = textures['base_color_texture']
    pbr_names = textures if is_physical else textures.keys() - {'base_color_texture'}
    if pbr_names:
        look['pbr_textures'] = {_VTK[name]: textures[name] for name in pbr_names}
    is_dark = not any(material.emissive_factor) or material.extensions.unlit is not None
    if not (is_dark or only_emits):
        strength = material.extensions.emissive.emissive_strength
        look['emissive_factor'] = tuple(strength * x for x in material.emissive_factor)
    return look


def _coordinates(texture_info):
    """Return the index of the texture coordinates of a texture, and their transform."""
    flip_matrix = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])
    if texture_info is None:
        return 0, flip_matrix
    transform = texture_info.extensions.transform
    if transform is None:
        return texture_info.tex_coord, flip_matrix
    c, s = math.cos(transform.rotation), math.sin(transform.rotation)
    (sx, sy), (tx, ty) = transform.scale, transform.offset
    uv_transform = np.array([[c * sx, s * sy, tx], [-s * sx, c * sy, ty], [0.0, 0.0, 1.0]])
    coordinate_set = texture_info.tex_coord if transform.tex_coord is None else transform.tex_coord
    return coordinate_set, flip_matrix @ uv_transform


def _alike(a, b):
    return a[0] == b[0] and np.array_equal(a[1], b[1])


def _same_image(a, b):
    return a is not None and b is not None and a.index == b.index


def _only_emits(material):
    """Return True if a material emits light and reflects none."""
    is_black = not any(material.pbr_metallic_roughness.base_color_factor[:3])
    return is_black and any(material.emissive_factor)


def _with_alpha(colors, alpha):
    """Return colours with four channels, float64."""
    rgba = np.full((len(colors), 4), alpha)
    rgba[:, : colors.shape[1]] = colors
    return rgba


def _color(material, only_emits, linear):
    """Return the colour of a surface, linear or for display."""
    color = np.array(material.pbr_metallic_roughness.base_color_factor[:3])
    if only_emits:
        color = np.array(material.emissive_factor)
        color = color * material.extensions.emissive.emissive_strength
    return tuple(np.clip(color if linear else to_display(color), 0, 1).round(9).tolist())


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
