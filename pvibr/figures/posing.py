"""Posed vertices on the GPU: passes that write them, and vertex shaders that fetch them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from pvibr.animation import skinning
from pvibr.core.observers import tell_programs
from pvibr.figures.pose_sheet import SAMPLERS, WIDTH, sheet_with_room
from pvibr.figures.shapes import MeshShapes, ShapeStore
from pvibr.gl import release, set_shared_uniforms, shader_source, texture_limit
from pvibr.gl.feature import Feature, sections
from pvibr.instances.memory import limit_bytes
from pvibr.things.shader_draws import pack

#: Most vec4s of a pose that are passed as uniforms, and for how many meshes: OpenGL has room for
#: 256, and many meshes share one texture upload.
_UNIFORM_NUMBERS, _UNIFORM_MESHES = 192, 4


#: Poses of a mesh from which a draw of its own pays, as wide as it has vertices.
_MANY_POSES = 16
#: Bytes of a posed vertex, and the share of the GPU's memory for images that poses may take.
_VERTEX_BYTES, _MEMORY_SHARE = 32, 0.25


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
    """A pose of a mesh: skinning matrices, origin, and active shapes with their weights.

    With an axis of poses before the others of `matrices`, it is as many poses.
    """

    matrices: np.ndarray | None = None
    origin: np.ndarray | None = None
    shapes: np.ndarray | tuple = ()
    amounts: np.ndarray | tuple = ()
    frames: int = 0

    def __getitem__(self, poses) -> MeshPose:
        """Return some of its many poses."""
        return replace(self, matrices=None if self.matrices is None else self.matrices[poses])


def pose_rows(rest_meshes) -> tuple[int, int]:
    """Return the rows of a pose of meshes, and those of the meshes at rest; at least one."""
    rows = [-(-len(mesh.points) // WIDTH) for mesh in rest_meshes]
    rest_rows = [max(mesh.n_groups, 1) * n for mesh, n in zip(rest_meshes, rows, strict=True)]
    return max(sum(rows), 1), max(sum(rest_rows), 1)


def pose_budget() -> float:
    """Return the bytes that the poses of a crowd may take."""
    return limit_bytes() * _MEMORY_SHARE


def most_poses(window, row_counts, share=1.0) -> int:
    """Return how many poses fit one texture and a share of what poses may take.

    The rows are those of `pose_rows`. 0 if textures have no room for one pose, or the rest.
    """
    limit = texture_limit(window)
    if max(row_counts) > limit:
        return 0
    affordable_rows = share * pose_budget() // (_VERTEX_BYTES * WIDTH)
    return max(int(min(limit, affordable_rows) // row_counts[0]), 1)


class Posing:
    """Posed positions and normals of several meshes, one texel per vertex, in shared textures."""

    def __init__(self, window, rest_meshes, *, poses=1):
        self.poses = poses
        row_counts = [-(-len(m.points) // WIDTH) for m in rest_meshes]
        rest_rows = [max(m.n_groups, 1) * h for m, h in zip(rest_meshes, row_counts, strict=True)]
        sheet = sheet_with_room(window, sum(rest_rows), sum(row_counts) * poses)
        if sheet is None:
            raise ValueError(
                f'figure must have at most {texture_limit(window) * WIDTH} vertices in all its '
                f'poses, got {sum(len(m.points) for m in rest_meshes)} in {poses} poses'
            )
        self._sheet = sheet
        first_row = sheet.take(sum(row_counts) * poses)
        #: First row of each mesh, and the end of them.
        self.rows = np.cumsum([first_row, *(h * poses for h in row_counts)]).tolist()
        self._rest: list[tuple[int, int]] = []
        self._meshes: list[_Mesh] = []
        try:
            for k, mesh in enumerate(rest_meshes):
                rest_row = sheet.load(_images(mesh))
                self._rest.append((rest_row, rest_rows[k]))
                self._meshes.append(_Mesh(sheet, mesh, row_counts[k], rest_row, self.rows[k]))
        except BaseException:
            self.release()
            raise

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        row_count = 2 * (self.rows[-1] - self.rows[0]) + 4 * sum(n for _, n in self._rest)
        shape_bytes = sum(m.store.nbytes for m in self._meshes if m.store is not None)
        return 16 * WIDTH * row_count + shape_bytes

    def draw(self, mesh_poses, *, skinning_mode='linear', bulge=1.0, span=None):
        """Pose all meshes, each in a list of poses or in a `MeshPose` of many, or a span of it."""
        first, end = span or (0, self.poses)
        draw_together(
            self.passes([poses[first:end] for poses in mesh_poses], skinning_mode, bulge, first)
        )

    def passes(self, mesh_poses, skinning, bulge, first=0) -> list[_Pass]:
        """Return the passes that pose the meshes, in poses from the first one on."""
        pairs = zip(self._meshes, mesh_poses, strict=True)
        return [
            _Pass(m, m.pose_states(poses, skinning), skinning, bulge, first) for m, poses in pairs
        ]

    @property
    def textures(self) -> dict:
        """The posed vertices by sampler."""
        return self._sheet.posed.textures

    def bind(self) -> dict[str, int]:
        """Bind the posed vertices; return the texture units by sampler."""
        return self._sheet.bind()

    def unbind(self):
        """Release the texture units."""
        self._sheet.unbind()

    def download(self, rest_mesh, pose_index=0):
        """Return posed positions and normals of a mesh, for tests."""
        mesh = self._meshes[rest_mesh]
        texels = self._sheet.posed.download(mesh.first + pose_index * mesh.rows, mesh.rows)
        positions, normals = (t.reshape(-1, 4)[: mesh.count, :3] for t in texels)
        return positions, normals

    def release(self):
        """Release all GPU resources; the context must be alive."""
        release(*(mesh.store for mesh in self._meshes))
        self._sheet.give(self._rest, (self.rows[0], self.rows[-1] - self.rows[0]))


def draw_together(passes):
    """Pose meshes, of any figures in a window."""
    passes_by_sheet: dict = {}
    for pose_pass in passes:
        passes_by_sheet.setdefault(pose_pass.mesh.sheet, []).append(pose_pass)
    for sheet, passes in passes_by_sheet.items():
        sheet.unbind()
        fits_uniforms = len(passes) <= _UNIFORM_MESHES and all(p.is_small for p in passes)
        draw_runs = [([p], p.uniform_state()) for p in passes] if fits_uniforms else _runs(passes)
        if not fits_uniforms:
            sheet.upload(*_texture_state(passes, sheet.posed.height))
        with sheet.posed.drawing():
            for (first_pass, *more_passes), pose_uniforms in draw_runs:
                n_rows = first_pass.n_rows + sum(p.n_rows for p in more_passes)
                defines, uniforms, textures = first_pass.settings()
                defines['NUMBERS'] = len(pose_uniforms.get('ibr_numbers', ()))
                pose_uniforms |= uniforms
                size = first_pass.width, n_rows
                sheet.draw(first_pass.first, size, defines, pose_uniforms, textures)


def _runs(passes) -> list[tuple[list[_Pass], dict]]:
    """Group passes into draws: adjacent rows, same program."""
    draw_runs: list = []
    for pose_pass in sorted(passes, key=lambda p: p.first):
        last_pass = draw_runs[-1][0][-1] if draw_runs else None
        place = pose_pass.first, pose_pass.program
        if last_pass and (last_pass.end, last_pass.program) == place:
            draw_runs[-1][0].append(pose_pass)
        else:
            draw_runs.append(([pose_pass], {}))
    return draw_runs


def _texture_state(passes, height) -> tuple[np.ndarray, np.ndarray]:
    """Return the state of all poses, and for each row of the target which of it to read."""
    value_counts = np.concatenate([p.value_counts() for p in passes])
    posed_meshes = [(p, p.mesh, k) for p in passes for k in range(len(p.pose_states))]
    table = [(p.first + k * m.rows, m.rest, m.rows, m.palette) for p, m, k in posed_meshes]
    first_rows, rest_rows, counts, palette_sizes = np.array(table).T
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    starts = np.cumsum(value_counts) - value_counts
    row_places = np.zeros((height, 4))
    place_columns = [np.repeat(v, counts) for v in (rest_rows, starts, counts, palette_sizes)]
    row_places[np.repeat(first_rows, counts) + within] = np.stack(place_columns, 1)
    row_places[np.repeat(first_rows, counts) + within, 0] += within
    return np.concatenate([np.concatenate(p.pose_states) for p in passes]), row_places


class _Mesh:
    """A mesh in a sheet: its rows at rest, and the first of its posed ones."""

    def __init__(self, sheet, rest_mesh, row_count, rest_row, first_row):
        self.sheet = sheet
        self.rest_mesh, self.rows = rest_mesh, row_count
        self.rest, self.first = rest_row, first_row
        self.count, self.origin = len(rest_mesh.points), rest_mesh.origin
        shapes = rest_mesh.shapes
        self.store = None if shapes is None else ShapeStore(sheet.window, shapes)
        #: Vec4s of the joints, before the shapes.
        self.palette = 0

    def pose_states(self, mesh_poses, skinning_mode):
        """Return the state of each pose as rows of four: joints, then shapes."""
        joint_palettes = self._palettes(mesh_poses, skinning_mode)
        self.palette = len(joint_palettes[0])
        if self.store is None:
            return joint_palettes
        shapes = _shapes(self.store, mesh_poses)
        return [np.concatenate(pair) for pair in zip(joint_palettes, shapes, strict=True)]

    def _palettes(self, mesh_poses, skinning_mode) -> list | np.ndarray:
        """Return the skinning matrices of each pose as rows of four, relative to the origins."""
        if isinstance(mesh_poses, MeshPose):
            matrices = np.array(mesh_poses.matrices, np.float64)
            pose_origins = np.asarray(mesh_poses.origin)
        elif mesh_poses[0].matrices is None:
            return [np.zeros((0, 4))] * len(mesh_poses)
        else:
            matrices = np.array([pose.matrices for pose in mesh_poses], np.float64)
            pose_origins = np.array([pose.origin for pose in mesh_poses])[:, None]
        matrices[:, :, :3, 3] += matrices[:, :, :3, :3] @ self.origin - pose_origins
        linear_parts = matrices[:, :, :3]
        if skinning_mode == 'linear':
            return linear_parts.reshape(len(matrices), -1, 4)
        centers, palettes = self.rest_mesh.centers - self.origin, []
        for pose_matrices in matrices:
            real, dual, stretch = skinning.dual_parts(pose_matrices, centers)
            joint_rows = stretch, pose_matrices[:, :3], real[:, None], dual[:, None]
            palettes.append(np.concatenate(joint_rows, 1).reshape(-1, 4))
        return palettes


def _shapes(store, mesh_poses):
    """Return counts and shapes of each pose as rows of four; load missing shapes."""
    row_by_shape = store.places({int(i) for mesh_pose in mesh_poses for i in mesh_pose.shapes})
    shape_rows = []
    for mesh_pose in mesh_poses:
        pose_rows = np.zeros((1 + len(mesh_pose.shapes), 4))
        pose_rows[0, :2] = mesh_pose.frames, len(mesh_pose.shapes)
        pose_rows[1:, 0] = [row_by_shape[int(i)] for i in mesh_pose.shapes]
        pose_rows[1:, 1] = mesh_pose.amounts
        shape_rows.append(pose_rows)
    return shape_rows


class _Pass:
    """How a mesh is posed, once or in several poses."""

    def __init__(self, mesh, pose_states, skinning_mode, bulge, first_pose=0):
        self.mesh, self.pose_states, self.bulge = mesh, pose_states, float(bulge)
        #: Its first row.
        self.first = mesh.first + first_pose * mesh.rows
        #: Texels of a row that are drawn: all, unless many poses of few vertices waste them.
        self.width = WIDTH if len(pose_states) < _MANY_POSES else min(mesh.count, WIDTH)
        group_count = mesh.rest_mesh.n_groups
        self._dual = skinning_mode == 'dual' and group_count > 0
        #: Key of the passes that one draw can combine.
        self.program = group_count, self._dual and self.bulge, mesh.store, self.width

    def value_counts(self) -> np.ndarray:
        """Return the rows of numbers of each pose."""
        if isinstance(self.pose_states, np.ndarray):
            return np.full(len(self.pose_states), self.pose_states.shape[1])
        return np.array([len(pose_values) for pose_values in self.pose_states])

    @property
    def n_rows(self) -> int:
        """Rows of all poses."""
        return self.mesh.rows * len(self.pose_states)

    @property
    def end(self) -> int:
        """First row after its own."""
        return self.first + self.n_rows

    @property
    def is_small(self) -> bool:
        """Whether its state fits into uniforms."""
        return len(self.pose_states) == 1 and len(self.pose_states[0]) <= _UNIFORM_NUMBERS

    def uniform_state(self) -> dict:
        """Return its state as uniforms, padded to a power of two to share programs."""
        (pose_values,), mesh = self.pose_states, self.mesh
        value_block = np.zeros((4 << (-(-len(pose_values) // 4) - 1).bit_length(), 4))
        value_block[: len(pose_values)] = pose_values
        return {
            'ibr_numbers': value_block.reshape(-1, 4, 4).swapaxes(1, 2),
            'ibr_place': (mesh.rest - self.first, 0, mesh.rows, mesh.palette),
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
    weight_order = np.argsort(-rest_mesh.weights, axis=1, kind='stable')
    images = []
    for values in (rest_mesh.joints, rest_mesh.weights):
        padded_values = _four(np.take_along_axis(values, weight_order, 1))
        columns = [padded_values[:, i : i + 4] for i in range(0, padded_values.shape[1], 4)]
        images.append(np.concatenate([pack(np.ascontiguousarray(c), WIDTH, 4) for c in columns]))
    return images


class PosedDraws:
    """Binds the textures of a posing whenever one of its mappers draws.

    There are far fewer texture units than figures in a scene.
    """

    posing: Posing | None = None

    def watch(self, mapper):
        """Bind the textures whenever a mapper draws."""
        tell_programs(mapper, self._bind)

    def _bind(self, program):
        if self.posing is not None:
            set_shared_uniforms(program, self.posing.bind())

    def unbind(self):
        """Release the texture units."""
        if self.posing is not None:
            self.posing.unbind()


@lru_cache(maxsize=1)
def posed_feature() -> Feature:
    """Return the shader feature that fetches posed vertices."""
    shader_sections = sections(shader_source(__file__))
    samplers = ''.join(f'uniform sampler2D {name};\n' for name in SAMPLERS)
    declarations = f'//VTK::CustomUniforms::Dec\n{samplers}{shader_sections["vertex.declare"]}'
    vertex_begin = f'#define WIDTH {WIDTH}u\n{shader_sections["vertex.begin"]}'
    vertex = {
        'VTK::CustomUniforms::Dec': declarations,
        'VTK::CustomBegin::Impl': vertex_begin,
        'VTK::Normal::Impl': shader_sections['vertex.normal'],
    }
    return Feature('posed', vertex)
