"""Posed vertices on the GPU: passes that write them, and vertex shaders that fetch them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from pvibr.core.observers import tell_programs
from pvibr.figures.pose_sheet import SAMPLERS, WIDTH, sheet_with_room
from pvibr.figures.shapes import MeshShapes, ShapeStore
from pvibr.gl import release, shader_source, texture_limit
from pvibr.gl.feature import Feature, sections
from pvibr.maths import skinning
from pvibr.scene.shader_draws import pack

#: Most fours of numbers of a pose that are uniforms, and for how many meshes: OpenGL has room for
#: 256, and the texture of many meshes is uploaded once.
_UNIFORM_NUMBERS, _UNIFORM_MESHES = 192, 4


@dataclass(eq=False)
class RestMesh:
    """A mesh at rest, and its deformers."""

    points: np.ndarray
    normals: np.ndarray
    joints: np.ndarray | None = None
    weights: np.ndarray | None = None
    centers: np.ndarray | None = None
    shapes: MeshShapes | None = None

    @cached_property
    def origin(self) -> np.ndarray:
        """Centre of the points, origin of rest positions on the GPU, shape (3,)."""
        return (self.points.min(0) + self.points.max(0)) / 2

    @property
    def n_groups(self) -> int:
        """Joints of a vertex, divided by four."""
        return 0 if self.joints is None else -(-self.joints.shape[1] // 4)


@dataclass(eq=False)
class MeshPose:
    """A pose of a mesh: skinning matrices, origin, and active shapes with their weights."""

    matrices: np.ndarray | None = None
    origin: np.ndarray | None = None
    shapes: np.ndarray | tuple = ()
    amounts: np.ndarray | tuple = ()
    frames: int = 0


class Posing:
    """Posed positions and normals of several meshes, one texel per vertex, in shared textures."""

    def __init__(self, window, rest_meshes, *, poses=1):
        self.poses = poses
        heights = [-(-len(m.points) // WIDTH) for m in rest_meshes]
        blocks = [max(m.n_groups, 1) * h for m, h in zip(rest_meshes, heights, strict=True)]
        sheet = sheet_with_room(window, sum(blocks), sum(heights) * poses)
        if sheet is None:
            asked = f'{sum(len(m.points) for m in rest_meshes)} vertices in {poses} poses'
            raise ValueError(
                f'the figure has {asked}; at most {texture_limit(window) * WIDTH} fit here.'
            )
        self._sheet = sheet
        first = sheet.take(sum(heights) * poses)
        #: First row of each mesh, and the end of them.
        self.rows = np.cumsum([first, *(h * poses for h in heights)]).tolist()
        self._rest: list[tuple[int, int]] = []
        self._meshes: list[_Mesh] = []
        try:
            for k, mesh in enumerate(rest_meshes):
                at_rest = sheet.load(_images(mesh))
                self._rest.append((at_rest, blocks[k]))
                self._meshes.append(_Mesh(sheet, mesh, heights[k], at_rest, self.rows[k]))
        except BaseException:
            self.release()
            raise

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        rows = 2 * (self.rows[-1] - self.rows[0]) + 4 * sum(n for _, n in self._rest)
        stored = sum(m.store.nbytes for m in self._meshes if m.store is not None)
        return 16 * WIDTH * rows + stored

    def draw(self, places, *, how='linear', bulge=1.0):
        """Pose all meshes, each in its poses."""
        draw_together(self.passes(places, how, bulge))

    def passes(self, places, how, bulge) -> list[_Pass]:
        """Return what poses the meshes."""
        pairs = zip(self._meshes, places, strict=True)
        return [_Pass(mesh, mesh.numbers(poses, how), how, bulge) for mesh, poses in pairs]

    def bind(self) -> dict[str, int]:
        """Keep the posed vertices bound; return the texture units by samplers."""
        return self._sheet.bind()

    def unbind(self):
        """Give the texture units back."""
        self._sheet.unbind()

    def download(self, rest_mesh, pose=0):
        """Return posed positions and normals of a mesh, for tests."""
        mesh = self._meshes[rest_mesh]
        texels = self._sheet.posed.download(mesh.first + pose * mesh.rows, mesh.rows)
        positions, normals = (t.reshape(-1, 4)[: mesh.count, :3] for t in texels)
        return positions, normals

    def release(self):
        """Release all GPU resources; the context must be alive."""
        release(*(mesh.store for mesh in self._meshes))
        self._sheet.give(self._rest, (self.rows[0], self.rows[-1] - self.rows[0]))


def draw_together(passes):
    """Pose meshes, of any figures in a window."""
    sheets: dict = {}
    for one in passes:
        sheets.setdefault(one.mesh.sheet, []).append(one)
    for sheet, passes in sheets.items():
        sheet.unbind()
        few = len(passes) <= _UNIFORM_MESHES and all(p.is_small for p in passes)
        runs = [([p], p.own_numbers()) for p in passes] if few else _runs(passes)
        if not few:
            sheet.upload(*_state(passes, sheet.posed.height))
        with sheet.posed.drawing():
            for (one, *others), numbers in runs:
                rows = one.n_rows + sum(p.n_rows for p in others)
                defines, uniforms, textures = one.settings()
                defines['NUMBERS'] = len(numbers.get('ibr_numbers', ()))
                sheet.draw(one.mesh.first, rows, defines, uniforms | numbers, textures)


def _runs(passes) -> list[tuple[list[_Pass], dict]]:
    """Return passes that one draw does: their rows touch, and their programs are the same."""
    runs: list = []
    for found in sorted(passes, key=lambda p: p.mesh.first):
        last = runs[-1][0][-1] if runs else None
        if last and last.end == found.mesh.first and last.program == found.program:
            runs[-1][0].append(found)
        else:
            runs.append(([found], {}))
    return runs


def _state(passes, height) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of all poses, and for each row of the target what of them makes it."""
    numbers = [found for p in passes for found in p.numbers]
    sizes = [len(found) for found in numbers]
    meshes = [(p.mesh, k) for p in passes for k in range(len(p.numbers))]
    table = [(m.first + k * m.rows, m.rest, m.rows, m.palette) for m, k in meshes]
    row, rest, rows, palette = np.array(table).T
    within = np.arange(rows.sum()) - np.repeat(np.cumsum(rows) - rows, rows)
    starts = np.cumsum(sizes) - sizes
    places = np.zeros((height, 4))
    columns = [np.repeat(v, rows) for v in (rest, starts, rows, palette)]
    places[np.repeat(row, rows) + within] = np.stack(columns, 1)
    places[np.repeat(row, rows) + within, 0] += within
    return np.concatenate(numbers), places


