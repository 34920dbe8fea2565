"""A subplot of plain actors as one binary glTF file, as browsers and other programs read it."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.core.files import with_suffix
from pvibr.export.scene import SKY, names_of
from pvibr.export.surfaces import albedo_of, surface_of_part
from pvibr.formats.glb_writer import GlbWriter
from pvibr.meshes.parts import as_parts

_CLAMP, _LINES = 33071, 1  # GL enums: CLAMP_TO_EDGE, LINES
_NEAREST, _LINEAR = 9728, 9729
_UNLIT = 'KHR_materials_unlit'
#: z up to y up, as glTF has it: a quarter turn about x.
_UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]


def export_glb(path, subplot, make_plain):
    """Write a subplot of the plotter that a function makes, called only if the path is valid."""
    path = with_suffix(path, '.glb')
    plain = make_plain()
    try:
        write_glb(plain.renderers[subplot], path)
    finally:
        plain.close()


def write_glb(renderer, path) -> list[str]:
    """Write the actors of a renderer, its camera and nothing else; return the names left out."""
    surfaces, lines, left_out = _contents(renderer)
    glb = GlbWriter()
    ends = [s.points for s in surfaces] + [np.asarray(m.points, float) for m, _ in lines]
    middle = np.zeros(3)
    if ends:
        low, high = np.min([e.min(0) for e in ends], 0), np.max([e.max(0) for e in ends], 0)
        middle = (low + high) / 2
    meshes = [_surface(glb, s, middle) for s in surfaces]
    meshes += [_line(glb, mesh, prop, middle) for mesh, prop in lines]
    nodes = [glb.add('nodes', {'mesh': number}) for number in meshes]
    nodes.append(_camera(glb, renderer, middle))
    root: dict[str, Any] = {'children': nodes, 'translation': middle.tolist()}
    if np.abs(renderer.GetActiveCamera().GetViewUp()).argmax() == 2:
        x, y, z = middle
        root |= {'rotation': _UPRIGHT, 'translation': [x, z, -y]}
    glb.document['scene'] = glb.add('scenes', {'nodes': [glb.add('nodes', root)]})
    unlit = [m for m in glb.document.get('materials', []) if 'extensions' in m]
    if unlit:
        glb.document['extensionsUsed'] = [_UNLIT]
    glb.write(path)
    return left_out


def _contents(renderer):
    """Return surfaces, lines with their look, and the names of what is neither."""
    surfaces, lines, left_out = [], [], []
    names = names_of(renderer)
    for prop in renderer.GetViewProps():
        name = names.get(address(prop), prop.GetClassName())
        if not prop.GetVisibility() or name == SKY:
            continue
        mesh = _lines_of(prop)
        if mesh is not None:
            lines.append((mesh, prop.GetProperty()))
            continue
        try:
            parts = as_parts(prop) if prop.IsA('vtkActor') else []
        except (TypeError, ValueError):
            parts = []
        opaque = prop.IsA('vtkActor') and prop.GetForceOpaque()
        for part in parts:
            surface = surface_of_part(part, prop)
            if opaque and surface.texture is not None:
                surface.cutout = 0.5
            surfaces.append(surface)
        if not parts and not prop.IsA('vtkActor2D'):
            left_out.append(name)
    return surfaces, lines, left_out


def _lines_of(prop):
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return None
    data = prop.GetMapper().GetInputDataObject(0, 0)
    if data is None or not data.IsA('vtkPolyData') or not data.GetNumberOfLines():
        return None
    return None if data.GetNumberOfPolys() else pv.wrap(data)


def _surface(glb, surface, middle):
    attributes = {'POSITION': glb.accessor(surface.points - middle, limits=True)}
    if surface.normals is not None:
        attributes['NORMAL'] = glb.accessor(surface.normals)
    if surface.colors is not None:
        albedo = albedo_of(surface)
        alpha = [] if (surface.colors[:, 3] == 255).all() else [albedo[:, 3]]
        attributes['COLOR_0'] = glb.accessor(np.column_stack([_linear(albedo[:, :3]), *alpha]))
    if surface.texture is not None and surface.coordinates is not None:
        attributes['TEXCOORD_0'] = glb.accessor(surface.coordinates * [1, -1] + [0, 1])
    primitive = {
        'attributes': attributes,
        'indices': glb.accessor(surface.faces.astype(np.uint32).reshape(-1)),
        'material': glb.add('materials', _material(glb, surface)),
    }
    return glb.add('meshes', {'primitives': [primitive]})


def _material(glb, surface) -> dict:
    prop = surface.material
    plain = surface.colors is None and surface.texture is None
    base = _linear(np.array(prop.GetColor())) if plain else np.ones(3)
    shine = np.sqrt(2 / (prop.GetSpecularPower() + 2)) if prop.GetSpecular() > 0 else 1.0
    rough: dict[str, Any] = {
        'baseColorFactor': [*base.tolist(), prop.GetOpacity()],
        'metallicFactor': 0.0,
        'roughnessFactor': float(shine),
    }
    if surface.texture is not None and surface.coordinates is not None:
        rough['baseColorTexture'] = {'index': _texture(glb, surface)}
    material: dict[str, Any] = {
        'pbrMetallicRoughness': rough,
        'doubleSided': not prop.GetBackfaceCulling(),
    }
    if not prop.GetLighting():
        material['extensions'] = {_UNLIT: {}}
    if surface.cutout is not None:
        material |= {'alphaMode': 'MASK', 'alphaCutoff': float(surface.cutout)}
    elif not surface.opaque or _blends(surface):
        material['alphaMode'] = 'BLEND'
    return material


def _blends(surface) -> bool:
    return surface.texture is not None and bool((surface.texture[..., 3] < 255).any())


def _texture(glb, surface):
    from PIL import Image

    stream = io.BytesIO()
    image = surface.texture
    Image.fromarray(image if _blends(surface) else image[..., :3]).save(stream, 'PNG')
    view = glb.view(stream.getvalue())
    source = glb.add('images', {'bufferView': view, 'mimeType': 'image/png'})
    wrap = {} if surface.repeat else {'wrapS': _CLAMP, 'wrapT': _CLAMP}
    wrap |= {'magFilter': _LINEAR if surface.smooth else _NEAREST}
    return glb.add('textures', {'source': source, 'sampler': glb.add('samplers', wrap)})


def _line(glb, mesh, prop, middle):
    points = np.asarray(mesh.points, float) - middle
    pairs = [np.stack([c[:-1], c[1:]], 1) for c in _cells(mesh.lines)]
    color = _linear(np.array(prop.GetColor())).tolist()
    material = {
        'pbrMetallicRoughness': {'baseColorFactor': [*color, prop.GetOpacity()]},
        'extensions': {_UNLIT: {}},
    }
    if prop.GetOpacity() < 1:
        material['alphaMode'] = 'BLEND'
    primitive = {
        'attributes': {'POSITION': glb.accessor(points, limits=True)},
        'indices': glb.accessor(np.concatenate(pairs).astype(np.uint32).reshape(-1)),
        'material': glb.add('materials', material),
        'mode': _LINES,
    }
    return glb.add('meshes', {'primitives': [primitive]})


def _cells(flat):
    at = 0
    while at < len(flat):
        yield flat[at + 1 : at + 1 + flat[at]]
        at += 1 + flat[at]


def _camera(glb, renderer, middle):
    camera = renderer.GetActiveCamera()
    width, height = renderer.GetSize()
    aspect = width / max(height, 1)
    near, far = camera.GetClippingRange()
    if camera.GetParallelProjection():
        half = camera.GetParallelScale()
        what = {'xmag': half * aspect, 'ymag': half, 'znear': max(near, 0.0), 'zfar': far}
        number = glb.add('cameras', {'type': 'orthographic', 'orthographic': what})
    else:
        angle = float(np.radians(camera.GetViewAngle()))
        what = {'yfov': angle, 'aspectRatio': aspect, 'znear': near, 'zfar': far}
        number = glb.add('cameras', {'type': 'perspective', 'perspective': what})
    view = np.array(camera.GetViewTransformMatrix().GetData()).reshape(4, 4)
    world = np.linalg.inv(view)
    world[:3, 3] -= middle
    return glb.add('nodes', {'camera': number, 'matrix': world.T.ravel().tolist()})


def _linear(colors) -> np.ndarray:
    """Return colours of a display as light (IEC 61966-2-1)."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
