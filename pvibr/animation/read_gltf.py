"""The glTF 2.0 reader."""

from __future__ import annotations

import copy

import numpy as np

from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.gltf_lights import cameras_of, lights_of
from pvibr.animation.gltf_materials import Looks
from pvibr.animation.gltf_meshes import Primitives, Surface
from pvibr.animation.gltf_nodes import (
    INSTANCING,
    clips_of,
    copies_of,
    parents_of,
    scene_nodes,
    skeleton_of,
    visible_nodes,
    with_copies,
)
from pvibr.core.arguments import check_one_of
from pvibr.core.files import naming_file
from pvibr.io.gltf_accessors import Accessors
from pvibr.io.gltf_file import GltfError, GltfFile, follow, naming
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
#: Prefixes of extensions that change only looks: a figure is read without them.
_LOOKS_ONLY = (
    'KHR_materials_',
    'KHR_texture_',
    'EXT_texture_',
    'MSFT_texture_',
    'KHR_technique',
    'KHR_xmp',
)
#: Most instances that become separate meshes.
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
        Axis that points up in the figure. 'y', as in glTF, keeps the file's coordinates; in scenes
        whose z points up pass 'z': :meth:`pvibr.Figure.upright` turns the figure.
    pbr : bool, optional
        Use physically based looks (``pbr``, ``metallic`` and ``roughness`` of ``add_mesh``), as
        the file specifies. They are dark without ``plotter.set_environment_texture``. Looks of
        either kind may hold ``pbr_textures`` (maps of normals and of emitted light, too) and
        ``emissive_factor``, which ``add_animated`` and ``add_instances`` draw.

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
    >>> fox = pvibr.read_gltf('Fox.glb', up='z')  # doctest: +SKIP
    >>> fox.mesh(0.5, 'Walk').plot()  # doctest: +SKIP
    """
    check_one_of('up', up, ('y', 'z'))
    with naming_file(path, GltfError):
        figure = _figure_of(GltfFile(path), scene, pbr)
    return figure.upright() if up == 'z' else figure


def _figure_of(gltf_file, scene, pbr) -> Figure:
    """Return the figure of a scene of a file."""
    _check_extensions(gltf_file, EXTENSIONS)
    node_indices, visible_indices, skeleton = _graph(gltf_file, scene)
    accessors = Accessors(gltf_file)
    skeleton, joints_by_node = with_copies(
        skeleton, _affordable_copies(gltf_file, copies_of(gltf_file, accessors, visible_indices))
    )
    meshes, targets = _Meshes(gltf_file, accessors, pbr).read(visible_indices, joints_by_node)
    clips = clips_of(gltf_file, accessors, targets)
    with naming('the figure'):
        cameras, lights = cameras_of(gltf_file, node_indices), lights_of(gltf_file, node_indices)
        figure = Figure(meshes, skeleton, clips, None, cameras, lights, gltf_file.path.stem)
    gltf_file.warn()
    return figure


def _affordable_copies(gltf_file, instance_copies):
    """Return instances, or none if there are too many for separate actors."""
    count = sum(len(moves) for moves, _, _ in instance_copies.values())
    if count <= _MOST_COPIES:
        return instance_copies
    gltf_file.leave_out(f'{count} instances', f'{INSTANCING}: add_instances(path) draws them')
    return {}


def read_scene(path, pbr=False):
    """Return a figure of the default scene without clips, and instances (k, 4, 4) by node."""
    with naming_file(path, GltfError):
        return _scene_of(GltfFile(path), pbr)


def _scene_of(gltf_file, pbr):
    """Return the figure and the instances of the default scene of a file."""
    _check_extensions(gltf_file, EXTENSIONS)
    _, nodes, skeleton = _graph(gltf_file, None)
    accessors = Accessors(gltf_file)
    copies = copies_of(gltf_file, accessors, nodes)
    meshes, _ = _Meshes(gltf_file, accessors, pbr, wires=False).read(nodes)
    with naming('the scene'):
        figure = Figure(meshes, skeleton)
    gltf_file.warn()
    return figure, {node: trs(*parts) for node, parts in copies.items()}


def _graph(gltf_file, scene):
    """Return the nodes of the scene, those that are visible, and all nodes as a skeleton."""
    parents = parents_of(gltf_file)
    nodes = scene_nodes(gltf_file, parents, scene)
    return nodes, visible_nodes(gltf_file, parents, nodes), skeleton_of(gltf_file, parents)


def _check_extensions(gltf_file, supported):
    document = gltf_file.document
    unsupported_names = [
        name
        for name in document.extensions_required
        if name not in supported and not name.startswith(_LOOKS_ONLY)
    ]
    if unsupported_names:
        unsupported = ', '.join(unsupported_names)[:200]
        known = ', '.join(supported)
        raise GltfError(f'extensionsRequired must be among {known}, got {unsupported}')
    for name in document.extensions_used:
        if name not in supported:
            gltf_file.leave_out(name[:80], 'extensionsUsed')
    for name in gltf_file.extensions():
        if name not in supported:
            gltf_file.leave_out(name, 'not in extensionsUsed')


class _Meshes:
    """The meshes of the visible nodes."""

    def __init__(self, file, accessors, pbr, wires=True):
        self._file = file
        self._looks = Looks(file, pbr)
        self._first_meshes: dict[Surface, FigureMesh] = {}
        self._look_cache: dict[tuple, dict] = {}
        self._primitives = Primitives(file, accessors, self._looks, wires)

    def read(self, nodes, joints_by_node=None):
        """Return the meshes, and (first column, width, meshes) of weights by node.

        Nodes with instances have a mesh for each of their joints.
        """
        joints_by_node = joints_by_node or {}
        document = self._file.document
        meshes: list[FigureMesh] = []
        weight_columns: dict[int, tuple[int, int, int]] = {}
        column_count = 0
        nodes = [node_index for node_index in nodes if document.nodes[node_index].mesh is not None]
        self._check(nodes, joints_by_node)
        for node_index in nodes:
            node = document.nodes[node_index]
            mesh = document.meshes[node.mesh]
            weights = self._weights(node, mesh, node_index)
            node_meshes = self._of_node(node, mesh, node_index, weights)
            node_meshes = [
                _on_joint(m, joint)
                for joint in joints_by_node.get(node_index, (node_index,))
                for m in node_meshes
            ]
            if len(weights) and node_meshes:
                weight_columns[node_index] = column_count, len(weights), len(node_meshes)
                column_count += len(weights) * len(node_meshes)
            meshes += node_meshes
        return meshes, weight_columns

    def _check(self, node_indices, joints_by_node):
        """Check all references, and that the number of meshes is plausible."""
        document = self._file.document
        for node_index in node_indices:
            node, json_path = document.nodes[node_index], f'nodes[{node_index}]'
            mesh = follow(document.meshes, node.mesh, f'{json_path}.mesh', 'meshes')
            instance_copies = len(joints_by_node.get(node_index, (node_index,)))
            self._file.spend(_MESH * len(mesh.primitives) * instance_copies, f'{json_path}.mesh')
            if node.skin is not None:
                follow(document.skins, node.skin, f'{json_path}.skin', 'skins')

    def _of_node(self, node, mesh, node_index, weights):
        meshes = []
        for i in range(len(mesh.primitives)):
            json_path = f'meshes[{node.mesh}].primitives[{i}]'
            surface = self._primitives.surface(node.mesh, i)
            if surface is None:
                continue
            skin = None
            if node.skin is not None:
                skin = self._primitives.skin(node.mesh, i, node.skin)
            look = self._look(node.mesh, i, surface)
            name = node.name or mesh.name or f'node{node_index}'
            name = name if len(mesh.primitives) == 1 else f'{name}.{i}'
            with naming(json_path):
                morphs = _resting(surface.morphs, weights)
                if surface not in self._first_meshes:
                    self._first_meshes[surface] = FigureMesh(surface.mesh)
                # All nodes with this primitive share its points.
                figure_mesh = copy.copy(self._first_meshes[surface])
                figure_mesh.node, figure_mesh.skin, figure_mesh.morphs = node_index, skin, morphs
                figure_mesh.look, figure_mesh.name = look, name
            meshes.append(figure_mesh)
        return meshes

    def _look(self, mesh_index, primitive_index, surface):
        primitive = self._file.document.meshes[mesh_index].primitives[primitive_index]
        kind = surface.coordinates, surface.colors, surface.tiles, surface.wires, surface.lit
        look_key = primitive.material, *kind
        if look_key not in self._look_cache:
            json_path = f'meshes[{mesh_index}].primitives[{primitive_index}]'
            self._look_cache[look_key] = self._looks.look(
                self._looks.material(primitive.material, f'{json_path}.material'),
                json_path,
                surface,
            )
        return dict(self._look_cache[look_key])

    def _weights(self, node, mesh, node_index):
        """Return the rest weights of a node's morph targets."""
        target_count = len(mesh.primitives[0].targets)
        for i, primitive in enumerate(mesh.primitives):
            if len(primitive.targets) != target_count:
                json_path = f'meshes[{node.mesh}].primitives[{i}]'
                raise GltfError(
                    f'{json_path} must have {target_count} targets, as the first primitive, got '
                    f'{len(primitive.targets)}'
                )
        weights = node.weights if node.weights is not None else mesh.weights
        if weights and len(weights) != target_count:
            raise GltfError(
                f'nodes[{node_index}] must have {target_count} weights, got {len(weights)}'
            )
        self._file.spend(8 * target_count * len(mesh.primitives), f'nodes[{node_index}].mesh')
        return np.array(weights or np.zeros(target_count), dtype=np.float64)


def _on_joint(mesh, joint_index):
    """Return a mesh that shares all arrays, on a joint."""
    if mesh.node == joint_index:
        return mesh
    mesh = copy.copy(mesh)
    mesh.node, mesh.look = joint_index, dict(mesh.look)
    return mesh


def _resting(morphs, weights):
    """Return morph targets with other rest weights that share all arrays."""
    if morphs is None:
        return None
    morphs = copy.copy(morphs)
    morphs.weights = weights.copy()
    return morphs
