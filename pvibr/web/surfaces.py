"""Surfaces of actors as arrays, with their looks, and as meshes that VTK draws alike."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.textures.material_textures import copied_property
from pvibr.web.container import Directions, Points

_FLAT = 0  # VTK_FLAT
_POINTS, _WIREFRAME = 0, 1
_RGB = 'pvibr_rgb'


class WebSurface:
    """Triangles, lines and vertices with what colours them."""

    def __init__(self, actor, mesh=None, origin=None):
        mapper = actor.GetMapper()
        mapper.Update()
        self.actor, self.prop = actor, actor.GetProperty()
        mesh = pv.wrap(mapper.GetInput() if mesh is None else mesh)
        if not isinstance(mesh, pv.PolyData):
            mesh = mesh.extract_surface(algorithm='dataset_surface')
        if mesh.n_strips:
            mesh = mesh.triangulate()
        values, by_cell = _scalars(mapper, mesh)
        faces, lines, verts, cells = self._primitives(mesh)
        points = np.asarray(mesh.points, float)
        is_smooth = self.prop.GetInterpolation() != _FLAT
        normals = mesh.point_data.active_normals if is_smooth else None
        coordinates = mesh.active_texture_coordinates if actor.GetTexture() else None
        shows_edges = self.prop.GetEdgeVisibility() and self.is_solid and len(faces)
        self.edges = np.unique(np.sort(_edges(mesh)[0], 1), axis=0) if shows_edges else None
        #: Point of the mesh of each vertex; cells that have colours share no vertices.
        self.source, rows = np.arange(len(points)), np.arange(len(points))
        if by_cell:
            self.source = np.concatenate([faces.ravel(), lines.ravel(), verts])
            faces, lines, verts = _renumbered(faces, lines, verts)
            rows = cells
            if self.edges is not None:  # any vertex of a point is at its place
                vertex = np.zeros(len(points), int)
                vertex[self.source] = np.arange(len(self.source))
                self.edges = vertex[self.edges]
        values = None if values is None else values[rows]
        self._fields = (mesh.cell_data if by_cell else mesh.point_data), rows
        take = self.source
        self.points, self.faces, self.lines, self.verts = points[take], faces, lines, verts
        self.origin = self.points.mean(0) if origin is None else np.asarray(origin, float)
        self.normals = None if normals is None else np.asarray(normals, np.float32)[take]
        self.coordinates = None if coordinates is None else np.asarray(coordinates)[take]
        self.colors = self.values = None
        if values is not None and values.ndim == 2:
            self.colors = values
        else:
            self.values = values
        self.mapper = mapper

    def _primitives(self, mesh):
        """Return triangles, lines, vertices, and the cell of each of their corners."""
        style = self.prop.GetRepresentation()
        self.is_solid = style not in (_POINTS, _WIREFRAME)
        (faces, cells), (lines, line_cells), (verts, vert_cells) = (
            _triangles(mesh),
            _segments(mesh),
            _vertices(mesh),
        )
        if style == _WIREFRAME:
            edges, edge_cells = _edges(mesh)
            lines = np.concatenate([lines, edges])
            line_cells = np.concatenate([line_cells, edge_cells])
        elif style == _POINTS:
            verts = np.concatenate([verts, lines.ravel(), faces.ravel()])
            vert_cells = [vert_cells, line_cells.repeat(2), cells.repeat(3)]
            vert_cells = np.concatenate(vert_cells)
            lines, line_cells = lines[:0], line_cells[:0]
        if not self.is_solid:
            faces, cells = faces[:0], cells[:0]
        cells = np.concatenate([cells.repeat(3), line_cells.repeat(2), vert_cells])
        return faces, lines, verts, cells

    def scalars(self) -> dict:
        """Return values of the vertices by name: those that colour them, and the others."""
        fields, rows = self._fields
        named = {n: v for n, v in fields.items() if v.ndim == 1 and v.dtype.kind in 'biuf'}
        others = {name: np.asarray(v)[rows].astype(np.float32) for name, v in named.items()}
        own = np.asarray(self.values, np.float32)
        return {scalar_name(self.mapper): own, **others}

    def polydata(self, kind='faces') -> pv.PolyData:
        """Return the triangles, or one line or vertex, of which VTK makes the same program."""
        mesh: Any = pv.PolyData()
        mesh.points = (self.points - self.origin).astype(np.float32)
        if kind == 'faces':
            mesh.faces = np.insert(self.faces, 0, 3, axis=1)
        elif not self.is_solid:
            mesh.faces = [3, 0, min(1, len(self.points) - 1), min(2, len(self.points) - 1)]
        else:
            setattr(mesh, kind, [2, 0, 0] if kind == 'lines' else [1, 0])
        if self.normals is not None:
            mesh.point_data.active_normals = self.normals
        if self.coordinates is not None:
            mesh.active_texture_coordinates = self.coordinates.astype(np.float32)
        if self.colors is not None:
            mesh.point_data[_RGB] = self.colors
        elif self.values is not None:
            mesh.point_data[_RGB] = np.ascontiguousarray(self.values, np.float32)
        return mesh

    def set_mapper(self, mapper):
        """Colour a mapper of `polydata` as the actor's is."""
        if self.colors is None and self.values is None:
            mapper.ScalarVisibilityOff()
            return
        mapper.ScalarVisibilityOn()
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(_RGB)
        if self.colors is not None:
            mapper.SetColorModeToDirectScalars()
            return
        mapper.SetColorModeToMapScalars()
        mapper.InterpolateScalarsBeforeMappingOn()
        mapper.SetLookupTable(self.mapper.GetLookupTable())
        mapper.SetScalarRange(*self.mapper.GetScalarRange())
        mapper.UseLookupTableScalarRangeOff()

    def programs(self, programs, prepare=None) -> dict:
        """Return the numbers of the programs of what there is: VTK lights each kind otherwise.

        Each actor is prepared by a function, if there is one.
        """
        kinds = {'faces': self.faces, 'lines': self.lines, 'verts': self.verts}
        actors = {k: self._actor_of(k) for k, ids in kinds.items() if len(ids)}
        for actor in actors.values() if prepare else ():
            prepare(actor)
        return {kind: programs.add(actor) for kind, actor in actors.items()}

    def _actor_of(self, kind) -> pv.Actor:
        """Return an actor for the hidden window."""
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputData(self.polydata(kind))
        self.set_mapper(mapper)
        actor = pv.Actor()
        actor.SetMapper(mapper)
        prop = copied_property(self.prop)
        prop.SetEdgeVisibility(False)
        prop.SetRenderLinesAsTubes(False)  # by a geometry shader, which WebGL lacks
        actor.SetProperty(prop)
        back = self.actor.GetBackfaceProperty()
        if back is not None:
            actor.SetBackfaceProperty(copied_property(back))
        actor.SetTexture(self.actor.GetTexture())
        return actor

    def tree(self) -> dict:
        """Return the arrays for the page."""
        tree = {
            'points': Points(self.points - self.origin),
            'origin': self.origin.tolist(),
            'material': material_of(self.prop, self.actor.GetBackfaceProperty()),
        }
        if not np.array_equal(self.source, np.arange(len(self.source))):
            tree['source'] = self.source.astype(np.uint32)
        for name, ids in (('faces', self.faces), ('lines', self.lines), ('verts', self.verts)):
            if len(ids):
                tree[name] = ids.astype(np.uint32).ravel()
        if self.edges is not None:
            tree['edges'] = self.edges.astype(np.uint32).ravel()
        if self.normals is not None:
            tree['normals'] = Directions(self.normals)
        if self.colors is not None:
            tree['colors'] = self.colors
        elif self.values is not None:
            tree['values'] = self.values.astype(np.float32)
            tree['coloring'] = coloring_of(self.mapper)
        image = _image(self.actor.GetTexture())
        if self.coordinates is not None and image is not None:
            texture = self.actor.GetTexture()
            tree['coordinates'] = self.coordinates.astype(np.float32)
            tree['texture'] = {
                'image': image,
                'linear': bool(texture.GetInterpolate()),
                'repeat': bool(texture.GetRepeat()),
                'mipmap': bool(texture.GetMipmap()),
            }
        return tree


