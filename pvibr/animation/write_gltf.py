"""Figures as binary glTF 2.0."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.animation.clip import Clip, Track
from pvibr.core.errors import warn
from pvibr.core.files import with_suffix
from pvibr.io.glb_writer import GlbWriter
from pvibr.maths.tones import to_light
from pvibr.maths.vectors import unit_vectors

#: A morph target that changes nothing.
_NOTHING = (np.zeros(0, int), np.zeros((0, 3)))
_INTERPOLATIONS = {'step': 'STEP', 'linear': 'LINEAR', 'cubic': 'CUBICSPLINE'}
#: What glTF calls VTK's textures of physically based shading.
_TEXTURES = {
    'albedoTex': ('baseColorTexture',),
    'materialTex': ('metallicRoughnessTexture', 'occlusionTexture'),
    'emissiveTex': ('emissiveTexture',),
    'normalTex': ('normalTexture',),
}


def write_glb(figure, path):
    """Write a figure as binary glTF 2.0."""
    path = with_suffix(path, '.glb')
    _FigureWriter(figure).document().write(path)


class _FigureWriter:
    """Writes the parts of a figure into a glTF document."""

    def __init__(self, figure):
        self._figure = figure
        self._glb = GlbWriter()
        self._left_out = {}
        self._skins = {}
        self._textures = {}
        self._joint_children = set()  # extra nodes parented to a joint

    def document(self):
        figure = self._figure
        for name in ('correctives', 'cameras', 'lights'):
            if getattr(figure, name):
                self._left_out[name] = None
        node_entries = self._nodes()
        host_nodes = [self._host(node_entries, mesh) for mesh in figure.meshes]
        clips = figure.clips
        if not clips and any(mesh.frames for mesh in figure.meshes):
            last_time = max(mesh.frames.times[-1] for mesh in figure.meshes if mesh.frames)
            clips = [Clip(figure.name or 'series', [], last_time)]
        for clip in clips:
            self._animation(clip, host_nodes)
        self._scene(node_entries)
        if self._left_out:
            warn(f'not written as glTF and left out: {", ".join(self._left_out)}.')
        return self._glb

    def _nodes(self):
        """Add a node per joint; their lists of children are filled afterwards."""
        skeleton = self._figure.skeleton
        rest = skeleton.rest
        for i, name in enumerate(skeleton.names):
            node = {'name': name, 'translation': rest.translation[i].tolist()}
            node['rotation'] = np.roll(rest.rotation[i], -1).tolist()
            node['scale'] = rest.scale[i].tolist()
            self._glb.add('nodes', node)
        return self._glb.document.setdefault('nodes', [])

    def _host(self, node_entries, mesh):
        """Return the node of a mesh: its joint, or a new node if another mesh has that one."""
        mesh_index = self._mesh(mesh)
        if mesh_index is None:
            return None
        host_node = mesh.node
        if host_node < 0 or 'mesh' in node_entries[host_node]:
            host_node = self._glb.add('nodes', {'name': mesh.name or f'mesh{len(node_entries)}'})
            if mesh.node >= 0 and mesh.skin is None:
                node_entries[mesh.node].setdefault('children', []).append(host_node)
                self._joint_children.add(host_node)
        node_entries[host_node]['mesh'] = mesh_index
        if mesh.skin is not None:
            node_entries[host_node]['skin'] = self._skin(mesh.skin)
        return host_node

    def _scene(self, node_entries):
        parents = self._figure.skeleton.parents
        for joint, parent in enumerate(parents):
            if parent >= 0:
                node_entries[parent].setdefault('children', []).append(joint)
        extra_nodes = range(len(parents), len(node_entries))
        root_nodes = [int(i) for i in np.flatnonzero(parents < 0)]
        root_nodes += [i for i in extra_nodes if i not in self._joint_children]
        self._glb.scene(root_nodes, **({'name': self._figure.name} if self._figure.name else {}))
        if not node_entries:
            del self._glb.document['nodes']

    def _skin(self, skin):
        if skin not in self._skins:
            column_major = np.swapaxes(skin.inverse_bind, 1, 2).reshape(-1, 16)  # column by column
            bind_accessor = self._glb.accessor(column_major)
            skin_entry = {'joints': skin.nodes.tolist(), 'inverseBindMatrices': bind_accessor}
            self._skins[skin] = self._glb.add('skins', skin_entry)
        return self._skins[skin]

    def _mesh(self, mesh):
        """Add a mesh; None if it has no polygon."""
        faces = mesh.mesh.triangulate().regular_faces
        if not len(faces):
            self._left_out['meshes without polygons'] = None
            return None
        points, normals = _neutral(mesh)
        primitive = self._glb.primitive(
            points,
            faces,
            normals=unit_vectors(normals) if normals.any() else None,
            coordinates=mesh.mesh.active_texture_coordinates,
            **self._colors(mesh),
        )
        if mesh.skin is not None:
            primitive['attributes'] |= self._influences(mesh.skin)
        primitive['material'] = self._material(mesh.look)
        mesh_entry = {'name': mesh.name} if mesh.name else {}
        mesh_entry['primitives'] = [primitive]
        targets, target_weights, target_names = self._targets(mesh, normals.any())
        if targets:
            primitive['targets'] = targets
            mesh_entry |= {'weights': target_weights, 'extras': {'targetNames': target_names}}
        return self._glb.add('meshes', mesh_entry)

    def _colors(self, mesh):
        if mesh.look.get('scalars') is None:
            return {}
        color_values = mesh.mesh.point_data.get(mesh.look['scalars'])
        if not mesh.look.get('rgb') or color_values is None:
            self._left_out['scalars other than point colours'] = None
            return {}
        color_values = np.asarray(color_values)
        color_values = (
            color_values / 255.0 if color_values.dtype == np.uint8 else color_values.astype(float)
        )
        linear_colors = _light(mesh.look, color_values[:, :3])
        return {'COLOR_0': np.hstack([linear_colors, color_values[:, 3:]])}

    def _influences(self, skin):
        """Add joints and weights in sets of four."""
        vertex_count, influence_count = skin.joints.shape
        index_type = np.uint8 if len(skin.nodes) <= 256 else np.uint16
        if len(skin.nodes) > 65536:
            raise ValueError(
                f'skin must have at most 65536 joints to be written as glTF, got {len(skin.nodes)}'
            )
        joints, weights = (
            np.zeros((vertex_count, -influence_count % 4 + influence_count), index_type),
            np.zeros((vertex_count, -influence_count % 4 + influence_count)),
        )
        # A joint without weight is to be 0 in glTF.
        joints[:, :influence_count] = np.where(skin.weights > 0, skin.joints, 0)
        weights[:, :influence_count] = skin.weights
        sets = {}
        for i in range(joints.shape[1] // 4):
            columns = slice(4 * i, 4 * i + 4)
            sets[f'JOINTS_{i}'] = self._glb.accessor(np.ascontiguousarray(joints[:, columns]))
            sets[f'WEIGHTS_{i}'] = self._glb.accessor(weights[:, columns])
        return sets

    def _targets(self, mesh, has_normals):
        """Add morph targets; frames but the first one are the first of them."""
        attribute_keys = {'POSITION': 'positions'} | ({'NORMAL': 'normals'} if has_normals else {})
        targets, weights, names = [], [], []
        if mesh.frames is not None:
            targets = self._frame_targets(mesh, attribute_keys)
            weights = one_hot(mesh.frames)[0].tolist()
            names = [f'frame{i + 1}' for i in range(len(targets))]
        if mesh.morphs is not None:
            targets += [self._target(mesh, attribute_keys, i) for i in range(len(mesh.morphs))]
            weights += mesh.morphs.weights.tolist()
            names += mesh.morphs.names
            for name in ('tangents', 'colors'):
                if mesh.morphs.has(name):
                    self._left_out[f'{name} of morph targets'] = None
        return targets, weights, names

    def _frame_targets(self, mesh, attribute_keys):
        frames = mesh.frames
        first_frame = dict(zip(attribute_keys, _neutral(mesh), strict=False))
        return [
            {
                key: self._delta(slice(None), getattr(frames, name)[i] - first_frame[key])
                for key, name in attribute_keys.items()
            }
            for i in range(1, len(frames.times))
        ]

    def _target(self, mesh, attribute_keys, target_index):
        target = {}
        for key, name in attribute_keys.items():
            if key == 'POSITION' or mesh.morphs.has(name):
                vertex_indices, values = mesh.morphs.target(name, target_index) or _NOTHING
                target[key] = self._delta(vertex_indices, values, len(mesh.points))
        return target

    def _delta(self, vertex_indices, values, point_count=0):
        if isinstance(vertex_indices, slice):
            return self._glb.accessor(values, limits=True)
        unique_vertices, sum_rows = np.unique(vertex_indices, return_inverse=True)
        summed_values = np.zeros((len(unique_vertices), values.shape[1]))
        np.add.at(summed_values, sum_rows, values)
        return self._glb.sparse(unique_vertices, summed_values, point_count)

    def _animation(self, clip, host_nodes):
        channels, samplers = [], []
        for node, path, track in self._channels(lasting(clip), host_nodes):
            sampler = {
                'input': self._glb.accessor(track.times, limits=True),
                'output': self._glb.accessor(_output(track)),
                'interpolation': _INTERPOLATIONS[track.interpolation],
            }
            samplers.append(sampler)
            channels.append({'sampler': len(samplers) - 1, 'target': {'node': node, 'path': path}})
        if channels:
            animation = {'name': clip.name, 'channels': channels, 'samplers': samplers}
            self._glb.add('animations', animation)
        else:
            self._left_out[f'the empty clip {clip.name!r}'] = None

    def _channels(self, clip, host_nodes):
        """Return node, path and track of each channel."""
        channel_by_target = {}
        for track in clip.tracks:
            if track.path != 'weights':  # of two for the same, the later one holds
                channel_by_target[track.node, track.path] = int(track.node), track.path, track
        first_column = 0
        for mesh, host_node in zip(self._figure.meshes, host_nodes, strict=True):
            track = weights_track(clip, first_column, mesh)
            first_column += mesh.n_targets
            if track is not None and host_node is not None:
                channel_by_target[host_node, 'weights'] = host_node, 'weights', track
        return list(channel_by_target.values())

    def _material(self, look):
        color = _light(look, np.array(pv.Color(look.get('color', 'white')).float_rgb))
        alpha = float(look.get('opacity', 1.0))
        reflection = {
            'baseColorFactor': [*np.clip(color, 0, 1).tolist(), alpha],
            'metallicFactor': float(look.get('metallic', 0.0)) if look.get('pbr') else 0.0,
            'roughnessFactor': float(look.get('roughness', 0.5)) if look.get('pbr') else 1.0,
        }
        textures = {'baseColorTexture': look.get('texture')}
        for name, texture in (look.get('pbr_textures') or {}).items():
            if name not in _TEXTURES:
                self._left_out[f'textures of the kind {name}'] = None
            textures |= dict.fromkeys(_TEXTURES.get(name, ()), texture)
        entries = {
            name: {'index': self._texture(texture)}
            for name, texture in textures.items()
            if texture is not None
        }
        names = 'baseColorTexture', 'metallicRoughnessTexture'
        reflection |= {name: entries.pop(name) for name in names if name in entries}
        if 'emissive_factor' in look:
            if max(look['emissive_factor']) > 1:
                self._left_out['light above 1'] = None
            entries['emissiveFactor'] = np.clip(look['emissive_factor'], 0, 1).tolist()
        return self._glb.material(
            reflection,
            **entries,
            cutoff=look.get('alpha_cutoff'),
            blends=alpha < 1 or _translucent(look.get('texture')),
            two_sided=look.get('culling') not in ('back', True),
            lit=look.get('lighting') is not False,
        )

    def _texture(self, texture):
        if id(texture) not in self._textures:
            self._textures[id(texture)] = self._glb.texture(texture.to_array())
        return self._textures[id(texture)]


def _neutral(mesh):
    """Return points and normals that morph targets are added to."""
    if mesh.frames is None:
        return mesh.points, mesh.normals
    frame_arrays = mesh.frames.positions, mesh.frames.normals
    return tuple(np.asarray(shape[0], dtype=np.float64) for shape in frame_arrays)


def _translucent(texture):
    return texture is not None and texture.to_array().shape[-1] in (2, 4)


def _output(track):
    values = np.roll(track.values, -1, -1) if track.path == 'rotation' else track.values
    return values.reshape(-1) if track.path == 'weights' else values.reshape(-1, track.width)


def _light(look, colors):
    """Return colours as linear light, which those of physically based looks are."""
    return colors if look.get('pbr') else to_light(colors)


def one_hot(frames):
    """Return the weights of all key frames but the first, at each frame's time."""
    return np.eye(len(frames.times))[:, 1:]


