"""Meshes and scenes of trimesh as PyVista meshes with their materials."""

from __future__ import annotations

import sys

import numpy as np
import pyvista as pv

from pvibr.core.errors import warn

COLORS = 'trimesh_colors'
#: Bytes of a file in which it names its materials.
_HEAD_BYTES = 1 << 16
_INSTANCING = 'EXT_mesh_gpu_instancing'


def is_trimesh(value, class_name):
    """Return whether a value is an instance of a trimesh class, without importing trimesh."""
    module = sys.modules.get('trimesh')
    return module is not None and isinstance(value, getattr(module, class_name))


def has_materials(path) -> bool:
    """Return True if a file of Wavefront names a library of materials that is there."""
    with path.open('rb') as file:
        head = file.read(_HEAD_BYTES)
    names = [line[6:].strip() for line in head.splitlines() if line.startswith(b'mtllib')]
    return any((path.parent / name.decode(errors='replace')).is_file() for name in names)


def read_trimesh(path):
    """Read a scene from a file."""
    import trimesh

    scene = trimesh.load_scene(path, process=False)
    if not scene.geometry:
        raise ValueError('the file has no geometry')
    return scene


def trimesh_instances(scene):
    """Return the meshes of a scene, and index and matrices of their instances."""
    names: dict[str, int] = {}
    index, matrices = [], []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph.get(node)
        if not is_trimesh(scene.geometry[name], 'Trimesh') or not len(scene.geometry[name].faces):
            kind = type(scene.geometry[name]).__name__
            warn(f'geometry {name!r} ({kind}) has no triangles and is not drawn')
            continue
        _warn_dropped(scene, node)
        matrices.append(matrix)
        index.append(names.setdefault(name, len(names)))
    if not names:
        raise ValueError('the trimesh scene has no triangle mesh')
    return [scene.geometry[name] for name in names], np.array(index), np.array(matrices)


def as_dataset(mesh, pbr=False, textures=None):
    """Return a trimesh as PolyData, and the add_mesh keywords of its material."""
    dataset = pv.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces))
    # Only normals of the file, as the public property computes missing ones.
    normals = mesh._cache.cache.get('vertex_normals')  # noqa: SLF001
    if normals is not None and len(normals) == dataset.n_points:
        dataset.point_data.active_normals = np.array(normals)
    textures = {} if textures is None else textures
    visual = mesh.visual
    if visual.kind == 'vertex':
        return dataset, _colored(dataset.point_data, visual.vertex_colors)
    if visual.kind == 'face':
        return dataset, _colored(dataset.cell_data, visual.face_colors)
    if visual.kind == 'texture':
        return dataset, _material_look(dataset, visual, pbr, textures)
    return dataset, {}


def _warn_dropped(scene, node):
    parent = scene.graph.transforms.parents.get(node)
    metadata = scene.graph.transforms.edge_data.get((parent, node), {}).get('metadata') or {}
    if _INSTANCING in metadata.get('gltf_extensions', {}):
        warn(
            f'trimesh drops {_INSTANCING} of node {node!r}, so one instance is drawn: pass the '
            'path of the file instead of the trimesh scene'
        )


def _colored(data, colors):
    colors = np.asarray(colors, dtype=np.uint8)
    # With an alpha channel VTK would sort the mesh as translucent.
    data[COLORS] = colors if (colors[:, 3] < 255).any() else np.ascontiguousarray(colors[:, :3])
    data.active_scalars_name = COLORS
    preference = 'point' if data.association == pv.FieldAssociation.POINT else 'cell'
    return {'scalars': COLORS, 'rgb': True, 'preference': preference}


def _material_look(dataset, visual, pbr, textures):
    material = visual.material
    alpha_mode = getattr(material, 'alphaMode', None) or 'OPAQUE'
    look = _base_color(material, alpha_mode)
    if pbr:
        look |= _metalness(material)
    image = getattr(material, 'baseColorTexture', None) or getattr(material, 'image', None)
    if image is not None and visual.uv is not None:
        dataset.active_texture_coordinates = np.array(visual.uv, dtype=np.float32)
        look['texture'] = _texture(image, alpha_mode, textures)
    colors = visual.vertex_attributes.get('color')
    if colors is not None and len(colors) == dataset.n_points:
        look |= _colored(dataset.point_data, _as_bytes(colors))
    if alpha_mode == 'MASK':
        cutoff = getattr(material, 'alphaCutoff', None)
        look['alpha_cutoff'] = 0.5 if cutoff is None else float(cutoff)
    return look


def _base_color(material, alpha_mode):
    factor = getattr(material, 'baseColorFactor', None)
    factor = getattr(material, 'diffuse', None) if factor is None else factor
    if factor is None:
        return {'color': 'white'}
    rgba = _as_bytes(np.asarray(factor)[None])[0] / 255
    look = {'color': tuple(rgba[:3].tolist())}
    return look | ({'opacity': float(rgba[3])} if alpha_mode == 'BLEND' and rgba[3] < 1 else {})


def _metalness(material):
    factors = {
        'metallic': getattr(material, 'metallicFactor', None),
        'roughness': getattr(material, 'roughnessFactor', None),
    }
    return {name: 1.0 if value is None else float(value) for name, value in factors.items()}


def _as_bytes(colors):
    """Return (n, 4) uint8 colours from uint8, uint16 or floats, with or without alpha."""
    colors = np.asarray(colors)
    if colors.dtype.kind == 'f':
        colors = np.clip(colors, 0, 1) * 255 + 0.5
    elif colors.dtype.itemsize > 1:
        colors = colors / np.iinfo(colors.dtype).max * 255 + 0.5
    rgba = np.full((len(colors), 4), 255, dtype=np.uint8)
    rgba[:, : colors.shape[1]] = colors
    return rgba


def _texture(image, alpha_mode, textures):
    cache_key = (hash(image.tobytes()), image.size, alpha_mode == 'OPAQUE')
    if cache_key not in textures:
        # OPAQUE ignores alpha, which VTK would blend.
        pixels = np.asarray(image.convert('RGB' if alpha_mode == 'OPAQUE' else 'RGBA'))
        textures[cache_key] = pv.Texture(pixels)
        textures[cache_key].interpolate = True
    return textures[cache_key]
