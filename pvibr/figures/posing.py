"""Posed vertices on the GPU: a pass that writes them, and vertex shaders that fetch them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from pvibr.figures.shapes import MeshShapes, ShapeStore
from pvibr.gl import Quad, Target, Texture, shader_source, texture_limit
from pvibr.gl.feature import Feature, declared_samplers, sections
from pvibr.maths import skinning
from pvibr.scene.shader_draws import pack

#: Vertices of a row of the textures.
WIDTH = 1024
_STATE_WIDTH = 4096
_TEXELS = {'linear': 3, 'dual': 8}  # per joint


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


@dataclass(eq=False)
class MeshPose:
    """A pose of a mesh: skinning matrices, origin, and active shapes with their weights."""

    matrices: np.ndarray | None = None
    origin: np.ndarray | None = None
    shapes: np.ndarray | tuple = ()
    amounts: np.ndarray | tuple = ()
    frames: int = 0


class Posing:
    """Posed positions and normals of several meshes in two textures, one texel per vertex."""

    def __init__(self, window, rest_meshes, *, poses=1, how='linear'):
        self.window, self.poses, self.how = window, poses, how
        heights = [-(-len(m.points) // WIDTH) * poses for m in rest_meshes]
        #: First row of each mesh.
        self.rows = np.cumsum([0, *heights]).tolist()
        limit = texture_limit(window)
        if self.rows[-1] > limit:
            asked = f'{sum(len(m.points) for m in rest_meshes)} vertices in {poses} poses'
            msg = f'the figure has {asked}; at most {limit * WIDTH} fit here.'
            raise ValueError(msg)
        self._state = Texture(window)
        self._passes = [_MeshPass(window, m, poses, how) for m in rest_meshes]
        self.target = Target(
            window, WIDTH, self.rows[-1], ('rgba32f', 'rgba32f'), filter='nearest'
        )

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes + self._state.nbytes + sum(c.nbytes for c in self._passes)

    @property
    def textures(self) -> dict[str, Texture]:
        """Positions and normals, by the names of their samplers."""
        return dict(zip(SAMPLERS, self.target.colors, strict=True))

    def draw(self, places, *, bulge=1.0):
        """Pose all meshes, each in its poses."""
        self._load([c.numbers(poses) for c, poses in zip(self._passes, places, strict=True)])
        state = self.window.GetState()
        with self.target.drawing():
            for mesh_pass, first, end in zip(self._passes, self.rows, self.rows[1:], strict=False):
                state.vtkglViewport(0, first, WIDTH, end - first)
                state.vtkglScissor(0, first, WIDTH, end - first)
                mesh_pass.draw(bulge, self._state)

    def _load(self, numbers):
        """Upload the state of all poses in one image: each upload has a fixed cost."""
        most = max((len(n) for poses in numbers for n in poses), default=0)
        width = min(max(most, 1), _STATE_WIDTH)
        blocks: list[np.ndarray] = []
        for mesh_pass, poses in zip(self._passes, numbers, strict=True):
            rows = max(-(-max(len(n) for n in poses) // width), 1)
            block = np.zeros((len(poses), rows * width, 4), np.float32)
            for row, found in zip(block, poses, strict=True):
                row[: len(found)] = found
            mesh_pass.uniforms |= {
                'ibr_state_first': sum(len(b) for b in blocks),
                'ibr_state_rows': rows,
            }
            blocks.append(block.reshape(-1, width, 4))
        state = np.concatenate(blocks)
        for mesh_pass in self._passes:
            mesh_pass.uniforms['ibr_state_sides'] = (width, len(state))
        self._state.upload(state)

    def download(self, rest_mesh, pose=0):
        """Return posed positions and normals of a mesh, for tests."""
        mesh_pass = self._passes[rest_mesh]
        first = self.rows[rest_mesh] + pose * mesh_pass.rows
        texels = [t.download()[first : first + mesh_pass.rows] for t in self.target.colors]
        positions, normals = (t.reshape(-1, 4)[: mesh_pass.count, :3] for t in texels)
        return positions, normals

    def release(self):
        """Release all GPU resources; the context must be alive."""
        for mesh_pass in self._passes:
            mesh_pass.release()
        self._state.release()
        self.target.release()


class _MeshPass:
    """The posing pass of one mesh."""

    def __init__(self, window, rest_mesh, poses, how):
        self.count, self.how, self.poses = len(rest_mesh.points), how, poses
        self.rows = -(-self.count // WIDTH)
        self.origin, self.centers = rest_mesh.origin, rest_mesh.centers
        self.textures = {
            'ibr_rest': _table(window, rest_mesh.points - self.origin),
            'ibr_rest_normals': _table(window, rest_mesh.normals),
        }
        groups = 0
        if rest_mesh.joints is not None:
            groups = -(-rest_mesh.joints.shape[1] // 4)
            joints, weights = _influences(rest_mesh)
            self.textures['ibr_joints'] = Texture(window).upload(joints)
            self.textures['ibr_weights'] = Texture(window).upload(weights)
        shapes = rest_mesh.shapes
        self.store = None if shapes is None else ShapeStore(window, shapes, WIDTH)
        palette = 0 if rest_mesh.centers is None else len(rest_mesh.centers) * _TEXELS[how]
        most = palette + 1 + (0 if shapes is None else len(shapes))
        self.quad = _quad(
            window,
            {
                'GROUPS': groups,
                'DUAL': how == 'dual' and groups > 0,
                'SHAPES': self.store is not None,
                'WRAP': most > _STATE_WIDTH,
            },
        )
        self.uniforms: dict[str, float | tuple] = {'ibr_poses': float(poses)}

    @property
    def nbytes(self) -> int:
        stored = 0 if self.store is None else self.store.nbytes
        return sum(t.nbytes for t in self.textures.values()) + stored

    def numbers(self, places):
        """Return the state of each pose as rows of four: joints, then shapes."""
        palettes = [self._palette(place) for place in places]
        self.uniforms['ibr_palette'] = len(palettes[0])
        shapes = self._shapes(places)
        return [np.concatenate(pair) for pair in zip(palettes, shapes, strict=True)]

    def _palette(self, place):
        """Return the skinning matrices as rows of four, relative to the origins."""
        if place.matrices is None:
            return np.zeros((0, 4))
        matrices = np.array(place.matrices, np.float64)
        matrices[:, :3, 3] += matrices[:, :3, :3] @ self.origin - place.origin
        linear = matrices[:, :3]
        if self.how == 'linear':
            return linear.reshape(-1, 4)
        real, dual, stretch = skinning.dual_parts(matrices, self.centers - self.origin)
        joints = (stretch, linear, real[:, None], dual[:, None])
        return np.concatenate(joints, 1).reshape(-1, 4)

    def _shapes(self, places):
        """Return counts and shapes of each pose as rows of four; load missing shapes."""
        if self.store is None:
            return [np.zeros((0, 4))] * len(places)
        slots = self.store.slots({int(i) for place in places for i in place.shapes})
        out = []
        for place in places:
            rows = np.zeros((1 + len(place.shapes), 4))
            rows[0, :2] = place.frames, len(place.shapes)
            rows[1:, 0] = [slots[int(i)] for i in place.shapes]
            rows[1:, 1] = place.amounts
            out.append(rows)
        return out

    def draw(self, bulge, state):
        textures = self.textures | {'ibr_state': state}
        if self.store is not None:
            textures |= self.store.textures
            self.uniforms['ibr_shape_share'] = self.store.share
        self.quad.draw(self.uniforms | {'ibr_bulge': float(bulge)}, textures)

    def release(self):
        for owner in (*self.textures.values(), self.store, self.quad):
            if owner is not None:
                owner.release()


def _table(window, vectors):
    aligned = np.zeros((len(vectors), 4), np.float32)  # drivers read four channels faster
    aligned[:, :3] = vectors
    return Texture(window).upload(pack(aligned, WIDTH, 4))


def _influences(rest_mesh):
    """Return joints and weights as images, heaviest first, four per texel, stacked."""
    order = np.argsort(-rest_mesh.weights, axis=1, kind='stable')
    tables = []
    for values in (rest_mesh.joints, rest_mesh.weights):
        ordered = np.take_along_axis(values, order, 1).astype(np.float32)
        padded = np.pad(ordered, ((0, 0), (0, -ordered.shape[1] % 4)))
        columns = [padded[:, i : i + 4] for i in range(0, padded.shape[1], 4)]
        tables.append(np.concatenate([pack(np.ascontiguousarray(c), WIDTH, 4) for c in columns]))
    return tables


def _quad(window, defines):
    head = ''.join(f'#define {name} {int(value)}\n' for name, value in defines.items())
    return Quad(window, head + sections(shader_source(__file__))['pose'], 'posing')


#: Samplers of the textures that vertex shaders read.
SAMPLERS = ('ibr_posed', 'ibr_posed_normals')


@lru_cache(maxsize=1)
def posed_feature() -> Feature:
    """Return the shader feature that fetches posed vertices."""
    text = sections(shader_source(__file__))
    declare = declared_samplers(dict.fromkeys(SAMPLERS, 'sampler2D')) + text['vertex.declare']
    begin = f'#define WIDTH {WIDTH}u\n{text["vertex.begin"]}'
    vertex = {
        'VTK::CustomUniforms::Dec': declare,
        'VTK::CustomBegin::Impl': begin,
        'VTK::Normal::Impl': text['vertex.normal'],
    }
    return Feature('posed', vertex)