def lasting(clip):
    """Return a clip whose last keys are at its end, since glTF stores no duration."""
    last_key = max((track.times[-1] for track in clip.tracks), default=0.0)
    if clip.duration < last_key:
        raise ValueError(
            f'clip {clip.name!r} must last until its last key at {last_key} s to be '
            f'written as glTF, got {clip.duration} s; cut its tracks first'
        )
    if clip.duration == last_key:
        return clip
    tracks = [_extended_track(track, clip.duration) for track in clip.tracks]
    return Clip(clip.name, tracks, clip.duration)


def weights_track(clip, first_column, mesh):
    """Return the weights of a mesh's frames and morph targets as one track."""
    tracks, rest_weights = [], np.zeros(0)
    if mesh.frames is not None:
        tracks.append((0, _frame_track(clip, mesh.frames)))
        rest_weights = np.zeros(len(mesh.frames.times) - 1)
    for track in clip.tracks:
        offset = track.node - first_column  # among the mesh's own targets
        if track.path == 'weights' and -track.width < offset < mesh.n_targets:
            mesh_values = track.values[..., max(-offset, 0) : mesh.n_targets - offset]
            mesh_track = Track(0, 'weights', track.times, mesh_values, track.interpolation)
            tracks.append((len(rest_weights) + max(offset, 0), mesh_track))
    if mesh.morphs is not None:
        rest_weights = np.concatenate([rest_weights, mesh.morphs.weights])
    return _merged_track(clip, tracks, rest_weights) if tracks else None