class _Mesh:
    """A mesh in a sheet: its rows at rest, and the first of its posed ones."""

    def __init__(self, sheet, rest_mesh, rows, rest, first):
        self.sheet = sheet
        self.rest_mesh, self.rows, self.rest, self.first = rest_mesh, rows, rest, first
        self.count, self.origin = len(rest_mesh.points), rest_mesh.origin
        shapes = rest_mesh.shapes
        self.store = None if shapes is None else ShapeStore(sheet.window, shapes)
        #: Fours of numbers of the joints, before the shapes.
        self.palette = 0

    def numbers(self, places, how):
        """Return the state of each pose as rows of four: joints, then shapes."""
        palettes = [self._palette(place, how) for place in places]
        self.palette = len(palettes[0])
        if self.store is None:
            return palettes
        shapes = _shapes(self.store, places)
        return [np.concatenate(pair) for pair in zip(palettes, shapes, strict=True)]

    def _palette(self, place, how):
        """Return the skinning matrices as rows of four, relative to the origins."""
        if place.matrices is None:
            return np.zeros((0, 4))
        matrices = np.array(place.matrices, np.float64)
        matrices[:, :3, 3] += matrices[:, :3, :3] @ self.origin - place.origin
        linear = matrices[:, :3]
        if how == 'linear':
            return linear.reshape(-1, 4)
        centers = self.rest_mesh.centers - self.origin
        real, dual, stretch = skinning.dual_parts(matrices, centers)
        joints = (stretch, linear, real[:, None], dual[:, None])
        return np.concatenate(joints, 1).reshape(-1, 4)


def _shapes(store, places):
    """Return counts and shapes of each pose as rows of four; load missing shapes."""
    where = store.places({int(i) for place in places for i in place.shapes})
    out = []
    for place in places:
        rows = np.zeros((1 + len(place.shapes), 4))
        rows[0, :2] = place.frames, len(place.shapes)
        rows[1:, 0] = [where[int(i)] for i in place.shapes]
        rows[1:, 1] = place.amounts
        out.append(rows)
    return out


