"""Figures as binary glTF 2.0."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.animation.clip import Clip
from pvibr.animation.gltf.write_tracks import lasting, one_hot, weights_track
from pvibr.core.errors import warn
from pvibr.core.files import with_suffix
from pvibr.formats.glb_writer import GlbWriter
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
    """The parts of a figure as those of a document."""

    def __init__(self, figure):
        self._figure = figure
        self._glb = GlbWriter()
        self._left_out = {}
        self._skins = {}
        self._textures = {}
        self._hung = set()  # further nodes that hang on a joint

    def document(self):
        figure = self._figure
        for name in ('correctives', 'cameras', 'lights'):
            if getattr(figure, name):
                self._left_out[name] = None
        nodes = self._nodes()
        hosts = [self._host(nodes, mesh) for mesh in figure.meshes]
        clips = figure.clips
        if not clips and any(mesh.frames for mesh in figure.meshes):
            last = max(mesh.frames.times[-1] for mesh in figure.meshes if mesh.frames)
            clips = [Clip(figure.name or 'series', [], last)]
        for clip in clips:
            self._animation(clip, hosts)
        self._scene(nodes)
        if self._left_out:
            warn(f'left out, since it is not written as glTF: {", ".join(self._left_out)}.')
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

    def _host(self, nodes, mesh):
        """Return the node of a mesh: its joint, or a new node if another mesh has that one."""
        number = self._mesh(mesh)
        if number is None:
            return None
        host = mesh.node
        if host < 0 or 'mesh' in nodes[host]:
            host = self._glb.add('nodes', {'name': mesh.name or f'mesh{len(nodes)}'})
            if mesh.node >= 0 and mesh.skin is None:
                nodes[mesh.node].setdefault('children', []).append(host)
                self._hung.add(host)
        nodes[host]['mesh'] = number
        if mesh.skin is not None:
            nodes[host]['skin'] = self._skin(mesh.skin)
        return host

    def _scene(self, nodes):
        parents = self._figure.skeleton.parents
        for joint, parent in enumerate(parents):
            if parent >= 0:
                nodes[parent].setdefault('children', []).append(joint)
        more = range(len(parents), len(nodes))
        roots = [int(i) for i in np.flatnonzero(parents < 0)]
        roots += [i for i in more if i not in self._hung]
        self._glb.scene(roots, **({'name': self._figure.name} if self._figure.name else {}))
        if not nodes:
            del self._glb.document['nodes']

    def _skin(self, skin):
        if skin not in self._skins:
            matrices = np.swapaxes(skin.inverse_bind, 1, 2).reshape(-1, 16)  # column by column
            bind = self._glb.accessor(matrices)
            thing = {'joints': skin.nodes.tolist(), 'inverseBindMatrices': bind}
            self._skins[skin] = self._glb.add('skins', thing)
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
        entry = {'name': mesh.name} if mesh.name else {}
        entry['primitives'] = [primitive]
        targets, weights, names = self._targets(mesh, normals.any())
        if targets:
            primitive['targets'] = targets
            entry |= {'weights': weights, 'extras': {'targetNames': names}}
        return self._glb.add('meshes', entry)

    def _colors(self, mesh):
        if mesh.look.get('scalars') is None:
            return {}
        values = mesh.mesh.point_data.get(mesh.look['scalars'])
        if not mesh.look.get('rgb') or values is None:
            self._left_out['scalars that are no colours of points'] = None
            return {}
        values = np.asarray(values)
        values = values / 255.0 if values.dtype == np.uint8 else values.astype(float)
        light = _light(mesh.look, values[:, :3])
        return {'COLOR_0': np.hstack([light, values[:, 3:]])}

    def _influences(self, skin):
        """Add joints and weights in sets of four."""
        v, k = skin.joints.shape
        kind = np.uint8 if len(skin.nodes) <= 256 else np.uint16
        if len(skin.nodes) > 65536:
            raise ValueError(f'a skin has {len(skin.nodes)} joints; glTF counts them up to 65536.')
        joints, weights = np.zeros((v, -k % 4 + k), kind), np.zeros((v, -k % 4 + k))
        # A joint without weight is to be 0 in glTF.
        joints[:, :k] = np.where(skin.weights > 0, skin.joints, 0)
        weights[:, :k] = skin.weights
        sets = {}
        for i in range(joints.shape[1] // 4):
            columns = slice(4 * i, 4 * i + 4)
            sets[f'JOINTS_{i}'] = self._glb.accessor(np.ascontiguousarray(joints[:, columns]))
            sets[f'WEIGHTS_{i}'] = self._glb.accessor(weights[:, columns])
        return sets

    def _targets(self, mesh, has_normals):
        """Add morph targets; frames but the first one are the first of them."""
        what = {'POSITION': 'positions'} | ({'NORMAL': 'normals'} if has_normals else {})
        targets, weights, names = [], [], []
        if mesh.frames is not None:
            targets = self._frame_targets(mesh, what)
            weights = one_hot(mesh.frames)[0].tolist()
            names = [f'frame{i + 1}' for i in range(len(targets))]
        if mesh.morphs is not None:
            targets += [self._target(mesh, what, i) for i in range(len(mesh.morphs))]
            weights += mesh.morphs.weights.tolist()
            names += mesh.morphs.names
            for name in ('tangents', 'colors'):
                if mesh.morphs.has(name):
                    self._left_out[f'{name} of morph targets'] = None
        return targets, weights, names

    def _frame_targets(self, mesh, what):
        frames = mesh.frames
        first = dict(zip(what, _neutral(mesh), strict=False))
        return [
            {
                key: self._delta(slice(None), getattr(frames, name)[i] - first[key])
                for key, name in what.items()
            }
            for i in range(1, len(frames.times))
        ]

    def _target(self, mesh, what, i):
        target = {}
        for key, name in what.items():
            if key == 'POSITION' or mesh.morphs.has(name):
                where, values = mesh.morphs.target(name, i) or _NOTHING
                target[key] = self._delta(where, values, len(mesh.points))
        return target

    def _delta(self, where, values, n=0):
        if isinstance(where, slice):
            return self._glb.accessor(values, limits=True)
        rows, place = np.unique(where, return_inverse=True)
        total = np.zeros((len(rows), values.shape[1]))
        np.add.at(total, place, values)
        return self._glb.sparse(rows, total, n)

    def _animation(self, clip, hosts):
        channels, samplers = [], []
        for node, path, track in self._channels(lasting(clip), hosts):
            sampler = {
                'input': self._glb.accessor(track.times, limits=True),
                'output': self._glb.accessor(_output(track)),
                'interpolation': _INTERPOLATIONS[track.interpolation],
            }
            samplers.append(sampler)
            target = {'node': node, 'path': path}
            channels.append({'sampler': len(samplers) - 1, 'target': target})
        if channels:
            animation = {'name': clip.name, 'channels': channels, 'samplers': samplers}
            self._glb.add('animations', animation)
        else:
            self._left_out[f'the empty clip {clip.name!r}'] = None

    def _channels(self, clip, hosts):
        """Return node, path and track of each channel."""
        found = {}
        for track in clip.tracks:
            if track.path != 'weights':  # of two for the same, the later one holds
                found[track.node, track.path] = (int(track.node), track.path, track)
        first = 0
        for mesh, host in zip(self._figure.meshes, hosts, strict=True):
            track = weights_track(clip, first, mesh)
            first += mesh.n_targets
            if track is not None and host is not None:
                found[host, 'weights'] = (host, 'weights', track)
        return list(found.values())

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
        indices = {
            name: {'index': self._texture(texture)}
            for name, texture in textures.items()
            if texture is not None
        }
        own = ('baseColorTexture', 'metallicRoughnessTexture')
        reflection |= {name: indices.pop(name) for name in own if name in indices}
        if 'emissive_factor' in look:
            if max(look['emissive_factor']) > 1:
                self._left_out['light above 1'] = None
            indices['emissiveFactor'] = np.clip(look['emissive_factor'], 0, 1).tolist()
        return self._glb.material(
            reflection,
            **indices,
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
    shapes = mesh.frames.positions, mesh.frames.normals
    return tuple(np.asarray(shape[0], dtype=np.float64) for shape in shapes)


def _translucent(texture):
    return texture is not None and texture.to_array().shape[-1] in (2, 4)


def _output(track):
    values = np.roll(track.values, -1, -1) if track.path == 'rotation' else track.values
    return values.reshape(-1) if track.path == 'weights' else values.reshape(-1, track.width)


def _light(look, colors):
    """Return colours as linear light, which those of physically based looks are."""
    return colors if look.get('pbr') else to_light(colors)
