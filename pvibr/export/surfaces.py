"""Surfaces for any viewer: triangles in world space, colours, a texture, a material."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.materials import copy_property
from pvibr.meshes.surfaces import clipped
from pvibr.projection.samples import sides_of

_FLAT, _PHONG, _PBR = 0, 2, 3  # VTK_FLAT, VTK_PHONG, VTK_PBR
_COLORS = 'colors'
#: Triangles that approximate cut-outs, in all and along a side of each.
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
    name: str = field(default='')

    @property
    def opaque(self) -> bool:
        """Whether it hides everything behind it."""
        see_through = self.colors is not None and bool((self.colors[:, 3] < 255).any())
        return self.material.GetOpacity() >= 1 and not see_through

    def mesh(self):
        """Return a mesh of points and triangles only."""
        return pv.PolyData.from_regular_faces(self.points, self.faces)

    def solid(self) -> pv.PolyData:
        """Return a mesh of what is not cut out."""
        if self.cutout is None or self.texture is None or self.coordinates is None:
            return self.mesh()
        # Each triangle is subdivided, and the pieces whose middle is drawn are kept.
        side = int(np.clip(np.sqrt(_PATTERN / max(len(self.faces), 1)), 1, _FINEST))
        corners, middles = _pattern(side)
        places = middles @ self.coordinates[self.faces]
        height, width = self.texture.shape[:2]
        at = np.floor(places * [width, height]).astype(int)
        column = at[..., 0] % width if self.repeat else np.clip(at[..., 0], 0, width - 1)
        row = at[..., 1] % height if self.repeat else np.clip(at[..., 1], 0, height - 1)
        drawn = self.texture[height - 1 - row, column, 3] >= 255 * self.cutout
        small = np.einsum('skc,mcd->mskd', corners, self.points[self.faces])[drawn]
        return pv.PolyData.from_regular_faces(small.reshape(-1, 3), _apart(3 * len(small)))

    def exploded(self) -> Surface:
        """Return a copy whose triangles share no points."""
        corner = self.faces.ravel()
        rows = {name: values[corner] for name, values in self.rows().items()}
        return self.with_rows(rows, _apart(len(corner)))

    def rows(self) -> dict:
        """Return the point arrays by name."""
        names = ('points', 'normals', 'coordinates', 'colors')
        return {n: v for n in names if (v := getattr(self, n)) is not None}

    def with_rows(self, rows, faces) -> Surface:
        """Return a copy with other points and triangles."""
        return replace(self, faces=faces, **rows)

    def clipped(self, planes) -> Surface | None:
        """Return what clipping planes leave of it, None if nothing."""
        mesh, rows = self.mesh(), self.rows()
        del rows['points']
        for name, values in rows.items():
            mesh.point_data[name] = values
        try:
            left = clipped(mesh, planes).triangulate()
        except ValueError:  # nothing
            return None
        rows = {name: np.asarray(left.point_data[name]) for name in rows}
        rows['points'] = np.asarray(left.points, float)
        return replace(self.with_rows(rows, np.asarray(left.regular_faces)), closed=False)

    def dataset(self) -> pv.PolyData:
        """Return the mesh with its arrays."""
        mesh = self.mesh()
        if self.normals is not None:
            mesh.point_data.active_normals = np.asarray(self.normals, np.float32)
        if self.coordinates is not None:
            mesh.active_texture_coordinates = np.asarray(self.coordinates, np.float32)
        if self.colors is not None:
            solid = bool((self.colors[:, 3] == 255).all())
            mesh.point_data[_COLORS] = self.colors[:, :3] if solid else self.colors
        return mesh

    def add_to(self, plotter):
        """Add it to the active subplot of a plotter."""
        look: dict = {'scalars': None, 'color': self.material.GetColor()}
        if self.colors is not None:
            look = {'scalars': _COLORS, 'rgb': True}
        actor = plotter.add_mesh(
            self.dataset(),
            **look,
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
    """Return triangles that share none of so many points."""
    return np.arange(count).reshape(-1, 3)


def _pattern(side):
    """Return the pieces of a subdivided triangle in barycentric coordinates, and their middles."""
    steps = np.arange(side + 1) / side
    cells = []
    for i in range(side):
        for j in range(side - i):
            a, b, c = (i, j), (i + 1, j), (i, j + 1)
            cells.append([a, b, c])
            if i + j < side - 1:
                cells.append([b, (i + 1, j + 1), c])
    share = steps[np.array(cells)]
    corners = np.concatenate([1 - share.sum(2, keepdims=True), share], axis=2)
    return corners, corners.mean(1)


def surface_of_part(part, owner) -> Surface:
    """Return a part as a surface in world space."""
    mesh, prop = part.mesh, part.actor.GetProperty()
    faces = np.asarray(mesh.regular_faces, int).reshape(-1, 3)
    normals = mesh.point_data.active_normals if prop.GetInterpolation() != _FLAT else None
    coordinates = mesh.active_texture_coordinates
    texture = _image_of(part.actor)
    colors, of_cells = _colors_of(part)
    surface = Surface(
        np.array(mesh.points, float),
        faces,
        None if normals is None else np.array(normals, float),
        None if coordinates is None else np.array(coordinates, float),
        None if of_cells else colors,
        texture,
        material_of(prop),
        owner,
        closed=sides_of(mesh, None) == 1,
        cutout=part.alpha_cutoff,
        smooth=_is_smooth(part.actor),
    )
    if of_cells:
        surface = surface.exploded()
        surface.colors = np.repeat(colors, 3, axis=0)
    if surface.colors is not None or texture is not None:
        surface.material.SetColor(1.0, 1.0, 1.0)  # some viewers multiply by it
    return surface


def material_of(prop):
    """Return a copy of a property without what only some viewers support."""
    copy = pv.Property()
    copy_property(copy, prop)
    copy.RemoveAllTextures()
    if copy.GetInterpolation() == _PBR:
        copy.SetInterpolation(_PHONG)
    return copy


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
    if pixels.shape[2] < 3:
        alpha = pixels[..., 1:] if pixels.shape[2] == 2 else np.full_like(pixels, 255)
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=2), alpha], axis=2)
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.full_like(pixels[..., :1], 255)], axis=2)
    return np.ascontiguousarray(pixels)


def _colors_of(part):
    """Return the colours of a part's scalars, (n, 4), and whether they belong to cells."""
    mapper = part.polydata_mapper()
    if not mapper.GetScalarVisibility():
        return None, False
    mapper.SetInterpolateScalarsBeforeMapping(False)
    mapped = mapper.MapScalars(1.0)
    if mapped is None:
        return None, False
    colors = _vtk.vtk_to_numpy(mapped)
    if colors.shape[1] == 3:
        colors = np.column_stack([colors, np.full(len(colors), 255, np.uint8)])
    mode = mapper.GetScalarMode()
    points_first = part.mesh.point_data.active_scalars_name is not None
    return colors.copy(), mode in (2, 4) or (mode == 0 and not points_first)


