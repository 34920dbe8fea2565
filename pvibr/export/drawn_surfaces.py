"""Surfaces for any viewer: triangles in world space with colours, a texture and a material."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.surfaces import clipped
from pvibr.textures.material_textures import copied_property, copy_property
from pvibr.visibility.surface_samples import sides_of

_FLAT, _PHONG, _PBR = 0, 2, 3  # VTK_FLAT, VTK_PHONG, VTK_PBR
_COLORS = 'colors'
#: Most triangles of an approximated cut-out, in all and along a side of each.
_PATTERN, _FINEST = 200_000, 32


@dataclass
class Surface:
    """The data of one actor."""

    points: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None
    coordinates: np.ndarray | None
    colors: np.ndarray | None
    texture: np.ndarray | None
    material: pv.Property
    owner: object = None
    closed: bool = False
    cutout: float | None = None
    repeat: bool = True
    smooth: bool = True
    name: str = ''

    @property
    def opaque(self) -> bool:
        """Whether it hides everything behind it."""
        see_through = self.colors is not None and bool((self.colors[:, 3] < 255).any())
        return self.material.GetOpacity() >= 1 and not see_through

    def mesh(self):
        """Return the bare mesh of points and triangles."""
        return pv.PolyData.from_regular_faces(self.points, self.faces)

    def solid(self) -> pv.PolyData:
        """Return the mesh without the parts that are cut out."""
        if self.cutout is None or self.texture is None or self.coordinates is None:
            return self.mesh()
        # Subdivide each triangle, and select the pieces with an opaque centre.
        subdivision = int(np.clip(np.sqrt(_PATTERN / max(len(self.faces), 1)), 1, _FINEST))
        corners, middle_shares = _pattern(subdivision)
        uv_points = middle_shares @ self.coordinates[self.faces]
        height, width = self.texture.shape[:2]
        texels, size = np.floor(uv_points * [width, height]).astype(int), np.array([width, height])
        texels = texels % size if self.repeat else np.clip(texels, 0, size - 1)
        column, row = np.moveaxis(texels, -1, 0)
        is_opaque = self.texture[height - 1 - row, column, 3] >= 255 * self.cutout
        pieces = np.einsum('skc,mcd->mskd', corners, self.points[self.faces])[is_opaque]
        return pv.PolyData.from_regular_faces(pieces.reshape(-1, 3), _apart(3 * len(pieces)))

    def exploded(self) -> Surface:
        """Return a copy whose triangles share no points."""
        corner_points = self.faces.ravel()
        arrays = {name: values[corner_points] for name, values in self.point_arrays().items()}
        return self.with_arrays(arrays, _apart(len(corner_points)))

    def point_arrays(self) -> dict:
        """Return the point arrays by name."""
        names = ('points', 'normals', 'coordinates', 'colors')
        return {n: v for n in names if (v := getattr(self, n)) is not None}

    def with_arrays(self, arrays, faces) -> Surface:
        """Return a copy with other point arrays and triangles."""
        return replace(self, faces=faces, **arrays)

    def clipped(self, planes) -> Surface | None:
        """Return the part inside clipping planes, or None."""
        mesh, arrays = self.mesh(), self.point_arrays()
        del arrays['points']
        for name, values in arrays.items():
            mesh.point_data[name] = values
        try:
            inside = clipped(mesh, planes).triangulate()
        except ValueError:  # empty
            return None
        arrays = {name: np.asarray(inside.point_data[name]) for name in arrays}
        arrays['points'] = np.asarray(inside.points, float)
        return replace(self.with_arrays(arrays, np.asarray(inside.regular_faces)), closed=False)

    def dataset(self) -> pv.PolyData:
        """Return the mesh with its arrays."""
        mesh = self.mesh()
        if self.normals is not None:
            mesh.point_data.active_normals = np.asarray(self.normals, np.float32)
        if self.coordinates is not None:
            mesh.active_texture_coordinates = np.asarray(self.coordinates, np.float32)
        if self.colors is not None:
            is_solid = bool((self.colors[:, 3] == 255).all())
            mesh.point_data[_COLORS] = self.colors[:, :3] if is_solid else self.colors
        return mesh

    def add_to(self, plotter):
        """Add it to the active subplot of a plotter."""
        color_options: dict = {'scalars': None, 'color': self.material.GetColor()}
        if self.colors is not None:
            color_options = {'scalars': _COLORS, 'rgb': True}
        actor = plotter.add_mesh(
            self.dataset(),
            **color_options,
            reset_camera=False,
            render=False,
            copy_mesh=False,
            show_scalar_bar=False,
            name=self.name or None,
        )
        copy_property(actor.prop, self.material)
        if self.texture is not None:
            actor.SetTexture(self._wrapped(self.texture))
        if self.cutout is not None:
            actor.ForceOpaqueOn()
        return actor

    def _wrapped(self, image):
        if self.cutout is not None:
            image = image.copy()
            image[..., 3] = np.where(image[..., 3] >= 255 * self.cutout, 255, 0)
        elif (image[..., 3] == 255).all():
            image = image[..., :3]
        texture = pv.Texture(np.ascontiguousarray(image))
        texture.interpolate, texture.repeat = self.smooth, self.repeat
        texture.SetEdgeClamp(not self.repeat)
        return texture


def _apart(count):
    """Return triangles that share no points."""
    return np.arange(count).reshape(-1, 3)


def _pattern(subdivision):
    """Return the barycentric corners and centres of a subdivided triangle's pieces."""
    steps = np.arange(subdivision + 1) / subdivision
    cells = []
    for i in range(subdivision):
        for j in range(subdivision - i):
            a, b, c = (i, j), (i + 1, j), (i, j + 1)
            cells.append([a, b, c])
            if i + j < subdivision - 1:
                cells.append([b, (i + 1, j + 1), c])
    uv_shares = steps[np.array(cells)]
    corners = np.concatenate([1 - uv_shares.sum(2, keepdims=True), uv_shares], axis=2)
    return corners, corners.mean(1)


