"""The glTF 2.0 reader."""

from __future__ import annotations

import copy

import numpy as np

from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.gltf.lights import cameras_of, lights_of
from pvibr.animation.gltf.looks import Looks
from pvibr.animation.gltf.meshes import Primitives, Surface
from pvibr.animation.gltf.nodes import (
    INSTANCING,
    clips_of,
    copies_of,
    drawn_nodes,
    parents_of,
    shown_nodes,
    skeleton_of,
    with_copies,
)
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile, follow, naming
from pvibr.maths.arguments import check_one_of
from pvibr.maths.transforms import trs

#: Supported extensions; others are left out, with a warning.
EXTENSIONS = (
    INSTANCING,
    'EXT_texture_webp',
    'KHR_animation_pointer',
    'KHR_draco_mesh_compression',
    'KHR_lights_punctual',
    'KHR_materials_emissive_strength',
    'KHR_materials_pbrSpecularGlossiness',
    'KHR_materials_unlit',
    'KHR_mesh_quantization',
    'KHR_node_visibility',
    'KHR_texture_transform',
)
#: How the names of extensions begin that change looks alone: a figure is read without them.
_SEEN_ONLY = (
    'KHR_materials_',
    'KHR_texture_',
    'EXT_texture_',
    'MSFT_texture_',
    'KHR_technique',
    'KHR_xmp',
)
#: Most instances that become meshes of their own.
_MOST_COPIES = 100
#: Bytes of a FigureMesh, whose arrays are shared.
_MESH = 4096


def read_gltf(path, *, scene=None, up='y', pbr=False):
    """Read a figure from a glTF 2.0 file, ``.glb`` or ``.gltf``.

    Each node becomes a joint of the same index, each visible primitive a mesh, each animation a
    clip. A mesh without normals is flat, as glTF defines: its triangles share no
    points. Unused points are dropped. Looks of alpha masks hold ``alpha_cutoff``, which
    ``add_mesh`` alone does not support.

    Parameters
    ----------
    path : str or pathlib.Path
        The file. External buffers and images must be in its folder or below.
    scene : int or str, optional
        Index or name of the scene; default the file's default scene, else the first.
    up : {'y', 'z'}
        Up axis of the figure. 'y', as in glTF, keeps the file's coordinates; 'z' appends a root
        joint ``'upright'`` that turns the figure by 90 degrees about x.
    pbr : bool, optional
        Use physically based looks, as the file asks. They are dark without an environment texture
        (``plotter.set_environment_texture``). Looks then hold ``pbr``, ``metallic`` and
        ``roughness`` of ``add_mesh``. Looks of either kind may hold ``pbr_textures`` (maps of
        normals and of emitted light, too) and ``emissive_factor``, which ``add_animated`` and
        ``add_instances`` draw.

    Returns
    -------
    pvibr.Figure
        The figure; its rest pose is that of the nodes.

    Raises
    ------
    pvibr.animation.GltfError
        If the file is broken or requires an unsupported extension; a ``ValueError`` that names the
        place in the file.
    ValueError
        If ``up`` is invalid or there is no such scene.
    FileNotFoundError
        If there is no such file.

    Warns
    -----
    pvibr.PvibrWarning
        Names all features of the file that are not supported.

    Examples
    --------
    >>> import pvibr
    >>> fox = pvibr.read_gltf('Fox.glb')  # doctest: +SKIP
    >>> fox.mesh(0.5, 'Walk').plot()  # doctest: +SKIP
    """
    check_one_of('up', up, ('y', 'z'))
    file = GltfFile(path)
    _check_extensions(file, EXTENSIONS)
    nodes, drawn, skeleton = _graph(file, scene, up)
    accessors = Accessors(file)
    skeleton, joints = with_copies(skeleton, _few(file, copies_of(file, accessors, drawn)))
    meshes, targets = _Meshes(file, accessors, pbr).read(drawn, joints)
    clips = clips_of(file, accessors, targets)
    with naming('the figure'):
        cameras, lights = cameras_of(file, nodes), lights_of(file, nodes)
        figure = Figure(meshes, skeleton, clips, None, cameras, lights, file.path.stem)
    file.warn()
    return figure


def _few(file, copies):
    """Return instances, or none if these are too many for actors of their own."""
    count = sum(len(moves) for moves, _, _ in copies.values())
    if count <= _MOST_COPIES:
        return copies
    file.leave_out(f'{count} instances', f'{INSTANCING}: add_instances(path) draws them')
    return {}


def read_scene(path, pbr=False):
    """Return a figure of the default scene without clips, and instances (k, 4, 4) by node."""
    file = GltfFile(path)
    _check_extensions(file, EXTENSIONS)
    _, nodes, skeleton = _graph(file, None, 'y')
    accessors = Accessors(file)
    copies = {node: trs(*parts) for node, parts in copies_of(file, accessors, nodes).items()}
    meshes, _ = _Meshes(file, accessors, pbr, wires=False).read(nodes)
    with naming('the scene'):
        figure = Figure(meshes, skeleton)
    file.warn()
    return figure, copies


def _graph(file, scene, up):
    """Return the nodes of the scene, those that are visible, and all nodes as a skeleton."""
    parents = parents_of(file)
    nodes = shown_nodes(file, parents, scene)
    return nodes, drawn_nodes(file, parents, nodes), skeleton_of(file, parents, up)


