"""Materials of a glTF file as keywords of ``add_mesh``."""

from __future__ import annotations

import io
import math
from typing import Any

import msgspec
import numpy as np
import pyvista as pv

from pvibr.formats.gltf_file import GltfError, GltfFile, MissingFileError, follow
from pvibr.formats.gltf_schema import Material, Metallic, Sampler, TextureInfo
from pvibr.maths.tones import to_display

#: Name of the array of vertex colours.
COLORS = 'gltf_colors'
_NEAREST = 9728
_MIPMAPS = (9984, 9985, 9986, 9987)
_WRAPS = {33071: 'CLAMP_TO_EDGE', 33648: 'MIRRORED_REPEAT', 10497: 'REPEAT'}
#: Image formats that Pillow may try; others are unsafe (EPS starts Ghostscript).
_PICTURES = ('PNG', 'JPEG', 'WEBP')
_SRGB = ('base_color_texture', 'emissive_texture')
#: VTK's texture names by those of glTF.
_VTK = {
    'base_color_texture': 'albedoTex',
    'metallic_roughness_texture': 'materialTex',
    'occlusion_texture': 'materialTex',
    'emissive_texture': 'emissiveTex',
}
#: Channels of a texture in use; the others are set to 1.
_CHANNELS = {'metallic_roughness_texture': 'GB', 'occlusion_texture': 'R'}