def _shared_uniforms(prop) -> dict:
    return {
        'ambientIntensity': prop.GetAmbient(),
        'diffuseIntensity': prop.GetDiffuse(),
        'specularIntensity': prop.GetSpecular(),
        'specularPowerUniform': prop.GetSpecularPower(),
        'opacityUniform': prop.GetOpacity(),
        'ambientColorUniform': prop.GetAmbientColor(),
        'diffuseColorUniform': prop.GetDiffuseColor(),
        'specularColorUniform': prop.GetSpecularColor(),
    }


def thing_of(surface, name, programs, prepare=None) -> dict:
    """Return a surface as a thing; a function prepares the actors that draw it."""
    thing = surface.tree() | {
        'kind': 'mesh',
        'name': name,
        'translucent': bool(surface.actor.HasTranslucentPolygonalGeometry()),
        'programs': surface.programs(programs, prepare),
    }
    if surface.values is not None:
        thing['coloring'] = coloring_of(surface.mapper)
        thing['scalars'] = surface.scalars()
    return thing


def material_of(prop, back=None) -> dict:
    """Return the uniforms of VTK's programs for the materials of front and back."""
    back_uniforms = {} if back is None else _shared_uniforms(back)
    uniforms = {
        **_shared_uniforms(prop),
        **{f'{name}BF': value for name, value in back_uniforms.items()},
        'metallicUniform': prop.GetMetallic(),
        'roughnessUniform': prop.GetRoughness(),
        'aoStrengthUniform': prop.GetOcclusionStrength(),
        'emissiveFactorUniform': prop.GetEmissiveFactor(),
        'edgeTintUniform': prop.GetEdgeTint(),
        'baseF0Uniform': _f0(prop.GetBaseIOR()),
        'ibr_point_size': prop.GetPointSize(),
        'showTexturesOnBackface': int(prop.GetShowTexturesOnBackface()),
    }
    return {
        'uniforms': uniforms,
        'back': bool(prop.GetBackfaceCulling()),
        'front': bool(prop.GetFrontfaceCulling()),
        'edge_color': prop.GetEdgeColor(),
        'line_width': prop.GetLineWidth(),
    }


