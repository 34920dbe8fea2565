"""Nodes, skins and animations of a glTF file as skeleton and clips: each node is a joint."""

from __future__ import annotations

import numpy as np

from pvibr.animation.clip import Clip, Track
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile, follow, naming
from pvibr.maths import quaternions
from pvibr.maths.transforms import trs

INSTANCING = 'EXT_mesh_gpu_instancing'
#: Maximum depth of the scene graph.
_DEEPEST = 1024
#: Bytes of a node's matrices.
_NODE = 1024
#: Largest number in a node's matrix: beyond it float32 and matrix products overflow.
_FARTHEST = 1e30
#: Tolerated shear of a node's matrix: files round to six digits.
_SHEAR = 1e-4
_INTERPOLATIONS = {'STEP': 'step', 'LINEAR': 'linear', 'CUBICSPLINE': 'cubic'}
_VALUES = {'translation': 'VEC3', 'rotation': 'VEC4', 'scale': 'VEC3', 'weights': 'SCALAR'}
#: Rotation from y-up to z-up.
_Z_UP = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def parents_of(file: GltfFile):
    """Return the parent of each node."""
    nodes = file.document.nodes
    file.spend(_NODE * len(nodes), 'nodes')
    parents = np.full(len(nodes), -1, dtype=np.int64)
    for i, node in enumerate(nodes):
        for j, child in enumerate(node.children):
            place = f'nodes[{i}].children[{j}]'
            follow(nodes, child, place, 'nodes')
            if parents[child] >= 0:
                msg = f'{place} is {child}, which is a child of nodes[{parents[child]}] already.'
                raise GltfError(msg)
            parents[child] = i
    _check_depth(nodes, np.flatnonzero(parents < 0).tolist())
    return parents


def _check_depth(nodes, level):
    seen = np.zeros(len(nodes), dtype=bool)
    for _ in range(_DEEPEST):
        seen[level] = True
        level = [child for node in level for child in nodes[node].children]
        if not level:
            break
    else:
        msg = f'nodes[{level[0]}] is more than {_DEEPEST} nodes below its root.'
        raise GltfError(msg)
    if not seen.all():  # nodes have at most one parent, so the rest form cycles
        msg = f'nodes[{np.flatnonzero(~seen)[0]}] is in or below a cycle of children.'
        raise GltfError(msg)


def shown_nodes(file: GltfFile, parents, scene):
    """Return the nodes of a scene."""
    document = file.document
    if scene is None and not document.scenes:
        roots = np.flatnonzero(parents < 0).tolist()
    else:
        roots = _roots(document, parents, _scene_number(document, scene))
    found, stack = [], roots[::-1]
    while stack:
        found.append(node := stack.pop())
        stack += document.nodes[node].children[::-1]
    return found


def _scene_number(document, scene):
    if scene is None:
        number = document.scene or 0
        follow(document.scenes, number, 'scene', 'scenes')
        return number
    names = [value.name for value in document.scenes]
    if isinstance(scene, str) and scene in names:
        return names.index(scene)
    if isinstance(scene, int) and 0 <= scene < len(names):
        return scene
    msg = f'scene is {scene!r}; the file has {len(names)} scenes: {names}.'
    raise ValueError(msg)


def _roots(document, parents, number):
    roots = list(dict.fromkeys(document.scenes[number].nodes))
    for i, node in enumerate(roots):
        place = f'scenes[{number}].nodes[{i}]'
        follow(document.nodes, node, place, 'nodes')
        if parents[node] >= 0:
            msg = f'{place} is {node}, which is a child of nodes[{parents[node]}].'
            raise GltfError(msg)
    return roots


def skeleton_of(file: GltfFile, parents, up):
    """Return all nodes as joints with the same indices."""
    nodes = file.document.nodes
    translation = np.array([node.translation for node in nodes], np.float64).reshape(-1, 3)
    rotation = np.array([node.rotation for node in nodes], np.float64).reshape(-1, 4)
    scale = np.array([node.scale for node in nodes], np.float64).reshape(-1, 3)
    rotation = rotation[:, [3, 0, 1, 2]]
    given = [i for i, node in enumerate(nodes) if node.matrix is not None]
    if given:
        parts = _apart([nodes[i].matrix for i in given], given)
        translation[given], rotation[given], scale[given] = parts
    names = [node.name or f'node{i}' for i, node in enumerate(nodes)]
    if up == 'z':
        parents = np.append(np.where(parents < 0, len(nodes), parents), -1)
        translation = np.vstack([translation, np.zeros(3)])
        rotation, scale = np.vstack([rotation, _Z_UP]), np.vstack([scale, np.ones(3)])
        names.append('upright')
    with naming('nodes'):
        skeleton = Skeleton(parents, Pose(translation, rotation, scale), names)
    with np.errstate(all='ignore'):
        world = skeleton.world(skeleton.rest)
    far = np.flatnonzero(~(np.abs(world).max((1, 2), initial=0.0) < _FARTHEST))
    if len(far):
        msg = f'nodes[{far[0]}] is translated or scaled by more than {_FARTHEST:.0e}.'
        raise GltfError(msg)
    return skeleton


def _apart(matrices, numbers):
    """Return translations, quaternions and scales of column-major matrices (n, 16)."""
    matrices = np.array(matrices).reshape(-1, 4, 4).swapaxes(1, 2)
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    last = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1)
    _refuse(~lengths.all(1) | (last > _SHEAR), numbers, 'is singular or not affine')
    left, _, right = np.linalg.svd(linear / lengths[:, None])
    rotation = left @ right
    shear = np.abs(rotation * lengths[:, None] - linear).max((1, 2))
    _refuse(shear > _SHEAR * lengths.max(1), numbers, 'is sheared, which glTF forbids')
    sign = np.ones((len(matrices), 3))
    sign[np.linalg.det(rotation) < 0, 2] = -1
    rotation = quaternions.from_matrices(rotation * sign[:, None])
    return matrices[:, :3, 3], rotation, lengths * sign