class Looks:
    """The materials and textures of a file, each read once."""

    def __init__(self, file: GltfFile, pbr):
        self._file, self._pbr = file, pbr
        self._textures: dict[tuple, pv.Texture] = {}

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

    def look(self, material, place, *, coordinates, colors, mirrored):
        """Return the keywords for ``add_mesh``."""
        look: dict[str, Any] = {'smooth_shading': True}
        used: dict[str, Any] = {}
        if self._is_physical(material):
            used = self._surface(material) if coordinates else {}
            look |= _physical(material, used)
        elif coordinates:
            look |= self._texture_of(material)
        shines = _only_shines(material) and 'emissive_texture' not in used
        if colors:
            look |= {'scalars': COLORS, 'rgb': True, 'preference': 'point'}
        else:
            # VTK expects linear colours with physically based shading.
            look['color'] = _color(material, shines, linear='pbr' in look)
            look |= _opacity(material)
        if material.extensions.unlit is not None or shines:
            look['lighting'] = False
        if material.alpha_mode == 'MASK':
            look['alpha_cutoff'] = min(material.alpha_cutoff, 1.0)
        if not material.double_sided and not mirrored:
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
        infos = self._infos(material).values() if self._is_physical(material) else ()
        base = material.pbr_metallic_roughness.base_color_texture
        return _coordinates(next((i for i in (base, *infos) if i is not None), None))

    def _is_physical(self, material):
        # VTK does not sort surfaces that only the alpha of such a texture makes translucent.
        blended = material.alpha_mode == 'BLEND'
        textured = material.pbr_metallic_roughness.base_color_texture is not None
        return self._pbr and material.extensions.unlit is None and not (blended and textured)

    @staticmethod
    def _infos(material):
        metallic = material.pbr_metallic_roughness
        return {
            'base_color_texture': metallic.base_color_texture,
            'metallic_roughness_texture': metallic.metallic_roughness_texture,
            'occlusion_texture': material.occlusion_texture,
            'emissive_texture': material.emissive_texture,
        }

    def _surface(self, material):
        """Return the textures of physically based shading by their glTF names."""
        found = {}
        where = self.coordinates(material)
        infos = self._infos(material)
        both = _same_image(infos['metallic_roughness_texture'], infos['occlusion_texture'])
        for name, info in infos.items():
            if info is None or not _alike(_coordinates(info), where):
                continue  # a mesh has one set of texture coordinates
            opaque = material.alpha_mode == 'OPAQUE' or name != 'base_color_texture'
            channels = 'RGB' if both else _CHANNELS.get(name, 'RGB')
            if name == 'occlusion_texture' and not both and 'metallic_roughness_texture' in found:
                continue  # VTK reads both from one image
            texture = self._or_left_out(info, opaque, name in _SRGB, channels)
            if texture is not None:
                found[name] = texture
        return found

    def _texture_of(self, material):
        info = material.pbr_metallic_roughness.base_color_texture
        if info is None:
            return {}
        texture = self._or_left_out(info, material.alpha_mode == 'OPAQUE')
        return {} if texture is None else {'texture': texture}

    def _or_left_out(self, info, opaque, srgb=False, channels='RGB'):
        try:
            return self._texture(info, opaque, srgb, channels)
        except MissingFileError as error:  # models often come without their images
            self._file.leave_out('an image', str(error).rstrip('.'))
            return None

    def _texture(self, info: TextureInfo, opaque, srgb, channels):
        document = self._file.document
        place = f'textures[{info.index}]'
        texture = follow(document.textures, info.index, 'texture.index', 'textures')
        key = (info.index, opaque, srgb, channels)
        if key in self._textures:
            return self._textures[key]
        sampler = Sampler()
        if texture.sampler is not None:
            sampler = follow(document.samplers, texture.sampler, f'{place}.sampler', 'samplers')
        webp = texture.extensions.webp
        source = texture.source if webp is None else webp.source
        if source is None:
            msg = f'{place} has no source.'
            raise GltfError(msg)
        follow(document.images, source, f'{place}.source', 'images')
        pixels = self._pixels(source)
        if channels != 'RGB':
            pixels = pixels.copy()
            pixels[..., [i for i, name in enumerate('RGB') if name not in channels]] = 255
        # OPAQUE means that alpha is ignored; VTK would blend it.
        made = pv.Texture(np.ascontiguousarray(pixels[..., :3] if opaque else pixels))
        made.SetUseSRGBColorSpace(srgb)
        made.interpolate = sampler.mag_filter != _NEAREST
        made.mipmap = sampler.min_filter in _MIPMAPS
        made.wrap = pv.Texture.WrapType[_WRAPS[sampler.wrap_s]]
        if sampler.wrap_s != sampler.wrap_t:
            self._file.leave_out('wrapT other than wrapS', f'samplers[{texture.sampler}]')
        self._textures[key] = made
        return made

    def _pixels(self, index):
        image, place = self._file.document.images[index], f'images[{index}]'
        if image.buffer_view is not None:
            data = bytes(self._file.view(image.buffer_view, f'{place}.bufferView'))
        elif image.uri is not None:
            data = self._file.resource(image.uri, f'{place}.uri')
        else:
            msg = f'{place} has neither uri nor bufferView.'
            raise GltfError(msg)
        return self._decoded(data, place)

    def _decoded(self, data, place):
        from PIL import Image  # a dependency of imageio; only textured files need it

        try:
            with Image.open(io.BytesIO(data), formats=_PICTURES) as picture:
                width, height = picture.size
                self._file.spend(8 * width * height, place)
                if picture.mode.startswith('I'):  # 16-bit grey, which Pillow would clip
                    picture = Image.fromarray((np.asarray(picture) >> 8).astype(np.uint8))
                return np.asarray(picture.convert('RGBA'))
        except GltfError:
            raise
        except Exception as error:  # decoders raise any exception at broken bytes
            msg = f'{place} cannot be read: {error}.'
            raise GltfError(msg) from error

    def _leave_out(self, material, place, used):
        shines = any(material.emissive_factor) and material.extensions.unlit is None
        if shines and not _only_shines(material) and 'emissive_texture' not in used:
            self._file.leave_out('light of a surface that also reflects', f'{place}.material')
        if self._pbr and not self._is_physical(material) and material.extensions.unlit is None:
            self._file.leave_out('physically based shading of glass', f'{place}.material')
        infos = self._infos(material) | {'normal_texture': material.normal_texture}
        for name, info in infos.items():
            if info is not None and name not in used and name != 'base_color_texture':
                self._file.leave_out(name.replace('_', ' '), f'{place}.material')


def _physical(material, textures):
    """Return the keywords of physically based shading."""
    metallic = material.pbr_metallic_roughness
    look: dict[str, Any] = {
        'pbr': True,
        'metallic': _share(metallic.metallic_factor),
        'roughness': _share(metallic.roughness_factor),
    }
    found = {_VTK[name]: texture for name, texture in textures.items()}
    if found:
        look['pbr_textures'] = found
    if 'emissiveTex' in found:
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


def _opacity(material):
    alpha = _share(material.pbr_metallic_roughness.base_color_factor[3])
    return {'opacity': alpha} if material.alpha_mode != 'OPAQUE' and alpha < 1 else {}