def tiled(surface, matrices, colors=None, multiply=False) -> Surface:
    """Return many copies of a surface as one."""
    count, n = len(matrices), len(surface.points)
    axes, origins = matrices[:, :3, :3], matrices[:, None, :3, 3]
    rows = {'points': (surface.points @ np.swapaxes(axes, 1, 2) + origins).reshape(-1, 3)}
    if surface.normals is not None:
        rows['normals'] = unit_vectors(surface.normals @ np.linalg.inv(axes)).reshape(-1, 3)
    if surface.coordinates is not None:
        rows['coordinates'] = np.tile(surface.coordinates, (count, 1))
    faces = np.tile(surface.faces, (count, 1, 1))
    mirrored = np.linalg.det(matrices[:, :3, :3]) < 0
    faces[mirrored] = faces[mirrored][:, :, ::-1]
    faces = (faces + n * np.arange(count)[:, None, None]).reshape(-1, 3)
    if surface.colors is not None:
        rows['colors'] = np.tile(surface.colors, (count, 1))
    texture, material = surface.texture, surface.material
    if colors is not None:
        if colors.shape[1] == 3:
            colors = np.column_stack([colors, np.full(count, 255, np.uint8)])
        each = np.repeat(colors, n, axis=0)
        own = rows.get('colors', _plain(surface, len(each)))
        rows['colors'] = multiplied(own, each) if multiply else each
        material = material_of(material)
        material.SetColor(1.0, 1.0, 1.0)
        if not multiply and texture is not None:
            texture = texture.copy()
            texture[..., :3] = 255  # its holes stay
    found = surface.with_rows(rows, faces)
    return replace(found, texture=texture, material=material)


def _plain(surface, count):
    color = 255 * np.array([*surface.material.GetColor(), 1.0])
    return np.tile(np.rint(color).astype(np.uint8), (count, 1))


def multiplied(a, b) -> np.ndarray:
    """Return the product of colours."""
    product = np.asarray(a, np.uint16) * np.asarray(b, np.uint16)
    return ((product + 127) // 255).astype(np.uint8)


def albedo_of(surface) -> np.ndarray:
    """Return the unlit colours of points without texture, (n, 4), float from 0 to 1."""
    rows = surface.colors
    rows = _plain(surface, len(surface.points)) if rows is None else rows
    return rows / 255.0