class _Pass:
    """How a mesh is posed, once or in several poses."""

    def __init__(self, mesh, numbers, how, bulge):
        self.mesh, self.numbers, self.bulge = mesh, numbers, float(bulge)
        groups = mesh.rest_mesh.n_groups
        self._dual = how == 'dual' and groups > 0
        #: What must be the same to be drawn together.
        self.program = groups, self._dual and self.bulge, mesh.store

    @property
    def n_rows(self) -> int:
        """Rows of all poses."""
        return self.mesh.rows * len(self.numbers)

    @property
    def end(self) -> int:
        """First row after its own."""
        return self.mesh.first + self.n_rows

    @property
    def is_small(self) -> bool:
        """Whether its state fits into uniforms."""
        return len(self.numbers) == 1 and len(self.numbers[0]) <= _UNIFORM_NUMBERS

    def own_numbers(self) -> dict:
        """Return its state as uniforms, a power of two of them to share programs."""
        (found,), mesh = self.numbers, self.mesh
        block = np.zeros((4 << (-(-len(found) // 4) - 1).bit_length(), 4))
        block[: len(found)] = found
        return {
            'ibr_numbers': block.reshape(-1, 4, 4).swapaxes(1, 2),
            'ibr_place': (mesh.rest - mesh.first, 0, mesh.rows, mesh.palette),
        }

    def settings(self) -> tuple[dict, dict, dict]:
        """Return defines, uniforms and textures of its program."""
        store = self.mesh.store
        defines = {'GROUPS': self.program[0], 'DUAL': self._dual, 'SHAPES': store is not None}
        uniforms = {'ibr_bulge': self.bulge}
        if store is None:
            return defines, uniforms, {}
        uniforms |= {'ibr_shape_share': store.share, 'ibr_shape_first': float(self.mesh.rest)}
        return defines, uniforms, dict(store.textures)


def _images(rest_mesh) -> list[np.ndarray]:
    """Return rest positions and normals, joints and weights as images."""
    vectors = rest_mesh.points - rest_mesh.origin, rest_mesh.normals
    return [*(pack(_four(v), WIDTH, 4) for v in vectors), *_influences(rest_mesh)]


def _four(vectors):
    return np.pad(np.asarray(vectors, np.float32), ((0, 0), (0, -vectors.shape[1] % 4)))


def _influences(rest_mesh):
    """Return joints and weights as images, heaviest first, four per texel, stacked."""
    if rest_mesh.joints is None:
        return [np.zeros((1, WIDTH, 4), np.float32)] * 2
    order = np.argsort(-rest_mesh.weights, axis=1, kind='stable')
    tables = []
    for values in (rest_mesh.joints, rest_mesh.weights):
        padded = _four(np.take_along_axis(values, order, 1))
        columns = [padded[:, i : i + 4] for i in range(0, padded.shape[1], 4)]
        tables.append(np.concatenate([pack(np.ascontiguousarray(c), WIDTH, 4) for c in columns]))
    return tables


class PosedDraws:
    """Binds the textures of a posing to the draws of some mappers, each time anew.

    There are far fewer texture units than figures in a scene.
    """

    posing: Posing | None = None

    def watch(self, mapper):
        """Bind the textures whenever a mapper draws."""
        tell_programs(mapper, self._bind)

    def _bind(self, program):
        if self.posing is not None:
            for name, unit in self.posing.bind().items():
                program.SetUniformi(name, unit)

    def unbind(self):
        """Give the texture units back."""
        if self.posing is not None:
            self.posing.unbind()


@lru_cache(maxsize=1)
def posed_feature() -> Feature:
    """Return the shader feature that fetches posed vertices."""
    text = sections(shader_source(__file__))
    samplers = ''.join(f'uniform sampler2D {name};\n' for name in SAMPLERS)
    declare = f'//VTK::CustomUniforms::Dec\n{samplers}{text["vertex.declare"]}'
    begin = f'#define WIDTH {WIDTH}u\n{text["vertex.begin"]}'
    vertex = {
        'VTK::CustomUniforms::Dec': declare,
        'VTK::CustomBegin::Impl': begin,
        'VTK::Normal::Impl': text['vertex.normal'],
    }
    return Feature('posed', vertex)
