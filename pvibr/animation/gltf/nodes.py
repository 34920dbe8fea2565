"""Nodes, skins and animations of a glTF file as skeleton and clips: each node is a joint."""

from __future__ import annotations

from itertools import chain

import numpy as np

from pvibr.animation.clip import Clip, Track
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton, depths
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile, follow, naming
from pvibr.maths import quaternions

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
_VALUES = {
    'translation': 'VEC3',
    'rotation': 'VEC4',
    'scale': 'VEC3',
    'weights': 'SCALAR',
    'visible': 'SCALAR',
}
#: Rotation from y-up to z-up.
_Z_UP = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def parents_of(file: GltfFile):
    """Return the parent of each node."""
    nodes = file.document.nodes
    file.spend(_NODE * len(nodes), 'nodes')
    parents = np.full(len(nodes), -1, dtype=np.int64)
    counts = [len(node.children) for node in nodes]
    owners = np.repeat(np.arange(len(nodes)), counts)
    children = _flat((node.children for node in nodes), np.int64)
    bad = children >= len(nodes)
    if bad.any():
        follow(nodes, children[bad][0], _place(owners, bad.argmax()), 'nodes')
    again = np.ones(len(children), dtype=bool)
    again[np.unique(children, return_index=True)[1]] = False
    if again.any():
        which = again.argmax()
        child = children[which]
        first = owners[(children == child).argmax()]
        what = f'{_place(owners, which)} is {child}'
        raise GltfError(f'{what}, which is a child of nodes[{first}] already.')
    parents[children] = owners
    _check_depth(parents)
    return parents


def _flat(rows, dtype):
    return np.fromiter(chain.from_iterable(rows), dtype)


def _place(owners, which):
    owner = owners[which]
    return f'nodes[{owner}].children[{which - np.searchsorted(owners, owner)}]'


def _check_depth(parents):
    depth = depths(parents)
    if len(parents) and depth.max() >= _DEEPEST:
        raise GltfError(f'nodes[{depth.argmax()}] is more than {_DEEPEST} nodes below its root.')
    if (depth < 0).any():
        raise GltfError(f'nodes[{(depth < 0).argmax()}] is in or below a cycle of children.')


def shown_nodes(file: GltfFile, parents, scene):
    """Return the nodes of a scene; its roots have no parents from now on."""
    document = file.document
    if scene is None and not document.scenes:
        roots = np.flatnonzero(parents < 0).tolist()
    else:
        roots = _roots(document, _scene_number(document, scene))
    found, stack = {}, roots[::-1]
    while stack:
        if (node := stack.pop()) not in found:
            found[node] = parents[node]
            stack += document.nodes[node].children[::-1]
    # Exporters of game kits name nodes that have parents, which are in no scene.
    parents[[node for node in roots if found[node] not in found]] = -1
    return list(found)


def drawn_nodes(file: GltfFile, parents, nodes):
    """Return the nodes, parents first, less those that no clip makes visible."""
    hidden, animated = _hidden(file), _blinking(file)
    lost: set[int] = set()
    for node in nodes:
        if (node in hidden and node not in animated) or parents[node] in lost:
            lost.add(node)
    return [node for node in nodes if node not in lost]


def _hidden(file):
    nodes = file.document.nodes
    return {i for i, node in enumerate(nodes) if not node.extensions.visibility.visible}


def _blinking(file):
    """Return the nodes whose visibility is animated."""
    channels = (channel for clip in file.document.animations for channel in clip.channels)
    places = [channel.target.place() for channel in channels]
    return {node for node, path in places if path == 'visible'}


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
    raise ValueError(f'scene is {scene!r}; the file has {len(names)} scenes: {names}.')


def _roots(document, number):
    roots = list(dict.fromkeys(document.scenes[number].nodes))
    for i, node in enumerate(roots):
        follow(document.nodes, node, f'scenes[{number}].nodes[{i}]', 'nodes')
    return roots


def skeleton_of(file: GltfFile, parents, up):
    """Return all nodes as joints with the same indices."""
    nodes = file.document.nodes
    translation = _flat((node.translation for node in nodes), np.float64).reshape(-1, 3)
    rotation = _flat((node.rotation for node in nodes), np.float64).reshape(-1, 4)
    scale = _flat((node.scale for node in nodes), np.float64).reshape(-1, 3)
    rotation = rotation[:, [3, 0, 1, 2]]
    given = [i for i, node in enumerate(nodes) if node.matrix is not None]
    if given:
        parts = _apart([nodes[i].matrix for i in given], given)
        translation[given], rotation[given], scale[given] = parts
    scale[[*(_hidden(file) & _blinking(file))]] = 0  # until a clip shows them
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
        raise GltfError(f'nodes[{far[0]}] is translated or scaled by more than {_FARTHEST:.0e}.')
    return skeleton


def _apart(matrices, numbers):
    """Return translations, quaternions and scales of column-major matrices (n, 16)."""
    matrices = np.array(matrices).reshape(-1, 4, 4).swapaxes(1, 2)
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    last = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1)
    _refuse(last > _SHEAR, numbers, 'is not affine')
    # Axes scaled to nothing get directions at right angles to the others.
    left, _, right = np.linalg.svd(linear / np.where(lengths > 0, lengths, 1)[:, None])
    rotation = left @ right
    shear = np.abs(rotation * lengths[:, None] - linear).max((1, 2))
    _refuse(shear > _SHEAR * lengths.max(1), numbers, 'is sheared, which glTF forbids')
    sign = np.ones((len(matrices), 3))
    sign[np.linalg.det(rotation) < 0, 2] = -1
    rotation = quaternions.from_matrices(rotation * sign[:, None])
    return matrices[:, :3, 3], rotation, lengths * sign


