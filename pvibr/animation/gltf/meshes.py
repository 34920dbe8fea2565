"""Primitives of a glTF file as triangle meshes with morph targets and skins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import Skin
from pvibr.animation.gltf.looks import COLORS, Looks
from pvibr.animation.gltf.nodes import bind_of
from pvibr.animation.morphs import WIDTHS, Morphs
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile, naming
from pvibr.formats.gltf_schema import MeshExtras
from pvibr.maths.vectors import unit_vectors

_MODES = ('points', 'lines', 'line loops', 'line strips', 'triangles', 'strips', 'fans')
_TRIANGLES, _STRIP = 4, 5
_KNOWN = ('POSITION', 'NORMAL', 'TANGENT', 'COLOR_0', 'JOINTS_0', 'WEIGHTS_0')
_SETS = ('JOINTS_1', 'WEIGHTS_1')
#: Attributes of morph targets, by their names in glTF.
_MORPHED = dict(zip(('POSITION', 'NORMAL', 'TANGENT', 'COLOR_0'), WIDTHS, strict=True))


@dataclass(frozen=True, eq=False)
class Surface:
    """A primitive as a mesh, and whether it has texture coordinates and vertex colours."""

    mesh: pv.PolyData
    morphs: Morphs | None
    coordinates: bool
    colors: bool


class Primitives:
    """The primitives of a file, each read once."""

    def __init__(self, file: GltfFile, accessors: Accessors, looks: Looks):
        self._file, self._accessors, self._looks = file, accessors, looks
        self._readers: dict[tuple[int, int], _Primitive | None] = {}
        self._surfaces: dict[tuple[int, int], Surface] = {}
        self._skins: dict[tuple, Skin] = {}

    def surface(self, mesh, number) -> Surface | None:
        """Return a primitive as a mesh, or None if it is not supported."""
        reader = self._reader(mesh, number)
        if reader is None:
            return None
        key = (mesh, number)
        if key not in self._surfaces:
            self._surfaces[key] = reader.surface()
        return self._surfaces[key]

    def skin(self, mesh, number, skin) -> Skin | None:
        """Return the influences of a skin on a primitive, or None."""
        reader = self._reader(mesh, number)
        if reader is None or 'JOINTS_0' not in reader.primitive.attributes:
            return None
        key = (mesh, number, skin)
        if key not in self._skins:
            self._skins[key] = reader.skin(skin)
        return self._skins[key]

    def _reader(self, mesh, number):
        key = (mesh, number)
        if key not in self._readers:
            place = f'meshes[{mesh}].primitives[{number}]'
            things = self._file.document.meshes[mesh]
            primitive = things.primitives[number]
            reader = None
            if primitive.mode < _TRIANGLES:
                self._file.leave_out(_MODES[primitive.mode], place)
            elif 'POSITION' not in primitive.attributes:
                self._file.leave_out('a mesh without positions', place)
            else:
                reader = _Primitive(
                    self._file, self._accessors, self._looks, things, number, place
                )
            self._readers[key] = reader
        return self._readers[key]


class _Primitive:
    """One primitive of triangles."""

    def __init__(self, file, accessors, looks, mesh, number, place):
        self._file, self._accessors, self._looks = file, accessors, looks
        self._mesh, self._place = mesh, place
        self.primitive = mesh.primitives[number]
        self._check_counts()

    def surface(self):
        points = self._of('POSITION', 'VEC3')
        coordinates, colors = self._coordinates(), self._colors()
        mesh = pv.PolyData.from_regular_faces(points, self._faces)
        mesh.point_data['Normals'] = self._normals(points)
        mesh.point_data.active_normals_name = 'Normals'
        if coordinates is not None:
            mesh.active_texture_coordinates = coordinates
        if colors is not None:
            mesh.point_data[COLORS] = colors
        if self._has('TANGENT') and self._has('NORMAL'):  # ignored without normals
            mesh.point_data['Tangents'] = self._of('TANGENT', 'VEC4')[:, :3]
        with naming(f'{self._place}.targets'):
            morphs = self._morphs(points)
        return Surface(mesh, morphs, coordinates is not None, colors is not None)

    def skin(self, index):
        self._file.spend(128 * self._count('POSITION'), self._place)
        joints, weights = [], []
        for number in range(2):
            if self._has(f'JOINTS_{number}'):
                joints.append(self._joints(f'JOINTS_{number}'))
                weights.append(self._of(f'WEIGHTS_{number}', 'VEC4'))
        nodes, inverse_bind = bind_of(self._file, self._accessors, index)
        with naming(f'{self._place}.attributes with skins[{index}]'):
            return Skin(nodes, inverse_bind, np.hstack(joints), np.hstack(weights))

    @cached_property
    def _triangles(self):
        """Vertex indices of the triangles in the file, shape (t, 3), int64."""
        n = self._count('POSITION')
        if self.primitive.indices is None:
            self._file.spend(8 * n, self._place)
            corners = np.arange(n)
        else:
            place = f'{self._place}.indices'
            corners = self._accessors.integers(self.primitive.indices, place, 'SCALAR')[:, 0]
            if corners.max() >= n:
                where = int(corners.argmax())
                msg = f'{place}: index {where} is {corners[where]}; there are {n} vertices.'
                raise GltfError(msg)
        self._file.spend(3 * corners.nbytes, self._place)
        return self._grouped(corners)

    def _grouped(self, corners):
        if self.primitive.mode == _TRIANGLES:
            if len(corners) % 3:
                msg = f'{self._place} has {len(corners)} indices, not a multiple of 3.'
                raise GltfError(msg)
            return corners.reshape(-1, 3)
        if len(corners) < 3:
            msg = f'{self._place} has {len(corners)} indices; a strip or fan needs 3.'
            raise GltfError(msg)
        a, b, c = corners[:-2], corners[1:-1], corners[2:]
        if self.primitive.mode == _STRIP:
            odd = np.arange(len(a)) % 2 == 1  # every other triangle has reversed winding
            return np.column_stack([a, np.where(odd, c, b), np.where(odd, b, c)])
        return np.column_stack([b, c, np.broadcast_to(corners[0], len(a))])

    @cached_property
    def _vertices(self):
        """Vertices of the mesh, or ``None`` for all, and its faces, shape (t, 3)."""
        corners = self._triangles.ravel()
        n = self._count('POSITION')
        uses = np.bincount(corners, minlength=n)
        if not self._has('NORMAL') and uses.max() > 1:
            # Without normals a mesh is flat (glTF 2.0, 3.7.2.1): triangles share no vertices.
            return corners, np.arange(len(corners)).reshape(-1, 3)
        if uses.min() > 0:
            return None, self._triangles
        used = np.flatnonzero(uses)  # unused vertices must not count in the bounds
        return used, np.searchsorted(used, self._triangles)

    @property
    def _faces(self):
        return self._vertices[1]

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
                msg = f'{self._place}.attributes.{name} has {count} elements, POSITION {n}.'
                raise GltfError(msg)
            known = name in _KNOWN or name in _SETS or name.startswith(('TEXCOORD_', '_'))
            if not known:
                self._file.leave_out(f'attribute {name[:40]}', self._place)
        for number in (0, 1):
            pair = {f'JOINTS_{number}', f'WEIGHTS_{number}'} & set(self.primitive.attributes)
            if len(pair) == 1:
                msg = f'{self._place}.attributes has {pair.pop()} without its counterpart.'
                raise GltfError(msg)

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
        return _flat(points, self._faces)

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
            for name in set(target) - set(_MORPHED):
                self._file.leave_out(f'morphed {name[:40]}', f'{self._place}.targets[{i}]')
        if not self._has('NORMAL'):
            differences['normals'] = self._flat_differences(points, differences['positions'])
        differences = {
            what: values
            for what, values in differences.items()
            if what == 'positions' or any(value is not None for value in values)
        }
        return Morphs(**differences, names=self._target_names())

    def _difference(self, target, name, number):
        if name not in target or not self._has(name):
            return None
        if name == 'TANGENT' and not self._has('NORMAL'):
            return None
        place = f'{self._place}.targets[{number}].{name}'
        n = self._count('POSITION')
        if self._accessors.count(target[name], place) != n:
            msg = f'{place} has {self._accessors.count(target[name], place)} elements of {n}.'
            raise GltfError(msg)
        if name != 'COLOR_0':
            return self._taken(self._accessors.floats(target[name], place, 'VEC3'))
        change = self._taken(self._accessors.floats(target[name], place, 'VEC3', 'VEC4'))
        colors = self._of(name, 'VEC3', 'VEC4')
        return self._looks.color_difference(self._material, colors, change)

    def _flat_differences(self, points, positions):
        """Return the differences of each target's face normals from the neutral ones."""
        self._file.spend(12 * len(points) * len(positions), f'{self._place}.targets')
        points = points.astype(np.float64)
        neutral = _flat(points, self._faces)
        return [
            None if moved is None else _flat(points + moved, self._faces) - neutral
            for moved in positions
        ]

    def _target_names(self):
        n = len(self.primitive.targets)
        try:
            names = msgspec.json.decode(self._mesh.extras, type=MeshExtras).target_names
        except (msgspec.DecodeError, RecursionError, ValueError):  # extras may be anything
            names = None
        return names if names is not None and len(names) == n else None


def _flat(points, faces):
    """Return the normals of points that no two triangles share."""
    corners = points[faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = np.zeros((len(points), 3))
    flat[faces] = unit_vectors(normals)[:, None]
    return flat.astype(np.float32)