def _f0(index) -> float:
    """Return the reflectance of a dielectric at normal incidence."""
    return ((index - 1) / (index + 1)) ** 2


def scalar_name(mapper) -> str:
    """Return the name of the array that colours a mapper's mesh, or an empty string."""
    dataset = mapper.GetInput()
    if mapper.GetScalarMode() in (3, 4) or dataset is None:
        return mapper.GetArrayName() or ''
    by_cell = mapper.GetScalarMode() == 2
    scalars = (dataset.GetCellData() if by_cell else dataset.GetPointData()).GetScalars()
    return '' if scalars is None else scalars.GetName() or ''


def coloring_of(mapper) -> dict:
    """Return the table and range by which a mapper maps scalars."""
    lookup = mapper.GetLookupTable()
    scale = getattr(lookup, 'GetScale', int)()  # of tables alone, 1 where it is logarithmic
    # Mappers set their range on the table as they draw, unless they use the table's own.
    own_range = mapper.GetUseLookupTableScalarRange()
    return {
        'name': scalar_name(mapper),
        'range': [float(x) for x in (lookup.GetRange() if own_range else mapper.GetScalarRange())],
        'log': bool(scale),
        'table': table_of(lookup),
        'nan': _bytes_of(lookup.GetNanColor()),
        **{
            end.lower(): _bytes_of(getattr(lookup, f'Get{end}RangeColor')())
            for end in ('Below', 'Above')
            if getattr(lookup, f'GetUse{end}RangeColor', bool)()
        },
    }


def _bytes_of(color) -> list[int]:
    return [round(255 * x) for x in (*color, 1.0)[:4]]


def table_of(lookup) -> np.ndarray:
    """Return the colours of a lookup table, (n, 4) uint8."""
    if hasattr(lookup, 'GetTable'):
        lookup.Build()
        return np.array(_vtk.vtk_to_numpy(lookup.GetTable()), np.uint8)
    low, high = lookup.GetRange()
    colors = [[*lookup.GetColor(x), lookup.GetOpacity(x)] for x in np.linspace(low, high, 256)]
    return np.rint(255 * np.array(colors)).astype(np.uint8)


