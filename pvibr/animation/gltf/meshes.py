"""Primitives of a glTF file as meshes with morph targets and skins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import Skin
from pvibr.animation.gltf.looks import COLORS, Looks
from pvibr.animation.gltf.nodes import bind_of
from pvibr.animation.gltf.pictures import Tiles
from pvibr.animation.morphs import WIDTHS, Morphs
from pvibr.core import _vtk
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_draco import unpack
from pvibr.formats.gltf_file import GltfError, GltfFile, naming
from pvibr.formats.gltf_schema import MeshExtras
from pvibr.maths.vectors import unit_vectors

_MODES = ('points', 'lines', 'line loops', 'line strips', 'triangles', 'strips', 'fans')
_POINTS, _LINES, _LOOP, _TRIANGLES, _STRIP = 0, 1, 2, 4, 5
_KNOWN = ('POSITION', 'NORMAL', 'TANGENT', 'COLOR_0', 'JOINTS_0', 'WEIGHTS_0')
_SETS = ('JOINTS_1', 'WEIGHTS_1')
#: Memory of a primitive, a skin, and the differences of a morph target, beside their numbers.
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
    """A primitive as a mesh, and what of it looks depend on."""

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

    def __init__(self, file: GltfFile, accessors: Accessors, looks: Looks, wires=True):
        self._file, self._accessors, self._looks = file, accessors, looks
        self._wires = wires
        self._readers: dict[tuple[int, int], _Primitive | None] = {}
        self._alike: dict[tuple, _Primitive] = {}
        self._skins: dict[tuple, Skin] = {}
        self._binds: dict[int, tuple] = {}
        self._names: dict[int, list | None] = {}

    def surface(self, mesh, number) -> Surface | None:
        """Return a primitive as a mesh, or None if it is not supported."""
        reader = self._reader(mesh, number)
        return None if reader is None else reader.surface

    def skin(self, mesh, number, skin) -> Skin | None:
        """Return the influences of a skin on a primitive, or None."""
        reader = self._reader(mesh, number)
        if reader is None or 'JOINTS_0' not in reader.primitive.attributes:
            return None
        key = (reader, skin)
        if key not in self._skins:
            self._skins[key] = reader.skin(skin, self._bind(skin))
        return self._skins[key]

    def _bind(self, skin):
        if skin not in self._binds:
            self._binds[skin] = bind_of(self._file, self._accessors, skin)
        return self._binds[skin]

    def _reader(self, mesh, number):
        key = (mesh, number)
        if key not in self._readers:
            place = f'meshes[{mesh}].primitives[{number}]'
            primitive = self._file.document.meshes[mesh].primitives[number]
            reader = None
            if primitive.mode < _TRIANGLES and not self._wires:
                self._file.leave_out(_MODES[primitive.mode], place)
            elif 'POSITION' not in primitive.attributes:
                self._file.leave_out('a mesh without positions', place)
            else:
                reader = self._shared(mesh, primitive, place)
            self._readers[key] = reader
        return self._readers[key]

    def _shared(self, mesh, primitive, place):
        """Return the reader of all primitives with the same content."""
        names = self._target_names(mesh) if primitive.targets else None
        draco = primitive.extensions.draco
        # Materials choose coordinates, and colour those of vertices.
        dressed = any(name.startswith(('COLOR_', 'TEXCOORD_')) for name in primitive.attributes)
        content = (
            tuple(primitive.attributes.items()),
            primitive.indices,
            primitive.material if dressed else None,
            primitive.mode,
            tuple(tuple(target.items()) for target in primitive.targets),
            draco and draco.buffer_view,
            id(names),
        )
        if content not in self._alike:
            self._file.spend(_SURFACE, place)
            things = self._file, self._accessors, self._looks
            self._alike[content] = _Primitive(*things, primitive, names, place)
        return self._alike[content]

    def _target_names(self, mesh):
        if mesh not in self._names:
            extras = self._file.document.meshes[mesh].extras
            try:
                names = msgspec.json.decode(extras, type=MeshExtras).target_names
            except (msgspec.DecodeError, RecursionError, ValueError):  # extras may be anything
                names = None
            self._names[mesh] = names
        return self._names[mesh]


class _Primitive:
    """One primitive."""

    def __init__(self, file, accessors, looks, primitive, target_names, place):
        self._file, self._accessors, self._looks = file, accessors, looks
        self._place, self._names = place, target_names
        self._changes: dict[tuple[str, int], np.ndarray] = {}
        self.primitive = primitive
        self._check_counts()
        self._mode = primitive.mode
        if unpack(file, accessors, primitive, place):
            self._mode = _TRIANGLES  # strips are unpacked, too

    @cached_property
    def surface(self) -> Surface:
        points = self._of('POSITION', 'VEC3')
        coordinates, colors, tiles = self._coordinates(), self._colors(), None
        mesh = _polydata(points, self._vertices[1], self._normals(points))
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

    def skin(self, index, bind):
        nodes, inverse_bind = bind
        self._file.spend(_SKIN + 128 * (self._count('POSITION') + len(nodes)), self._place)
        joints, weights = [], []
        for number in range(2):
            if self._has(f'JOINTS_{number}'):
                joints.append(self._joints(f'JOINTS_{number}'))
                weights.append(self._of(f'WEIGHTS_{number}', 'VEC4'))
        shares = self._shares(np.hstack(weights))
        with naming(f'{self._place}.attributes with skins[{index}]'):
            return Skin(nodes, inverse_bind, np.hstack(joints), shares)

    def _shares(self, weights):
        """Return blend weights as other readers take them: never negative, nor all zero."""
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
        n = self._count('POSITION')
        if self.primitive.indices is None:
            self._file.spend(8 * n, self._place)
            corners = np.arange(n)
        else:
            place = f'{self._place}.indices'
            corners = self._accessors.integers(self.primitive.indices, place, 'SCALAR')[:, 0]
            if corners.max() >= n:
                where = int(corners.argmax())
                raise GltfError(
                    f'{place}: index {where} is {corners[where]}; there are {n} vertices.'
                )
        self._file.spend(3 * corners.nbytes, self._place)
        return self._grouped(corners)

    def _grouped(self, corners):
        mode = self._mode
        width = {_POINTS: 1, _LINES: 2, _TRIANGLES: 3}.get(mode)
        if width is not None:
            if len(corners) % width:
                raise GltfError(
                    f'{self._place} has {len(corners)} indices, not a multiple of {width}.'
                )
            return corners.reshape(-1, width)
        least = 2 if self._wires else 3
        if len(corners) < least:
            raise GltfError(
                f'{self._place} has {len(corners)} indices; {_MODES[mode]} need {least}.'
            )
        if self._wires:
            pairs = np.column_stack([corners, np.roll(corners, -1)])
            return pairs if mode == _LOOP else pairs[:-1]
        a, b, c = corners[:-2], corners[1:-1], corners[2:]
        if mode == _STRIP:
            odd = np.arange(len(a)) % 2 == 1  # every other triangle has reversed winding
            return np.column_stack([a, np.where(odd, c, b), np.where(odd, b, c)])
        return np.column_stack([b, c, np.broadcast_to(corners[0], len(a))])

    @cached_property
    def _vertices(self):
        """Vertices of the mesh, or ``None`` for all, and its cells, shape (t, n)."""
        corners = self._cells.ravel()
        n = self._count('POSITION')
        uses = np.bincount(corners, minlength=n)
        if not self._wires and not self._has('NORMAL') and uses.max() > 1:
            # Without normals a mesh is flat (glTF 2.0, 3.7.2.1): triangles share no vertices.
            return corners, np.arange(len(corners)).reshape(-1, 3)
        if uses.min() > 0:
            return None, self._cells
        used = np.flatnonzero(uses)  # unused vertices must not count in the bounds
        return used, np.searchsorted(used, self._cells)

    def _taken(self, values):
        which = self._vertices[0]
        if which is None:
            return values
        self._file.spend(len(which) * values[:1].nbytes, self._place)
        return values[which]

    def _count(self, name):
        index = self.primitive.attributes[name]
        return self._accessors.count(index, f'{self._place}.attributes.{name}')

    def _check_counts(self):
        n = self._count('POSITION')
        for name in self.primitive.attributes:
            if (count := self._count(name)) != n:
                raise GltfError(
                    f'{self._place}.attributes.{name} has {count} elements, POSITION {n}.'
                )
            known = name in _KNOWN or name in _SETS or name.startswith(('TEXCOORD_', '_'))
            if not known:
                self._file.leave_out(f'attribute {name[:40]}', self._place)
        for number in (0, 1):
            pair = {f'JOINTS_{number}', f'WEIGHTS_{number}'} & set(self.primitive.attributes)
            if len(pair) == 1:
                raise GltfError(
                    f'{self._place}.attributes has {pair.pop()} without its counterpart.'
                )

    def _has(self, name):
        return name in self.primitive.attributes

    def _of(self, name, *types):
        place = f'{self._place}.attributes.{name}'
        return self._taken(self._accessors.floats(self.primitive.attributes[name], place, *types))

    def _joints(self, name):
        place = f'{self._place}.attributes.{name}'
        return self._taken(
            self._accessors.integers(self.primitive.attributes[name], place, 'VEC4')
        )

    def _normals(self, points):
        if self._has('NORMAL'):
            return unit_vectors(self._of('NORMAL', 'VEC3')).astype(np.float32)
        return np.zeros_like(points) if self._wires else _flat(points, self._vertices[1])

    def _coordinates(self):
        number, matrix = self._looks.coordinates(self._material)
        name = f'TEXCOORD_{number}'
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
        differences: dict[str, list] = {what: [] for what in _MORPHED.values()}
        for i, target in enumerate(targets):
            for name, what in _MORPHED.items():
                differences[what].append(self._difference(target, name, i))
            for name in target.keys() - _MORPHED:
                self._file.leave_out(f'morphed {name[:40]}', f'{self._place}.targets[{i}]')
        if not self._has('NORMAL') and not self._wires:
            differences['normals'] = self._flat_differences(points, differences['positions'])
        differences = {
            what: values
            for what, values in differences.items()
            if what == 'positions' or any(value is not None for value in values)
        }
        names = self._names if self._names and len(self._names) == len(targets) else None
        return Morphs(**differences, names=names)

    def _difference(self, target, name, number):
        if name not in target or not self._has(name):
            return None
        if name == 'TANGENT' and not self._has('NORMAL'):
            return None
        key = name, target[name]
        if key not in self._changes:
            self._file.spend(_TARGET, f'{self._place}.targets[{number}]')
            self._changes[key] = self._change(*key, f'{self._place}.targets[{number}].{name}')
        return self._changes[key]

    def _change(self, name, index, place):
        """Return the differences of an attribute by a morph target."""
        n = self._count('POSITION')
        if self._accessors.count(index, place) != n:
            raise GltfError(f'{place} has {self._accessors.count(index, place)} elements of {n}.')
        if name != 'COLOR_0':
            return self._taken(self._accessors.floats(index, place, 'VEC3'))
        change = self._taken(self._accessors.floats(index, place, 'VEC3', 'VEC4'))
        colors = self._of(name, 'VEC3', 'VEC4')
        return self._looks.color_difference(self._material, colors, change)

    def _flat_differences(self, points, positions):
        """Return the differences of each target's face normals from the neutral ones."""
        unlike = {id(moved): moved for moved in positions if moved is not None}
        self._file.spend(12 * len(points) * len(unlike), f'{self._place}.targets')
        points, faces = points.astype(np.float64), self._vertices[1]
        neutral = _flat(points, faces)
        moves, step = list(unlike.values()), max(_BATCH // len(points), 1)
        changes: list = []
        for i in range(0, len(moves), step):
            changes += [*(_flat(points + np.stack(moves[i : i + step]), faces) - neutral)]
        found = dict(zip(unlike, changes, strict=True))
        return [found.get(id(moved)) for moved in positions]


def _polydata(points, cells, normals):
    """Return cells of one, two or three points, in a fifth of the time of PyVista's checks."""
    mesh = pv.PolyData()
    vtk_points = _vtk.vtkPoints()
    vtk_points.SetData(_vtk.numpy_to_vtk(points))
    mesh.SetPoints(vtk_points)
    width = cells.shape[1]
    array = _vtk.vtkCellArray()
    array.SetData(width, _vtk.numpy_to_vtkIdTypeArray(cells.ravel(), deep=True))
    (mesh.SetVerts, mesh.SetLines, mesh.SetPolys)[width - 1](array)
    array = _vtk.numpy_to_vtk(normals)
    array.SetName('Normals')
    mesh.GetPointData().SetNormals(array)
    return mesh


def _flat(points, faces):
    """Return the normals of points (..., v, 3) that no two triangles share."""
    a, b, c = (points[..., corner, :].astype(np.float64) for corner in faces.T)
    u, v = b - a, c - a
    normals = u[..., _NEXT] * v[..., _LAST] - u[..., _LAST] * v[..., _NEXT]
    flat = np.zeros(points.shape, np.float32)
    flat[..., faces, :] = unit_vectors(normals)[..., None, :]
    return flat
