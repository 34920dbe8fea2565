"""Nodes, skins and animations of a glTF file as skeleton and clips: each node is a joint."""

from __future__ import annotations

from itertools import chain

import numpy as np

from pvibr.animation.clip import Clip, Track
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton, depths
from pvibr.io.gltf_accessors import Accessors
from pvibr.io.gltf_file import GltfError, GltfFile, follow, naming
from pvibr.maths import quaternions
from pvibr.maths.transforms import turns_and_scales

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
_VALUES = {'translation': 'VEC3', 'rotation': 'VEC4', 'scale': 'VEC3'}
_VALUES |= dict.fromkeys(('weights', 'visible'), 'SCALAR')


def parents_of(gltf_file: GltfFile):
    """Return the parent of each node."""
    nodes = gltf_file.document.nodes
    gltf_file.spend(_NODE * len(nodes), 'nodes')
    parents = np.full(len(nodes), -1, dtype=np.int64)
    child_counts = [len(node.children) for node in nodes]
    owners = np.repeat(np.arange(len(nodes)), child_counts)
    children = _flat((node.children for node in nodes), np.int64)
    out_of_range = children >= len(nodes)
    if out_of_range.any():
        path = _child_path(owners, out_of_range.argmax())
        follow(nodes, children[out_of_range][0], path, 'nodes')
    is_repeated = np.ones(len(children), dtype=bool)
    is_repeated[np.unique(children, return_index=True)[1]] = False
    if is_repeated.any():
        repeat_index = is_repeated.argmax()
        child = children[repeat_index]
        first_owner = owners[(children == child).argmax()]
        raise GltfError(
            f'{_child_path(owners, repeat_index)} must be a node without a parent, '
            f'got {child}, a child of nodes[{first_owner}]'
        )
    parents[children] = owners
    _check_depth(parents)
    return parents


def _flat(sequences, dtype):
    return np.fromiter(chain.from_iterable(sequences), dtype)


def _child_path(owners, index):
    owner = owners[index]
    return f'nodes[{owner}].children[{index - np.searchsorted(owners, owner)}]'


def _check_depth(parents):
    node_depths = depths(parents)
    if len(parents) and node_depths.max() >= _DEEPEST:
        raise GltfError(
            f'nodes[{node_depths.argmax()}] must be less than {_DEEPEST} nodes below its '
            f'root, got {node_depths.max()}'
        )
    if (node_depths < 0).any():
        cyclic = (node_depths < 0).argmax()
        raise GltfError(f'nodes[{cyclic}] must not be in or below a cycle of children')


def scene_nodes(gltf_file: GltfFile, parents, scene):
    """Return the nodes of a scene; its roots have no parents from now on."""
    document = gltf_file.document
    if scene is None and not document.scenes:
        root_nodes = np.flatnonzero(parents < 0).tolist()
    else:
        root_nodes = _roots(document, _scene_number(document, scene))
    parent_by_node, node_stack = {}, root_nodes[::-1]
    while node_stack:
        if (node := node_stack.pop()) not in parent_by_node:
            parent_by_node[node] = parents[node]
            node_stack += document.nodes[node].children[::-1]
    # Exporters of game kits name nodes that have parents, which are in no scene.
    parents[[node for node in root_nodes if parent_by_node[node] not in parent_by_node]] = -1
    return list(parent_by_node)


def visible_nodes(gltf_file: GltfFile, parents, nodes):
    """Return the nodes, parents first, without those that no clip makes visible."""
    at_rest_hidden, can_appear = _hidden(gltf_file), _appearing(gltf_file)
    hidden_nodes: set[int] = set()
    for node in nodes:
        if (node in at_rest_hidden and node not in can_appear) or parents[node] in hidden_nodes:
            hidden_nodes.add(node)
    return [node for node in nodes if node not in hidden_nodes]


def _hidden(gltf_file):
    nodes = gltf_file.document.nodes
    return {i for i, node in enumerate(nodes) if not node.extensions.visibility.visible}


def _appearing(gltf_file):
    """Return the nodes whose visibility is animated."""
    channels = (channel for clip in gltf_file.document.animations for channel in clip.channels)
    channel_targets = [channel.target.place() for channel in channels]
    return {node for node, path in channel_targets if path == 'visible'}


def _scene_number(document, scene):
    if scene is None:
        scene_index = document.scene or 0
        follow(document.scenes, scene_index, 'scene', 'scenes')
        return scene_index
    scene_names = [value.name for value in document.scenes]
    if isinstance(scene, str) and scene in scene_names:
        return scene_names.index(scene)
    if isinstance(scene, int) and 0 <= scene < len(scene_names):
        return scene
    raise ValueError(f'scene must be an index or a name of {scene_names}, got {scene!r}')


def _roots(document, scene_index):
    root_nodes = list(dict.fromkeys(document.scenes[scene_index].nodes))
    for i, node in enumerate(root_nodes):
        follow(document.nodes, node, f'scenes[{scene_index}].nodes[{i}]', 'nodes')
    return root_nodes


