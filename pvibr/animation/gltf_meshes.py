"""Primitives of a glTF file as meshes with morph targets and skins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import Skin
from pvibr.animation.gltf_images import Tiles
from pvibr.animation.gltf_materials import COLORS, Looks
from pvibr.animation.gltf_nodes import bind_of
from pvibr.animation.morphs import WIDTHS, Morphs
from pvibr.core import _vtk
from pvibr.io.gltf_accessors import Accessors
from pvibr.io.gltf_draco import unpack
from pvibr.io.gltf_file import GltfError, GltfFile, naming
from pvibr.io.gltf_schema import MeshExtras
from pvibr.maths.vectors import unit_vectors

_MODES = ('points', 'lines', 'line loops', 'line strips', 'triangles', 'strips', 'fans')
_POINTS, _LINES, _LOOP, _TRIANGLES, _STRIP = 0, 1, 2, 4, 5
_KNOWN = ('POSITION', 'NORMAL', 'TANGENT', 'COLOR_0', 'JOINTS_0', 'WEIGHTS_0')
_SETS = ('JOINTS_1', 'WEIGHTS_1')
#: Overhead of a primitive, a skin and a morph target in bytes, beside their arrays.
_SURFACE, _SKIN, _TARGET = 2**16, 2**15, 2**13
#: Smaller negative weights are rounding.
_NEGATIVE = 1e-3
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
#: Numbers of points of which flat normals are computed at once.
_BATCH = 2**16
#: Attributes of morph targets, by their names in glTF.
_MORPHED = dict(zip(('POSITION', 'NORMAL', 'TANGENT', 'COLOR_0'), WIDTHS, strict=True))


@dataclass(frozen=True, eq=False)
class Surface:
    """A primitive as a mesh, and the properties that its look depends on."""

    mesh: pv.PolyData
    morphs: Morphs | None
    coordinates: bool
    colors: bool
    tiles: Tiles | None
    #: Points or lines; they are lit if they have normals.
    wires: bool
    lit: bool


class Primitives:
    """The primitives of a file, each read once."""

    def __init__(self, gltf_file: GltfFile, accessors: Accessors, looks: Looks, wires=True):
        self._file, self._accessors, self._looks = gltf_file, accessors, looks
        self._wires = wires
        self._readers: dict[tuple[int, int], _Primitive | None] = {}
        self._alike: dict[tuple, _Primitive] = {}
        self._skins: dict[tuple, Skin] = {}
        self._binds: dict[int, tuple] = {}
        self._names: dict[int, list | None] = {}

    def surface(self, mesh_index, primitive_index) -> Surface | None:
        """Return a primitive as a mesh, or None if it is not supported."""
        primitive_reader = self._reader(mesh_index, primitive_index)
        return None if primitive_reader is None else primitive_reader.surface

    def skin(self, mesh_index, primitive_index, skin_index) -> Skin | None:
        """Return the influences of a skin on a primitive, or None."""
        primitive_reader = self._reader(mesh_index, primitive_index)
        if primitive_reader is None or 'JOINTS_0' not in primitive_reader.primitive.attributes:
            return None
        cache_key = primitive_reader, skin_index
        if cache_key not in self._skins:
            self._skins[cache_key] = primitive_reader.skin(skin_index, self._bind(skin_index))
        return self._skins[cache_key]

    def _bind(self, skin_index):
        if skin_index not in self._binds:
            self._binds[skin_index] = bind_of(self._file, self._accessors, skin_index)
        return self._binds[skin_index]

    def _reader(self, mesh_index, primitive_index):
        cache_key = mesh_index, primitive_index
        if cache_key not in self._readers:
            json_path = f'meshes[{mesh_index}].primitives[{primitive_index}]'
            primitive = self._file.document.meshes[mesh_index].primitives[primitive_index]
            primitive_reader = None
            if primitive.mode < _TRIANGLES and not self._wires:
                self._file.leave_out(_MODES[primitive.mode], json_path)
            elif 'POSITION' not in primitive.attributes:
                self._file.leave_out('a mesh without positions', json_path)
            else:
                primitive_reader = self._shared(mesh_index, primitive, json_path)
            self._readers[cache_key] = primitive_reader
        return self._readers[cache_key]

    def _shared(self, mesh_index, primitive, json_path):
        """Return the reader of all primitives with the same content."""
        target_names = self._target_names(mesh_index) if primitive.targets else None
        draco = primitive.extensions.draco
        # Materials choose coordinates, and colour those of vertices.
        is_dressed = any(name.startswith(('COLOR_', 'TEXCOORD_')) for name in primitive.attributes)
        content_key = (
            tuple(primitive.attributes.items()),
            primitive.indices,
            primitive.material if is_dressed else None,
            primitive.mode,
            tuple(tuple(target.items()) for target in primitive.targets),
            draco and draco.buffer_view,
            id(target_names),
        )
        if content_key not in self._alike:
            self._file.spend(_SURFACE, json_path)
            things = self._file, self._accessors, self._looks
            self._alike[content_key] = _Primitive(*things, primitive, target_names, json_path)
        return self._alike[content_key]

    def _target_names(self, mesh_index):
        if mesh_index not in self._names:
            extras = self._file.document.meshes[mesh_index].extras
            try:
                target_names = msgspec.json.decode(extras, type=MeshExtras).target_names
            except (msgspec.DecodeError, RecursionError, ValueError):  # extras may be anything
                target_names = None
            self._names[mesh_index] = target_names
        return self._names[mesh_index]


class _Primitive:
    """One primitive."""

    def __init__(self, gltf_file, accessors, looks, primitive, target_names, json_path):
        self._file, self._accessors, self._looks = gltf_file, accessors, looks
        self._place, self._names = json_path, target_names
        self._changes: dict[tuple[str, int], np.ndarray] = {}
        self.primitive = primitive
        self._check_counts()
        self._mode = primitive.mode
        if unpack(gltf_file, accessors, primitive, json_path):
            self._mode = _TRIANGLES  # strips are unpacked, too

    @cached_property
    def surface(self) -> Surface:
        points = self._of('POSITION', 'VEC3')
        coordinates, colors, tiles = self._coordinates(), self._colors(), None
        mesh = _fast_polydata(points, self._vertices[1], self._normals(points))
        if coordinates is not None:
            tiles = self._looks.tiles(self._material, coordinates)
            coordinates = coordinates if tiles is None else tiles.placed(coordinates)
            mesh.active_texture_coordinates = coordinates
        if colors is not None:
            mesh.point_data[COLORS] = colors
        if self._has('TANGENT') and self._has('NORMAL'):  # ignored without normals
            mesh.point_data['Tangents'] = self._of('TANGENT', 'VEC4')[:, :3]
        with naming(f'{self._place}.targets'):
            morphs = self._morphs(points)
        has = coordinates is not None, colors is not None
        return Surface(mesh, morphs, *has, tiles, self._wires, self._has('NORMAL'))

    def skin(self, skin_index, bind):
        nodes, inverse_bind = bind
        self._file.spend(_SKIN + 128 * (self._count('POSITION') + len(nodes)), self._place)
        joint_sets, weight_sets = [], []
        for set_index in range(2):
            if self._has(f'JOINTS_{set_index}'):
                joint_sets.append(self._joints(f'JOINTS_{set_index}'))
                weight_sets.append(self._of(f'WEIGHTS_{set_index}', 'VEC4'))
        blend_weights = self._shares(np.hstack(weight_sets))
        with naming(f'{self._place}.attributes with skins[{skin_index}]'):
            return Skin(nodes, inverse_bind, np.hstack(joint_sets), blend_weights)

    def _shares(self, weights):
        """Return blend weights as other readers interpret them: never negative, nor all zero."""
        if weights.min() < -_NEGATIVE:
            self._file.leave_out('negative weights', self._place)
        weights = np.maximum(weights, 0)
        weights[weights.max(1) == 0, 0] = 1
        return weights

    @property
    def _wires(self):
        return self.primitive.mode < _TRIANGLES

    @cached_property
    def _cells(self):
        """Vertex indices of triangles (t, 3), lines (t, 2) or points (t, 1) in the file, int64."""
        vertex_count = self._count('POSITION')
        if self.primitive.indices is None:
            self._file.spend(8 * vertex_count, self._place)
            corners = np.arange(vertex_count)
        else:
            json_path = f'{self._place}.indices'
            corners = self._accessors.integers(self.primitive.indices, json_path, 'SCALAR')[:, 0]
            if corners.max() >= vertex_count:
                largest_place = int(corners.argmax())
                raise GltfError(
                    f'{json_path}[{largest_place}] must be below {vertex_count}, the number of '
                    f'vertices, got {corners[largest_place]}'
                )
        self._file.spend(3 * corners.nbytes, self._place)
        return self._as_cells(corners)

    def _as_cells(self, corners):
        primitive_mode = self._mode
        cell_size = {_POINTS: 1, _LINES: 2, _TRIANGLES: 3}.get(primitive_mode)
        if cell_size is not None:
            if len(corners) % cell_size:
                raise GltfError(
                    f'{self._place} must have a multiple of {cell_size} indices, got '
                    f'{len(corners)}'
                )
            return corners.reshape(-1, cell_size)
        least_count = 2 if self._wires else 3
        if len(corners) < least_count:
            raise GltfError(
                f'{self._place} must have {least_count} indices or more as '
                f'{_MODES[primitive_mode]}, got {len(corners)}'
            )
        if self._wires:
            line_pairs = np.column_stack([corners, np.roll(corners, -1)])
            return line_pairs if primitive_mode == _LOOP else line_pairs[:-1]
        a, b, c = corners[:-2], corners[1:-1], corners[2:]
        if primitive_mode == _STRIP:
            is_odd = np.arange(len(a)) % 2 == 1  # every other triangle has reversed winding
            return np.column_stack([a, np.where(is_odd, c, b), np.where(is_odd, b, c)])
        return np.column_stack([b, c, np.broadcast_to(corners[0], len(a))])

    @cached_property
    def _vertices(self):
        """Vertices of the mesh, or ``None`` for all, and its cells, shape (t, n)."""
        corner_indices = self._cells.ravel()
        vertex_count = self._count('POSITION')
        use_counts = np.bincount(corner_indices, minlength=vertex_count)
        if not self._wires and not self._has('NORMAL') and use_counts.max() > 1:
            # Without normals a mesh is flat (glTF 2.0, 3.7.2.1): triangles share no vertices.
            return corner_indices, np.arange(len(corner_indices)).reshape(-1, 3)
        if use_counts.min() > 0:
            return None, self._cells
        used_vertices = np.flatnonzero(use_counts)  # unused vertices must not count in the bounds
        return used_vertices, np.searchsorted(used_vertices, self._cells)

    def _select_used(self, values):
        vertex_indices = self._vertices[0]
        if vertex_indices is None:
            return values
        self._file.spend(len(vertex_indices) * values[:1].nbytes, self._place)
        return values[vertex_indices]

    def _count(self, name):
        accessor_index = self.primitive.attributes[name]
        return self._accessors.count(accessor_index, f'{self._place}.attributes.{name}')

    def _check_counts(self):
        vertex_count = self._count('POSITION')
        for name in self.primitive.attributes:
            if (count := self._count(name)) != vertex_count:
                raise GltfError(
                    f'{self._place}.attributes.{name} must have {vertex_count} elements, as '
                    f'POSITION, got {count}'
                )
            is_known = name in _KNOWN or name in _SETS or name.startswith(('TEXCOORD_', '_'))
            if not is_known:
                self._file.leave_out(f'attribute {name[:40]}', self._place)
        for set_index in (0, 1):
            pair = f'JOINTS_{set_index}', f'WEIGHTS_{set_index}'
            if self._has(pair[0]) != self._has(pair[1]):
                raise GltfError(
                    f'{self._place}.attributes must have {pair[0]} and {pair[1]}, got one of them'
                )

    def _has(self, name):
        return name in self.primitive.attributes

    def _of(self, name, *types):
        path = f'{self._place}.attributes.{name}'
        return self._select_used(
            self._accessors.floats(self.primitive.attributes[name], path, *types)
        )

    def _joints(self, name):
        path = f'{self._place}.attributes.{name}'
        return self._select_used(
            self._accessors.integers(self.primitive.attributes[name], path, 'VEC4')
        )

    def _normals(self, points):
        if self._has('NORMAL'):
            return unit_vectors(self._of('NORMAL', 'VEC3')).astype(np.float32)
        return np.zeros_like(points) if self._wires else _flat_normals(points, self._vertices[1])

    def _coordinates(self):
        coordinate_set, matrix = self._looks.coordinates(self._material)
        name = f'TEXCOORD_{coordinate_set}'
        if not self._has(name):
            return None
        return (self._of(name, 'VEC2') @ matrix[:, :2].T + matrix[:, 2]).astype(np.float32)

    def _colors(self):
        if not self._has('COLOR_0'):
            return None
        return self._looks.vertex_colors(self._material, self._of('COLOR_0', 'VEC3', 'VEC4'))

    @property
    def _material(self):
        return self._looks.material(self.primitive.material, f'{self._place}.material')

    def _morphs(self, points):
        targets = self.primitive.targets
        if not targets:
            return None
        differences: dict[str, list] = {attribute: [] for attribute in _MORPHED.values()}
        for i, target in enumerate(targets):
            for name, attribute in _MORPHED.items():
                differences[attribute].append(self._difference(target, name, i))
            for name in target.keys() - _MORPHED:
                self._file.leave_out(f'morphed {name[:40]}', f'{self._place}.targets[{i}]')
        if not self._has('NORMAL') and not self._wires:
            differences['normals'] = self._flat_differences(points, differences['positions'])
        differences = {
            attribute: values
            for attribute, values in differences.items()
            if attribute == 'positions' or any(value is not None for value in values)
        }
        target_names = self._names if self._names and len(self._names) == len(targets) else None
        return Morphs(**differences, names=target_names)

    def _difference(self, target, name, index):
        if name not in target or not self._has(name):
            return None
        if name == 'TANGENT' and not self._has('NORMAL'):
            return None
        key = name, target[name]
        if key not in self._changes:
            self._file.spend(_TARGET, f'{self._place}.targets[{index}]')
            self._changes[key] = self._change(*key, f'{self._place}.targets[{index}].{name}')
        return self._changes[key]

    def _change(self, name, index, path):
        """Return the differences of an attribute by a morph target."""
        vertex_count = self._count('POSITION')
        if (count := self._accessors.count(index, path)) != vertex_count:
            raise GltfError(f'{path} must have {vertex_count} elements, got {count}')
        if name != 'COLOR_0':
            return self._select_used(self._accessors.floats(index, path, 'VEC3'))
        color_change = self._select_used(self._accessors.floats(index, path, 'VEC3', 'VEC4'))
        colors = self._of(name, 'VEC3', 'VEC4')
        return self._looks.color_difference(self._material, colors, color_change)

    def _flat_differences(self, points, positions):
        """Return the differences of each target's face normals from the neutral ones."""
        moves_by_id = {id(moves): moves for moves in positions if moves is not None}
        self._file.spend(12 * len(points) * len(moves_by_id), f'{self._place}.targets')
        points, faces = points.astype(np.float64), self._vertices[1]
        neutral_normals = _flat_normals(points, faces)
        move_list, batch_size = list(moves_by_id.values()), max(_BATCH // len(points), 1)
        normal_changes: list = []
        for i in range(0, len(move_list), batch_size):
            normal_changes += [
                *(
                    _flat_normals(points + np.stack(move_list[i : i + batch_size]), faces)
                    - neutral_normals
                )
            ]
        change_by_id = dict(zip(moves_by_id, normal_changes, strict=True))
        return [change_by_id.get(id(moves)) for moves in positions]


def _fast_polydata(points, cells, normals):
    """Return cells of one, two or three points, five times as fast as PyVista."""
    mesh = pv.PolyData()
    vtk_points = _vtk.vtkPoints()
    vtk_points.SetData(_vtk.numpy_to_vtk(points))
    mesh.SetPoints(vtk_points)
    cell_size = cells.shape[1]
    cell_array = _vtk.vtkCellArray()
    cell_array.SetData(cell_size, _vtk.numpy_to_vtkIdTypeArray(cells.ravel(), deep=True))
    (mesh.SetVerts, mesh.SetLines, mesh.SetPolys)[cell_size - 1](cell_array)
    cell_array = _vtk.numpy_to_vtk(normals)
    cell_array.SetName('Normals')
    mesh.GetPointData().SetNormals(cell_array)
    return mesh


def _flat_normals(points, faces):
    """Return the normals of points (..., v, 3) that no two triangles share."""
    a, b, c = (points[..., corner, :].astype(np.float64) for corner in faces.T)
    u, v = b - a, c - a
    face_normals = u[..., _NEXT] * v[..., _LAST] - u[..., _LAST] * v[..., _NEXT]
    point_normals = np.zeros(points.shape, np.float32)
    point_normals[..., faces, :] = unit_vectors(face_normals)[..., None, :]
    return point_normals