def surface_of_part(part, owner) -> Surface:
    """Return a part as a surface in world space."""
    mesh, prop = part.mesh, part.actor.GetProperty()
    faces = np.asarray(mesh.regular_faces, int).reshape(-1, 3)
    normals = mesh.point_data.active_normals if prop.GetInterpolation() != _FLAT else None
    coordinates = mesh.active_texture_coordinates
    texture = _image_of(part.actor)
    colors, on_cells = _colors_of(part)
    surface = Surface(
        np.array(mesh.points, float),
        faces,
        None if normals is None else np.array(normals, float),
        None if coordinates is None else np.array(coordinates, float),
        None if on_cells else colors,
        texture,
        material_of(prop),
        owner,
        closed=sides_of(mesh, None) == 1,
        cutout=part.alpha_cutoff,
        smooth=_is_smooth(part.actor),
    )
    if on_cells:
        surface = surface.exploded()
        surface.colors = np.repeat(colors, 3, axis=0)
    if surface.colors is not None or texture is not None:
        surface.material.SetColor(1.0, 1.0, 1.0)  # some viewers multiply by it
    return surface


def material_of(prop):
    """Return a copy of a property with only what all viewers support."""
    property_copy = copied_property(prop)
    property_copy.RemoveAllTextures()
    if property_copy.GetInterpolation() == _PBR:
        property_copy.SetInterpolation(_PHONG)
    return property_copy


def _texture_of(actor):
    return actor.GetTexture() or actor.GetProperty().GetTexture('albedoTex')


def _is_smooth(actor) -> bool:
    texture = _texture_of(actor)
    return texture is None or bool(texture.GetInterpolate())