def _extended_track(track, time):
    """Return a track with one more key that holds the last value."""
    values = track.values.copy()
    end_values = values[-1:].copy()
    if track.interpolation == 'cubic':
        values[-1, 2], end_values[0, 0] = 0, 0  # nothing moves between the two keys
    times = np.append(track.times, time)
    values = np.concatenate([values, end_values])
    return Track(track.node, track.path, times, values, track.interpolation)


def _frame_track(clip, frames):
    period = f'a period of {frames.period} s' if frames.period is not None else None
    frame_kind = 'states' if frames.states is not None else period or frames.interpolation
    if frame_kind not in ('linear', 'step'):
        raise ValueError(
            'vertex animation must be linear or stepped key frames to be written as glTF, '
            f'got {frame_kind}; convert it by Figure.series'
        )
    times, values = frames.times, one_hot(frames)
    keep = times <= clip.duration
    if not keep.all():
        frame_indices, frame_weights = frames.at(clip.duration)
        end = (np.eye(len(times))[frame_indices] * frame_weights[:, None]).sum(0)[1:]
        times, values = np.append(times[keep], clip.duration), np.vstack([values[keep], end])
        times, index = np.unique(times, return_index=True)
        values = values[index]
    return Track(0, 'weights', times, values, frames.interpolation)


def _merged_track(clip, tracks, rest):
    """Return one track of all weights from tracks of some of them."""
    first_track = tracks[0][1]
    same_keys = all(
        track.interpolation == first_track.interpolation
        and np.array_equal(track.times, first_track.times)
        for _, track in tracks
    )
    if not same_keys:
        raise ValueError(
            f'clip {clip.name!r} must drive the weights of a mesh by equal keys to be '
            'written as glTF, got different ones; merge its tracks'
        )
    values = np.zeros((*first_track.values.shape[:-1], len(rest)))
    values[(slice(None), 1) if first_track.interpolation == 'cubic' else slice(None)] = rest
    for first_target, track in tracks:
        values[..., first_target : first_target + track.width] = track.values
    return Track(0, 'weights', first_track.times, values, first_track.interpolation)
