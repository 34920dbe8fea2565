"""One mesh of a figure and its deformers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np
import pyvista as pv

from pvibr.animation import skinning
from pvibr.animation.morphs import Morphs
from pvibr.animation.normals import normals_at, point_normals
from pvibr.animation.pose import as_matrices
from pvibr.animation.skeleton import whole_numbers
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.core._vtk import address
from pvibr.core.arguments import check_one_of
from pvibr.maths.transforms import signs_of

SKINNINGS = ('linear', 'dual')


class Skin:
    """The influences of joints on vertices.

    Parameters
    ----------
    nodes : array_like of int, shape (m,)
        Joints of the figure's skeleton that influence the mesh.
    inverse_bind : array_like, shape (m, 4, 4)
        Inverse bind matrices, ``joint_from_mesh`` at rest.
    joints : array_like of int, shape (v, k)
        For each vertex up to eight rows of ``nodes``.
    weights : array_like, shape (v, k)
        Their blend weights, normalised to sum to one.

    Raises
    ------
    ValueError
        If a joint is out of range, weights are negative or all zero (the vertices are named), or
        shapes do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.animation import Skin
    >>> Skin([0], [np.eye(4)], [[0]], [[2.0]]).weights.tolist()
    [[1.0]]
    """

    def __init__(self, nodes, inverse_bind, joints, weights):
        self.nodes = whole_numbers(nodes, 'nodes')
        self.inverse_bind = as_matrices(inverse_bind, 'inverse_bind')
        self.weights = skinning.normalized_weights(weights)
        self.joints = np.array(joints)
        if self.inverse_bind.shape != (len(self.nodes), 4, 4):
            shape = self.inverse_bind.shape
            raise ValueError(f'inverse_bind must be ({len(self.nodes)}, 4, 4), got {shape}')
        if self.joints.shape != self.weights.shape or self.joints.dtype.kind not in 'iu':
            raise ValueError(
                f'joints must be whole numbers of shape {self.weights.shape}, got '
                f'{self.joints.dtype} of shape {self.joints.shape}'
            )
        for row, column in np.argwhere((self.joints < 0) | (self.joints >= len(self.nodes))):
            joint, last = self.joints[row, column], len(self.nodes) - 1
            raise ValueError(f'joints[{row}, {column}] must be from 0 to {last}, got {joint}')
        self.joints = self.joints.astype(np.int64)

    def __repr__(self):
        n_vertices, n_weights = self.joints.shape
        return f'Skin({len(self.nodes)} joints, {n_vertices} vertices, {n_weights} weights each)'

    @cached_property
    def centers(self):
        """Origins of the joints in the mesh's space at rest: float64, shape (m, 3)."""
        linear, shift = self.inverse_bind[:, :3, :3], self.inverse_bind[:, :3, 3]
        return -np.einsum('mij,mj->mi', np.linalg.pinv(linear), shift)

    def matrices(self, world):
        """Return ``figure_from_mesh`` of the joints of the skin, shape (..., m, 4, 4).

        From ``figure_from_joint`` of the whole skeleton, (..., n, 4, 4).
        """
        return np.asarray(world)[..., self.nodes, :, :] @ self.inverse_bind

    @cached_property
    def turns(self):
        """Joints, and the sums of their weights, negative where the inverse bind mirrors."""
        sums = np.bincount(self.joints.ravel(), self.weights.ravel(), len(self.nodes))
        return self.nodes, sums * np.sign(np.linalg.det(self.inverse_bind[:, :3, :3]))

    def blend(self, world, how='linear', bulge=1.0):
        """Return ``figure_from_mesh`` of each vertex by linear blend or dual quaternion skinning.

        Shape (v, 3, 4), from ``figure_from_joint`` of the whole skeleton, (n, 4, 4).
        """
        check_one_of('skinning', how, SKINNINGS)
        matrices = self.matrices(world)
        if how == 'linear':
            return skinning.linear_blend(matrices, self.joints, self.weights)
        return skinning.dual_blend(matrices, self.joints, self.weights, self.centers, bulge)