def _image_of(actor):
    """Return the image of an actor's texture, (h, w, 4), or None."""
    texture = _texture_of(actor)
    if texture is None:
        return None
    texture.Update()
    if texture.GetInput() is None:
        return None
    pixels = pv.wrap(texture.GetInput()).active_scalars
    width, height = texture.GetInput().GetDimensions()[:2]
    pixels = np.asarray(pixels).reshape(height, width, -1)[::-1]
    if pixels.dtype != np.uint8:
        return None
    has_alpha = pixels.shape[2] in (2, 4)
    alpha = pixels[..., -1:] if has_alpha else np.full_like(pixels[..., :1], 255)
    colors = np.repeat(pixels[..., :1], 3, axis=2) if pixels.shape[2] < 3 else pixels[..., :3]
    return np.ascontiguousarray(np.concatenate([colors, alpha], axis=2))


def _colors_of(part):
    """Return the colours of a part's scalars, (n, 4), and whether these are cell scalars."""
    mapper = part.polydata_mapper()
    if not mapper.GetScalarVisibility():
        return None, False
    mapper.SetInterpolateScalarsBeforeMapping(False)
    mapped_colors = mapper.MapScalars(1.0)
    if mapped_colors is None:
        return None, False
    colors = _vtk.vtk_to_numpy(mapped_colors)
    if colors.shape[1] == 3:
        colors = np.column_stack([colors, np.full(len(colors), 255, np.uint8)])
    scalar_mode = mapper.GetScalarMode()
    has_point_scalars = part.mesh.point_data.active_scalars_name is not None
    return colors.copy(), scalar_mode in (2, 4) or (scalar_mode == 0 and not has_point_scalars)


def tiled(surface, matrices, colors=None, multiply=False) -> Surface:
    """Return many copies of a surface as one."""
    copy_count, point_count = len(matrices), len(surface.points)
    axes, origins = matrices[:, :3, :3], matrices[:, None, :3, 3]
    arrays = {'points': (surface.points @ np.swapaxes(axes, 1, 2) + origins).reshape(-1, 3)}
    if surface.normals is not None:
        arrays['normals'] = unit_vectors(surface.normals @ np.linalg.inv(axes)).reshape(-1, 3)
    if surface.coordinates is not None:
        arrays['coordinates'] = np.tile(surface.coordinates, (copy_count, 1))
    faces = np.tile(surface.faces, (copy_count, 1, 1))
    is_mirrored = np.linalg.det(matrices[:, :3, :3]) < 0
    faces[is_mirrored] = faces[is_mirrored][:, :, ::-1]
    faces = (faces + point_count * np.arange(copy_count)[:, None, None]).reshape(-1, 3)
    if surface.colors is not None:
        arrays['colors'] = np.tile(surface.colors, (copy_count, 1))
    texture, material = surface.texture, surface.material
    if colors is not None:
        if colors.shape[1] == 3:
            colors = np.column_stack([colors, np.full(copy_count, 255, np.uint8)])
        copy_colors = np.repeat(colors, point_count, axis=0)
        own_colors = arrays.get('colors', _plain(surface, len(copy_colors)))
        arrays['colors'] = multiplied(own_colors, copy_colors) if multiply else copy_colors
        material = material_of(material)
        material.SetColor(1.0, 1.0, 1.0)
        if not multiply and texture is not None:
            texture = texture.copy()
            texture[..., :3] = 255  # alpha is unchanged
    return replace(surface.with_arrays(arrays, faces), texture=texture, material=material)


def _plain(surface, point_count):
    rgba = 255 * np.array([*surface.material.GetColor(), 1.0])
    return np.tile(np.rint(rgba).astype(np.uint8), (point_count, 1))


def multiplied(a, b) -> np.ndarray:
    """Return the product of colours."""
    product = np.asarray(a, np.uint16) * np.asarray(b, np.uint16)
    return ((product + 127) // 255).astype(np.uint8)


def albedo_of(surface) -> np.ndarray:
    """Return the unlit colours of points without texture, (n, 4), in [0, 1]."""
    colors = surface.colors
    return (_plain(surface, len(surface.points)) if colors is None else colors) / 255.0