def _refuse(bad, numbers, fault):
    if bad.any():
        raise GltfError(f'nodes[{numbers[bad.argmax()]}].matrix {fault}.')


def copies_of(file: GltfFile, accessors: Accessors, nodes):
    """Return translations, quaternions and scales of instances, of the nodes that have some."""
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
        raise GltfError(f'{place} has {len(counts)} counts of instances; all must be the same.')
    (count,) = counts
    file.spend(_NODE * count, place)
    parts = [
        accessors.floats(attributes[name], f'{place}.{name}', kind) if name in attributes else None
        for name, kind in (('TRANSLATION', 'VEC3'), ('ROTATION', 'VEC4'), ('SCALE', 'VEC3'))
    ]
    moves, spins, sizes = parts
    moves = np.zeros((count, 3)) if moves is None else moves
    spins = np.tile([1.0, 0, 0, 0], (count, 1)) if spins is None else spins[:, [3, 0, 1, 2]]
    with naming(place):
        return (
            moves,
            quaternions.normalized(spins),
            np.ones((count, 3)) if sizes is None else sizes,
        )


def with_copies(skeleton, copies):
    """Return a skeleton with a joint for each instance, and these joints by node."""
    joints, n = {}, len(skeleton)
    parents, parts, names = [skeleton.parents], [], list(skeleton.names)
    rest = skeleton.rest
    for node, (moves, spins, sizes) in copies.items():
        joints[node] = range(n, n + len(moves))
        n += len(moves)
        parents.append(np.full(len(moves), node))
        parts.append((moves, spins, sizes))
        names += [f'{skeleton.names[node]}.{i}' for i in range(len(moves))]
    if not joints:
        return skeleton, joints
    stacks = zip((rest.translation, rest.rotation, rest.scale), *parts, strict=True)
    pose = Pose(*(np.concatenate(stack) for stack in stacks))
    return Skeleton(np.concatenate(parents), pose, names), joints


def bind_of(file: GltfFile, accessors: Accessors, index):
    """Return joints and inverse bind matrices of a skin."""
    skin, place = file.document.skins[index], f'skins[{index}]'
    joints = np.array(skin.joints)
    bad = joints >= len(file.document.nodes)
    if bad.any():
        which = bad.argmax()
        follow(file.document.nodes, joints[which], f'{place}.joints[{which}]', 'nodes')
    n = len(joints)
    if skin.inverse_bind_matrices is None:
        return joints, np.broadcast_to(np.eye(4), (n, 4, 4))
    place = f'{place}.inverseBindMatrices'
    values = accessors.floats(skin.inverse_bind_matrices, place, 'MAT4')
    if len(values) < n:
        raise GltfError(f'{place} has {len(values)} matrices for {n} joints.')
    matrices = values[:n].reshape(n, 4, 4).swapaxes(1, 2).astype(np.float64)
    wrong = np.flatnonzero(np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1) > _SHEAR)
    if len(wrong):
        raise GltfError(f'{place}: matrix {wrong[0]} is not affine.')
    matrices[:, 3] = [0, 0, 0, 1]
    return joints, matrices


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
        driven: dict = {}
        tracks = []
        for i, channel in enumerate(self._animation.channels):
            place = f'{self._place}.channels[{i}]'
            node, path = channel.target.place()
            if self._skips(node, path, place):
                continue
            key = node, 'scale' if path == 'visible' else path  # what is hidden has no scale
            if driven.get(key, path) != path:
                self._file.leave_out('animation of scale and visibility of one node', place)
                continue
            if key in driven:
                raise GltfError(
                    f'{place} drives the {path} of nodes[{node}], as an earlier channel does.'
                )
            driven[key] = path
            sampler = follow(
                self._animation.samplers, channel.sampler, f'{place}.sampler', 'samplers'
            )
            with naming(place):
                where = f'{self._place}.samplers[{channel.sampler}]'
                tracks.append(self._track(sampler, node, path, where))
        return tracks

    def _skips(self, node, path, place):
        if node is not None:
            follow(self._file.document.nodes, node, f'{place}.target.node', 'nodes')
        if path not in _VALUES:
            self._file.leave_out(f'animation of {path[:60]!r}', f'{place}.target.path')
            return True
        if path == 'visible' and self._file.document.nodes[node].skin is not None:
            self._file.leave_out('animated visibility of a skinned mesh', place)
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
            raise GltfError(
                f'{output} has {values.size} numbers; {len(times)} keys need {np.prod(shape)}.'
            )
        values = values.reshape(shape)
        if path == 'visible':  # hidden by a scale of 0
            values = (values != 0) * np.array(self._file.document.nodes[node].scale)
            return Track(node, 'scale', times, values, 'step')
        if path == 'rotation':
            values = values[..., [3, 0, 1, 2]]
        later = np.diff(times, prepend=-np.inf) > 0
        if not later.all() and (np.diff(times) >= 0).all():  # of keys at one time the first holds
            times, values = times[later], values[later]
        self._file.spend(8 * values.size * meshes, output)
        # Each mesh of a node has its own columns with the same weights.
        values = np.tile(values, meshes) if meshes > 1 else values
        return Track(first, path, times, values, _INTERPOLATIONS[sampler.interpolation])