def _refuse(bad, numbers, fault):
    if bad.any():
        msg = f'nodes[{numbers[bad.argmax()]}].matrix {fault}.'
        raise GltfError(msg)


def copies_of(file: GltfFile, accessors: Accessors, nodes):
    """Return the matrices of instances, (k, 4, 4), of the nodes that have some."""
    copies = {}
    for number in nodes:
        node, place = file.document.nodes[number], f'nodes[{number}].extensions.{INSTANCING}'
        instancing = node.extensions.instancing
        if instancing is not None and node.skin is not None:
            file.leave_out('instances of a skinned mesh', place)
        elif instancing is not None:
            copies[number] = _copies(file, accessors, instancing.attributes, place)
    return copies


def _copies(file, accessors, attributes, place):
    counts = {accessors.count(index, place) for index in attributes.values()}
    if len(counts) != 1:
        msg = f'{place} has {len(counts)} counts of instances; all must be the same.'
        raise GltfError(msg)
    (count,) = counts
    file.spend(_NODE * count, place)
    parts = [
        accessors.floats(attributes[name], f'{place}.{name}', kind) if name in attributes else None
        for name, kind in (('TRANSLATION', 'VEC3'), ('ROTATION', 'VEC4'), ('SCALE', 'VEC3'))
    ]
    moves, spins, sizes = parts
    spins = None if spins is None else spins[:, [3, 0, 1, 2]]
    with naming(place):
        return trs(np.zeros((count, 3)) if moves is None else moves, spins, sizes)


def bind_of(file: GltfFile, accessors: Accessors, index):
    """Return joints and inverse bind matrices of a skin."""
    skin, place = file.document.skins[index], f'skins[{index}]'
    for i, joint in enumerate(skin.joints):
        follow(file.document.nodes, joint, f'{place}.joints[{i}]', 'nodes')
    n = len(skin.joints)
    if skin.inverse_bind_matrices is None:
        return skin.joints, np.broadcast_to(np.eye(4), (n, 4, 4))
    place = f'{place}.inverseBindMatrices'
    values = accessors.floats(skin.inverse_bind_matrices, place, 'MAT4')
    if len(values) < n:
        msg = f'{place} has {len(values)} matrices for {n} joints.'
        raise GltfError(msg)
    matrices = values[:n].reshape(n, 4, 4).swapaxes(1, 2).astype(np.float64)
    wrong = np.flatnonzero(np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1) > _SHEAR)
    if len(wrong):
        msg = f'{place}: matrix {wrong[0]} is not affine.'
        raise GltfError(msg)
    matrices[:, 3] = [0, 0, 0, 1]
    return skin.joints, matrices


def clips_of(file: GltfFile, accessors: Accessors, targets):
    """Return the animations as clips."""
    clips = []
    for i, animation in enumerate(file.document.animations):
        tracks = _Tracks(file, accessors, animation, f'animations[{i}]', targets)
        with naming(f'animations[{i}]'):
            clips.append(Clip(animation.name or f'animation{i}', tracks.read()))
    return clips


class _Tracks:
    """The channels of one animation."""

    def __init__(self, file, accessors, animation, place, targets):
        self._file, self._accessors, self._targets = file, accessors, targets
        self._animation, self._place = animation, place

    def read(self):
        driven: set = set()
        tracks = []
        for i, channel in enumerate(self._animation.channels):
            place = f'{self._place}.channels[{i}]'
            node, path = channel.target.node, channel.target.path
            if self._skips(channel, place):
                continue
            if (node, path) in driven:
                msg = f'{place} drives the {path} of nodes[{node}], as an earlier channel does.'
                raise GltfError(msg)
            driven.add((node, path))
            sampler = follow(
                self._animation.samplers, channel.sampler, f'{place}.sampler', 'samplers'
            )
            with naming(place):
                where = f'{self._place}.samplers[{channel.sampler}]'
                tracks.append(self._track(sampler, node, path, where))
        return tracks

    def _skips(self, channel, place):
        node, path = channel.target.node, channel.target.path
        if node is not None:
            follow(self._file.document.nodes, node, f'{place}.target.node', 'nodes')
        if path not in _VALUES:
            self._file.leave_out(f'animation of {path[:40]!r}', f'{place}.target.path')
            return True
        # Weights of hidden meshes, or meshes without targets.
        return node is None or (path == 'weights' and node not in self._targets)

    def _track(self, sampler, node, path, place):
        times = self._accessors.floats(sampler.input, f'{place}.input', 'SCALAR')[:, 0]
        output = f'{place}.output'
        values = self._accessors.floats(sampler.output, output, _VALUES[path])
        cubic = sampler.interpolation == 'CUBICSPLINE'
        first, width, meshes = node, values.shape[1], 1
        if path == 'weights':
            first, width, meshes = self._targets[node]
        shape = (len(times), 3, width) if cubic else (len(times), width)
        if values.size != np.prod(shape):
            msg = f'{output} has {values.size} numbers; {len(times)} keys need {np.prod(shape)}.'
            raise GltfError(msg)
        values = values.reshape(shape)
        if path == 'rotation':
            values = values[..., [3, 0, 1, 2]]
        self._file.spend(8 * values.size * meshes, output)
        # Each mesh of a node has its own columns with the same weights.
        values = np.tile(values, meshes) if meshes > 1 else values
        return Track(first, path, times, values, _INTERPOLATIONS[sampler.interpolation])