def skeleton_of(gltf_file: GltfFile, parents):
    """Return all nodes as joints with the same indices."""
    nodes = gltf_file.document.nodes
    translation = _flat((node.translation for node in nodes), np.float64).reshape(-1, 3)
    rotation = _flat((node.rotation for node in nodes), np.float64).reshape(-1, 4)
    scale = _flat((node.scale for node in nodes), np.float64).reshape(-1, 3)
    rotation = rotation[:, [3, 0, 1, 2]]
    matrix_nodes = [i for i, node in enumerate(nodes) if node.matrix is not None]
    if matrix_nodes:
        transform_parts = _decomposed([nodes[i].matrix for i in matrix_nodes], matrix_nodes)
        translation[matrix_nodes], rotation[matrix_nodes], scale[matrix_nodes] = transform_parts
    scale[[*(_hidden(gltf_file) & _appearing(gltf_file))]] = 0  # until a clip shows them
    names = [node.name or f'node{i}' for i, node in enumerate(nodes)]
    with naming('nodes'):
        skeleton = Skeleton(parents, Pose(translation, rotation, scale), names)
    with np.errstate(all='ignore'):
        figure_from_joint = skeleton.world(skeleton.rest)
    far_nodes = np.flatnonzero(~(np.abs(figure_from_joint).max((1, 2), initial=0.0) < _FARTHEST))
    if len(far_nodes):
        raise GltfError(
            f'nodes[{far_nodes[0]}] must be moved and scaled by less than {_FARTHEST:.0e}'
        )
    return skeleton


def _decomposed(matrices, node_indices):
    """Return translations, quaternions and scales of column-major matrices (n, 16)."""
    matrices = np.array(matrices).reshape(-1, 4, 4).swapaxes(1, 2)
    linear = matrices[:, :3, :3]
    last_row_error = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1)
    _refuse(last_row_error > _SHEAR, node_indices, 'affine')
    rotations, scales = turns_and_scales(linear)
    shear_error = np.abs(rotations * scales[:, None] - linear).max((1, 2))
    is_sheared = shear_error > _SHEAR * np.abs(scales).max(1)
    _refuse(is_sheared, node_indices, 'free of shear, as glTF requires')
    return matrices[:, :3, 3], quaternions.from_matrices(rotations), scales


def _refuse(is_bad, node_indices, quality):
    if is_bad.any():
        raise GltfError(f'nodes[{node_indices[is_bad.argmax()]}].matrix must be {quality}')


def copies_of(gltf_file: GltfFile, accessors: Accessors, nodes):
    """Return translations, quaternions and scales of instances, of the nodes that have some."""
    copies = {}
    for index in nodes:
        node = gltf_file.document.nodes[index]
        json_path = f'nodes[{index}].extensions.{INSTANCING}'
        instancing = node.extensions.instancing
        if instancing is not None and node.skin is not None:
            gltf_file.leave_out('instances of a skinned mesh', json_path)
        elif instancing is not None:
            copies[index] = _copies(gltf_file, accessors, instancing.attributes, json_path)
    return copies


def _copies(gltf_file, accessors, attributes, json_path):
    counts = {accessors.count(index, json_path) for index in attributes.values()}
    if len(counts) != 1:
        raise GltfError(f'{json_path} must have attributes of one count, got {sorted(counts)}')
    (count,) = counts
    gltf_file.spend(_NODE * count, json_path)
    parts = [
        accessors.floats(attributes[name], f'{json_path}.{name}', kind)
        if name in attributes
        else None
        for name, kind in (('TRANSLATION', 'VEC3'), ('ROTATION', 'VEC4'), ('SCALE', 'VEC3'))
    ]
    translations, rotations, scales = parts
    translations = np.zeros((count, 3)) if translations is None else translations
    rotations = np.tile([0.0, 0, 0, 1], (count, 1)) if rotations is None else rotations
    with naming(json_path):
        scales = np.ones((count, 3)) if scales is None else scales
        return translations, quaternions.normalized(rotations[:, [3, 0, 1, 2]]), scales


def with_copies(skeleton, copies):
    """Return a skeleton with a joint for each instance, and these joints by node."""
    joints_by_node, next_joint = {}, len(skeleton)
    parents, transform_parts, names = [skeleton.parents], [], list(skeleton.names)
    rest = skeleton.rest
    for node, (translations, rotations, scales) in copies.items():
        joints_by_node[node] = range(next_joint, next_joint + len(translations))
        next_joint += len(translations)
        parents.append(np.full(len(translations), node))
        transform_parts.append((translations, rotations, scales))
        names += [f'{skeleton.names[node]}.{i}' for i in range(len(translations))]
    if not joints_by_node:
        return skeleton, joints_by_node
    part_stacks = zip((rest.translation, rest.rotation, rest.scale), *transform_parts, strict=True)
    pose = Pose(*(np.concatenate(stack) for stack in part_stacks))
    return Skeleton(np.concatenate(parents), pose, names), joints_by_node