def _scalars(mapper, mesh):
    """Return what colours a mesh, values or (n, 4) uint8, and whether that is per cell."""
    if not mapper.GetScalarVisibility():
        return None, False
    mode, name = mapper.GetScalarMode(), mapper.GetArrayName()
    data, by_cell = None, mode in (2, 4)
    fields = mesh.cell_data if by_cell else mesh.point_data
    if mode in (3, 4):
        data = fields.get(name)
    else:
        active = (mesh.GetCellData() if by_cell else mesh.GetPointData()).GetScalars()
        data = None if active is None else _vtk.vtk_to_numpy(active)
    if data is None:
        return None, False
    data = np.asarray(data)
    is_direct = mapper.GetColorMode() == 2 or (
        data.dtype == np.uint8 and mapper.GetColorMode() == 0
    )
    if is_direct:
        colors = data if data.dtype == np.uint8 else np.rint(255 * np.clip(data, 0, 1))
        rgba = np.full((len(data), 4), 255, np.uint8)
        rgba[:, : colors.shape[1]] = colors
        return rgba, by_cell
    if data.ndim == 2:
        component = mapper.GetArrayComponent()
        data = np.linalg.norm(data, axis=1) if component < 0 else data[:, component]
    if not by_cell and not mapper.GetInterpolateScalarsBeforeMapping():
        mapped = mapper.GetLookupTable().MapScalars(_vtk.numpy_to_vtk(data.astype(float)), 0, -1)
        return np.array(_vtk.vtk_to_numpy(mapped), np.uint8)[:, :4], by_cell
    return data.astype(float), by_cell


def _renumbered(faces, lines, verts):
    """Return primitives whose corners are vertices of their own."""
    ends = np.cumsum([faces.size, lines.size, verts.size])
    numbers = np.split(np.arange(ends[-1]), ends[:-1])
    return numbers[0].reshape(-1, 3), numbers[1].reshape(-1, 2), numbers[2]


def _cells_of(array):
    """Return the point ids of a cell array, its offsets, and the cell of each id."""
    ids = _vtk.vtk_to_numpy(array.GetConnectivityArray()).astype(int)
    offsets = _vtk.vtk_to_numpy(array.GetOffsetsArray()).astype(int)
    return ids, offsets, np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))


def _triangles(mesh):
    """Return triangles and the cell of each."""
    if not mesh.GetNumberOfPolys():
        return np.zeros((0, 3), int), np.zeros(0, int)
    polygons = pv.PolyData(mesh.points, faces=mesh.faces)
    polygons.cell_data['cell'] = np.arange(polygons.n_cells) + mesh.n_verts + mesh.n_lines
    if not polygons.is_all_triangles:
        polygons = polygons.triangulate()
    return np.asarray(polygons.regular_faces), np.asarray(polygons['cell'])


def _edges(mesh):
    """Return the edges of each polygon, (n, 2), and its cell."""
    ids, offsets, cells = _cells_of(mesh.GetPolys())
    following = np.arange(1, len(ids) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    return np.stack([ids, ids[following]], 1), cells + mesh.n_verts + mesh.n_lines


def _segments(mesh):
    """Return segments of lines, (n, 2), and the cell of each."""
    ids, offsets, cells = _cells_of(mesh.GetLines())
    is_start = np.ones(len(ids), bool)
    is_start[offsets[1:] - 1] = False
    return np.stack([ids, np.roll(ids, -1)], 1)[is_start], cells[is_start] + mesh.n_verts


def _vertices(mesh):
    """Return vertices and the cell of each."""
    ids, _, cells = _cells_of(mesh.GetVerts())
    return ids, cells


def _image(texture):
    """Return the picture of a texture, (h, w, 4) uint8, row 0 at v = 0."""
    if texture is None or texture.GetInput() is None:
        return None
    image = texture.GetInput()
    width, height, _ = image.GetDimensions()
    pixels = _vtk.vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., : pixels.shape[2]] = pixels if pixels.shape[2] > 1 else pixels[..., [0, 0, 0]]
    return rgba


def css_of(color) -> str:
    """Return a colour as CSS has it."""
    return '#' + ''.join(f'{round(255 * c):02x}' for c in color)


def text_look(prop) -> dict:
    """Return a text property as a page draws text, its size in pixels."""
    return {
        'size': prop.GetFontSize(),
        'color': css_of(prop.GetColor()),
        'bold': bool(prop.GetBold()),
        'italic': bool(prop.GetItalic()),
        'family': prop.GetFontFamilyAsString().lower(),
    }
