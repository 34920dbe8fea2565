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
    parents_of,
    shown_nodes,
    skeleton_of,
)
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile, follow, naming

#: Supported extensions; others are left out, with a warning.
EXTENSIONS = (
    'EXT_texture_webp',
    'KHR_lights_punctual',
    'KHR_materials_emissive_strength',
    'KHR_materials_pbrSpecularGlossiness',
    'KHR_materials_unlit',
    'KHR_mesh_quantization',
    'KHR_texture_transform',
)
#: Bytes of a FigureMesh, whose arrays are shared.
_MESH = 4096


def read_gltf(path, *, scene=None, up='y', pbr=False):
    """Read a figure from a glTF 2.0 file, ``.glb`` or ``.gltf``.

    Each node becomes a joint of the same index, each visible primitive of triangles a mesh, each
    animation a clip. A mesh without normals is flat, as glTF defines: its triangles share no
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
        ``roughness`` of ``add_mesh``, and ``pbr_textures`` and ``emissive_factor``, which
        ``add_animated`` supports.

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
    if up not in ('y', 'z'):
        msg = f"up is {up!r}; it must be 'y' or 'z'."
        raise ValueError(msg)
    file = GltfFile(path)
    _check_extensions(file, EXTENSIONS)
    nodes, skeleton = _graph(file, scene, up)
    accessors = Accessors(file)
    meshes, targets = _Meshes(file, accessors, pbr, skeleton).read(nodes)
    clips = clips_of(file, accessors, targets)
    with naming('the figure'):
        cameras, lights = cameras_of(file, nodes), lights_of(file, nodes)
        figure = Figure(meshes, skeleton, clips, None, cameras, lights, file.path.stem)
    file.warn()
    return figure


def read_scene(path, pbr=False):
    """Return a figure of the default scene without clips, and instances (k, 4, 4) by node."""
    file = GltfFile(path)
    _check_extensions(file, (*EXTENSIONS, INSTANCING))
    nodes, skeleton = _graph(file, None, 'y')
    accessors = Accessors(file)
    copies = copies_of(file, accessors, nodes)
    meshes, _ = _Meshes(file, accessors, pbr, skeleton, copies).read(nodes)
    with naming('the scene'):
        figure = Figure(meshes, skeleton)
    file.warn()
    return figure, copies


def _graph(file, scene, up):
    """Return the visible nodes, and all nodes as a skeleton."""
    parents = parents_of(file)
    return shown_nodes(file, parents, scene), skeleton_of(file, parents, up)


def _check_extensions(file, supported):
    document = file.document
    unknown = [name for name in document.extensions_required if name not in supported]
    if unknown:
        asked, known = ', '.join(unknown)[:200], ', '.join(supported)
        msg = f'extensionsRequired asks for {asked}; supported are {known}.'
        raise GltfError(msg)
    for name in document.extensions_used:
        if name not in supported:
            file.leave_out(name[:80], 'extensionsUsed')


class _Meshes:
    """The meshes of the visible nodes."""

    def __init__(self, file, accessors, pbr, skeleton, copies=None):
        self._file = file
        self._looks = Looks(file, pbr)
        self._first: dict[Surface, FigureMesh] = {}
        self._known: dict[tuple, dict] = {}
        self._primitives = Primitives(file, accessors, self._looks)
        self._mirrored = np.linalg.det(skeleton.world(skeleton.rest)[:, :3, :3]) < 0
        for node, matrices in (copies or {}).items():
            flips = np.linalg.det(matrices[:, :3, :3]) < 0
            self._mirrored[node] = (flips != self._mirrored[node]).any()

    def read(self, nodes):
        """Return the meshes, and (first column, width, meshes) of weights by node."""
        document = self._file.document
        meshes: list[FigureMesh] = []
        targets: dict[int, tuple[int, int, int]] = {}
        columns = 0
        nodes = [number for number in nodes if document.nodes[number].mesh is not None]
        self._check(nodes)
        for number in nodes:
            node = document.nodes[number]
            mesh = document.meshes[node.mesh]
            weights = self._weights(node, mesh, number)
            shown = self._of_node(node, mesh, number, weights)
            if weights and shown:
                targets[number] = (columns, len(weights), len(shown))
                columns += len(weights) * len(shown)
            meshes += shown
        return meshes, targets

    def _check(self, nodes):
        """Check all references, and that the number of meshes is plausible."""
        document = self._file.document
        for number in nodes:
            node, place = document.nodes[number], f'nodes[{number}]'
            mesh = follow(document.meshes, node.mesh, f'{place}.mesh', 'meshes')
            self._file.spend(_MESH * len(mesh.primitives), f'{place}.mesh')
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
            look = self._look(node.mesh, i, surface, skin is None and self._mirrored[number])
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

    def _look(self, mesh, number, surface, mirrored):
        key = (mesh, number, bool(mirrored))
        if key not in self._known:
            primitive = self._file.document.meshes[mesh].primitives[number]
            place = f'meshes[{mesh}].primitives[{number}]'
            self._known[key] = self._looks.look(
                self._looks.material(primitive.material, f'{place}.material'),
                place,
                coordinates=surface.coordinates,
                colors=surface.colors,
                mirrored=mirrored,
            )
        return dict(self._known[key])

    def _weights(self, node, mesh, number):
        """Return the rest weights of a node's morph targets."""
        n = len(mesh.primitives[0].targets)
        for i, primitive in enumerate(mesh.primitives):
            if len(primitive.targets) != n:
                place = f'meshes[{node.mesh}].primitives[{i}]'
                msg = f'{place} has {len(primitive.targets)} targets, the first primitive {n}.'
                raise GltfError(msg)
        weights = node.weights if node.weights is not None else mesh.weights
        if weights and len(weights) != n:
            msg = f'nodes[{number}] has {len(weights)} morph weights for {n} targets.'
            raise GltfError(msg)
        self._file.spend(8 * n * len(mesh.primitives), f'nodes[{number}].mesh')
        return tuple(weights) or (0.0,) * n


def _resting(morphs, weights):
    """Return morph targets with other rest weights that share all arrays."""
    if morphs is None:
        return None
    morphs = copy.copy(morphs)
    morphs.weights = np.array(weights, dtype=np.float64)
    return morphs