def bind_of(gltf_file: GltfFile, accessors: Accessors, skin_index):
    """Return joints and inverse bind matrices of a skin."""
    skin, path = gltf_file.document.skins[skin_index], f'skins[{skin_index}]'
    joints = np.array(skin.joints)
    out_of_range = joints >= len(gltf_file.document.nodes)
    if out_of_range.any():
        which = out_of_range.argmax()
        follow(gltf_file.document.nodes, joints[which], f'{path}.joints[{which}]', 'nodes')
    n = len(joints)
    if skin.inverse_bind_matrices is None:
        return joints, np.broadcast_to(np.eye(4), (n, 4, 4))
    path = f'{path}.inverseBindMatrices'
    values = accessors.floats(skin.inverse_bind_matrices, path, 'MAT4')
    if len(values) < n:
        raise GltfError(f'{path} must have {n} matrices, one per joint, got {len(values)}')
    matrices = values[:n].reshape(n, 4, 4).swapaxes(1, 2).astype(np.float64)
    bad_matrices = np.flatnonzero(np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(1) > _SHEAR)
    if len(bad_matrices):
        raise GltfError(f'{path}[{bad_matrices[0]}] must be affine')
    matrices[:, 3] = [0, 0, 0, 1]
    return joints, matrices


def clips_of(gltf_file: GltfFile, accessors: Accessors, targets):
    """Return the animations as clips."""
    clips = []
    for i, animation in enumerate(gltf_file.document.animations):
        tracks = _Tracks(gltf_file, accessors, animation, f'animations[{i}]', targets)
        with naming(f'animations[{i}]'):
            clips.append(Clip(animation.name or f'animation{i}', tracks.read()))
    return clips


class _Tracks:
    """The channels of one animation."""

    def __init__(self, gltf_file, accessors, animation, json_path, targets):
        self._file, self._accessors, self._targets = gltf_file, accessors, targets
        self._animation, self._json_path = animation, json_path

    def read(self):
        path_by_channel: dict = {}
        tracks = []
        for i, channel in enumerate(self._animation.channels):
            json_path = f'{self._json_path}.channels[{i}]'
            node, path = channel.target.place()
            if self._skips(node, path, json_path):
                continue
            # A hidden node has no scale.
            channel_key = node, 'scale' if path == 'visible' else path
            if path_by_channel.get(channel_key, path) != path:
                self._file.leave_out('animation of scale and visibility of one node', json_path)
                continue
            if channel_key in path_by_channel:
                raise GltfError(
                    f'{json_path} must have a target of its own, got {path} of nodes[{node}] again'
                )
            path_by_channel[channel_key] = path
            samplers = self._animation.samplers
            sampler = follow(samplers, channel.sampler, f'{json_path}.sampler', 'samplers')
            with naming(json_path):
                sampler_path = f'{self._json_path}.samplers[{channel.sampler}]'
                tracks.append(self._track(sampler, node, path, sampler_path))
        return tracks

    def _skips(self, node, path, json_path):
        if node is not None:
            follow(self._file.document.nodes, node, f'{json_path}.target.node', 'nodes')
        if path not in _VALUES:
            self._file.leave_out(f'animation of {path[:60]!r}', f'{json_path}.target.path')
            return True
        if path == 'visible' and self._file.document.nodes[node].skin is not None:
            self._file.leave_out('animated visibility of a skinned mesh', json_path)
            return True
        # Weights of hidden meshes, or meshes without targets.
        return node is None or (path == 'weights' and node not in self._targets)

    def _track(self, sampler, node, path, json_path):
        times = self._accessors.floats(sampler.input, f'{json_path}.input', 'SCALAR')[:, 0]
        output_path = f'{json_path}.output'
        values = self._accessors.floats(sampler.output, output_path, _VALUES[path])
        is_cubic = sampler.interpolation == 'CUBICSPLINE'
        first_column, value_width, mesh_count = node, values.shape[1], 1
        if path == 'weights':
            first_column, value_width, mesh_count = self._targets[node]
        expected_shape = (len(times), 3, value_width) if is_cubic else (len(times), value_width)
        if values.size != np.prod(expected_shape):
            raise GltfError(
                f'{output_path} must have {np.prod(expected_shape)} numbers for {len(times)} '
                f'keys, got {values.size}'
            )
        values = values.reshape(expected_shape)
        if path == 'visible':  # hidden by a scale of 0
            values = (values != 0) * np.array(self._file.document.nodes[node].scale)
            return Track(node, 'scale', times, values, 'step')
        if path == 'rotation':
            values = values[..., [3, 0, 1, 2]]
        is_later = np.diff(times, prepend=-np.inf) > 0
        # Of keys at one time the first holds.
        if not is_later.all() and (np.diff(times) >= 0).all():
            times, values = times[is_later], values[is_later]
        self._file.spend(8 * values.size * mesh_count, output_path)
        # Each mesh of a node has its own columns with the same weights.
        values = np.tile(values, mesh_count) if mesh_count > 1 else values
        return Track(first_column, path, times, values, _INTERPOLATIONS[sampler.interpolation])