def _check_extensions(file, supported):
    document = file.document
    needed = [name for name in document.extensions_required if not name.startswith(_SEEN_ONLY)]
    unknown = [name for name in needed if name not in supported]
    if unknown:
        asked, known = ', '.join(unknown)[:200], ', '.join(supported)
        raise GltfError(f'extensionsRequired asks for {asked}; supported are {known}.')
    for name in document.extensions_used:
        if name not in supported:
            file.leave_out(name[:80], 'extensionsUsed')
    for name in file.extensions():
        if name not in supported:
            file.leave_out(name, 'not in extensionsUsed')


class _Meshes:
    """The meshes of the visible nodes."""

    def __init__(self, file, accessors, pbr, wires=True):
        self._file = file
        self._looks = Looks(file, pbr)
        self._first: dict[Surface, FigureMesh] = {}
        self._known: dict[tuple, dict] = {}
        self._primitives = Primitives(file, accessors, self._looks, wires)

    def read(self, nodes, joints=None):
        """Return the meshes, and (first column, width, meshes) of weights by node.

        Nodes with instances have a mesh for each of their joints.
        """
        joints = joints or {}
        document = self._file.document
        meshes: list[FigureMesh] = []
        targets: dict[int, tuple[int, int, int]] = {}
        columns = 0
        nodes = [number for number in nodes if document.nodes[number].mesh is not None]
        self._check(nodes, joints)
        for number in nodes:
            node = document.nodes[number]
            mesh = document.meshes[node.mesh]
            weights = self._weights(node, mesh, number)
            shown = self._of_node(node, mesh, number, weights)
            shown = [_on(m, joint) for joint in joints.get(number, (number,)) for m in shown]
            if len(weights) and shown:
                targets[number] = (columns, len(weights), len(shown))
                columns += len(weights) * len(shown)
            meshes += shown
        return meshes, targets

    def _check(self, nodes, joints):
        """Check all references, and that the number of meshes is plausible."""
        document = self._file.document
        for number in nodes:
            node, place = document.nodes[number], f'nodes[{number}]'
            mesh = follow(document.meshes, node.mesh, f'{place}.mesh', 'meshes')
            copies = len(joints.get(number, (number,)))
            self._file.spend(_MESH * len(mesh.primitives) * copies, f'{place}.mesh')
            if node.skin is not None:
                follow(document.skins, node.skin, f'{place}.skin', 'skins')

    def _of_node(self, node, mesh, number, weights):
        meshes = []
        for i in range(len(mesh.primitives)):
            place = f'meshes[{node.mesh}].primitives[{i}]'
            surface = self._primitives.surface(node.mesh, i)
            if surface is None:
                continue
            skin = None
            if node.skin is not None:
                skin = self._primitives.skin(node.mesh, i, node.skin)
            look = self._look(node.mesh, i, surface)
            name = node.name or mesh.name or f'node{number}'
            name = name if len(mesh.primitives) == 1 else f'{name}.{i}'
            with naming(place):
                morphs = _resting(surface.morphs, weights)
                if surface not in self._first:
                    self._first[surface] = FigureMesh(surface.mesh)
                # All nodes with this primitive share its points.
                figure_mesh = copy.copy(self._first[surface])
                figure_mesh.node, figure_mesh.skin, figure_mesh.morphs = number, skin, morphs
                figure_mesh.look, figure_mesh.name = look, name
            meshes.append(figure_mesh)
        return meshes

    def _look(self, mesh, number, surface):
        primitive = self._file.document.meshes[mesh].primitives[number]
        kind = surface.coordinates, surface.colors, surface.tiles, surface.wires, surface.lit
        key = primitive.material, *kind
        if key not in self._known:
            place = f'meshes[{mesh}].primitives[{number}]'
            self._known[key] = self._looks.look(
                self._looks.material(primitive.material, f'{place}.material'),
                place,
                surface,
            )
        return dict(self._known[key])

    def _weights(self, node, mesh, number):
        """Return the rest weights of a node's morph targets."""
        n = len(mesh.primitives[0].targets)
        for i, primitive in enumerate(mesh.primitives):
            if len(primitive.targets) != n:
                place = f'meshes[{node.mesh}].primitives[{i}]'
                raise GltfError(
                    f'{place} has {len(primitive.targets)} targets, the first primitive {n}.'
                )
        weights = node.weights if node.weights is not None else mesh.weights
        if weights and len(weights) != n:
            raise GltfError(f'nodes[{number}] has {len(weights)} morph weights for {n} targets.')
        self._file.spend(8 * n * len(mesh.primitives), f'nodes[{number}].mesh')
        return np.array(weights or np.zeros(n), dtype=np.float64)


def _on(mesh, joint):
    """Return a mesh that shares all arrays, on a joint."""
    if mesh.node == joint:
        return mesh
    mesh = copy.copy(mesh)
    mesh.node, mesh.look = joint, dict(mesh.look)
    return mesh


def _resting(morphs, weights):
    """Return morph targets with other rest weights that share all arrays."""
    if morphs is None:
        return None
    morphs = copy.copy(morphs)
    morphs.weights = weights.copy()
    return morphs