@dataclass(eq=False)
class FigureMesh:
    """One mesh of a figure and its deformers.

    Order of deformation: vertex animation, morph targets, correctives, then the skin, or without
    one the node.

    Parameters
    ----------
    mesh : pyvista.PolyData
        The mesh at rest; missing point normals are computed.
    node : int
        Joint that an unskinned mesh moves with; -1 for none. Ignored with a skin, as in glTF.
    skin : Skin, optional
        Joints and weights of the vertices.
    morphs : Morphs, optional
        Morph targets.
    frames : VertexAnimation, optional
        Vertex animation; missing normals are computed.
    look : dict, optional
        Keywords of ``Plotter.add_mesh``.
    name : str
        Name of the mesh.

    Raises
    ------
    ValueError
        If the number of vertices of skin, morphs or frames differs.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.animation import FigureMesh
    >>> FigureMesh(pv.Sphere(), look={'color': 'red'}).points.dtype
    dtype('float64')
    """

    mesh: pv.PolyData
    node: int = -1
    skin: Skin | None = None
    morphs: Morphs | None = None
    frames: VertexAnimation | None = None
    look: dict = field(default_factory=dict)
    name: str = ''

    def __post_init__(self):
        point_count = self.mesh.n_points
        if self.skin is not None and len(self.skin.joints) != point_count:
            raise ValueError(f'skin must have {point_count} vertices, got {len(self.skin.joints)}')
        if self.morphs is not None:
            self.morphs.check(point_count)
        if self.frames is not None:
            self.frames = _with_normals(self.frames, self.mesh)
        if self.mesh.cell_data.active_normals is not None:  # which would not move with it
            self.mesh = self.mesh.copy(deep=False)
            self.mesh.cell_data.active_normals_name = None
        self.points = np.array(self.mesh.points, dtype=np.float64)
        self.normals = np.array(point_normals(self.mesh), dtype=np.float64)

    def mirrors(self, world):
        """Return whether ``figure_from_joint`` (n, 4, 4) mirrors most of the mesh."""
        return is_mirrored_by(self, signs_of(np.asarray(world)))

    def __getstate__(self):
        return self.__dict__ | {'look': storable(self.look)}

    @property
    def n_targets(self):
        """Number of morph targets."""
        return 0 if self.morphs is None else len(self.morphs)


def is_mirrored_by(figure_mesh, signs):
    """Return whether joints with determinants of these signs (..., n) mirror most of a mesh."""
    if figure_mesh.skin is None:
        return figure_mesh.node >= 0 and signs[..., figure_mesh.node] < 0
    skin_joints, turn_weights = figure_mesh.skin.turns
    return signs[..., skin_joints] @ turn_weights < 0


def _with_normals(frames, mesh):
    if frames.n_points != mesh.n_points:
        raise ValueError(f'frames must have {mesh.n_points} vertices, got {frames.n_points}')
    if frames.normals is not None:
        return frames
    normals = np.empty(frames.positions.shape, np.float32)
    for frame_normals, points in zip(normals, frames.positions, strict=True):
        frame_normals[:] = normals_at(mesh, points)
    return replace(frames, normals=normals)


# By the address of the texture; what pickles keeps them alive meanwhile.
_stored: WeakValueDictionary[str, StoredTexture] = WeakValueDictionary()


class StoredTexture:
    """Stands for a texture in the state of its owner; becomes one when that is restored."""

    def __init__(self, texture):
        image = pv.wrap(texture.GetInput())
        sampling = texture.interpolate, texture.mipmap, texture.wrap.name
        self._parts = image, *sampling, texture.GetUseSRGBColorSpace()

    def __reduce__(self):
        return _restored, self._parts


def storable(look):
    """Return the look of a mesh as it is pickled; textures that are shared stay so."""
    return {name: _storable(value) for name, value in look.items()}


def _storable(value):
    if isinstance(value, dict):
        return storable(value)
    if not isinstance(value, pv.Texture):
        return value
    return _stored.setdefault(address(value), StoredTexture(value))


def _restored(image, interpolate, mipmap, wrap, srgb):
    texture = pv.Texture(image)
    texture.interpolate, texture.mipmap = interpolate, mipmap
    texture.wrap = pv.Texture.WrapType[wrap]
    texture.SetUseSRGBColorSpace(srgb)
    return texture
