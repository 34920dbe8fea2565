"""A subplot of plain actors as binary glTF, for browsers and other programs."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.core.files import with_suffix
from pvibr.export.scene import SKY, names_of
from pvibr.export.strokes import COLORS
from pvibr.export.surfaces import albedo_of, surface_of_part
from pvibr.formats.glb_writer import CLAMPED, LINEAR, NEAREST, GlbWriter
from pvibr.maths.bounds import bounds_of
from pvibr.maths.tones import to_light
from pvibr.maths.transforms import transform_points
from pvibr.meshes.parts import as_parts

_POINTS, _LINES = 0, 1  # GL enum
#: From z up to y up, which glTF requires: a quarter turn about x.
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
    """Write the actors of a renderer and its camera; return the names of all other props."""
    surfaces, strokes, left_out = _contents(renderer)
    glb = GlbWriter()
    points = [s.points for s in surfaces] + [np.asarray(m.points, float) for m, _ in strokes]
    middle = bounds_of(points).mean(0)
    primitives = [_surface(glb, s, middle) for s in surfaces]
    primitives += [p for mesh, prop in strokes for p in _strokes(glb, mesh, prop, middle)]
    meshes = [glb.add('meshes', {'primitives': [primitive]}) for primitive in primitives]
    nodes = [glb.add('nodes', {'mesh': number}) for number in meshes]
    nodes.append(_camera(glb, renderer, middle))
    x, y, z = middle.tolist()
    root = {'children': nodes, 'translation': [x, y, z]}
    if np.abs(renderer.GetActiveCamera().GetViewUp()).argmax() == 2:
        root |= {'rotation': _UPRIGHT, 'translation': [x, z, -y]}
    glb.scene([glb.add('nodes', root)])
    glb.write(path)
    return left_out


def _contents(renderer):
    """Return surfaces, lines and points with their property, and the names of other props."""
    surfaces, strokes, left_out = [], [], []
    names = names_of(renderer)
    for prop in renderer.GetViewProps():
        name = names.get(address(prop), prop.GetClassName())
        if not prop.GetVisibility() or name == SKY:
            continue
        mesh = _strokes_of(prop)
        if mesh is not None:
            strokes.append((mesh, prop.GetProperty()))
            if not mesh.GetNumberOfPolys() + mesh.GetNumberOfStrips():
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
    return surfaces, strokes, left_out


def _strokes_of(prop):
    """Return a mesh in world units that has lines or vertices, None for others."""
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return None
    data = prop.GetMapper().GetInputDataObject(0, 0)
    if data is None or not data.IsA('vtkPolyData'):
        return None
    if not data.GetNumberOfLines() + data.GetNumberOfVerts():
        return None
    mesh = pv.wrap(data).copy()
    mesh.points = transform_points(np.reshape(prop.GetMatrix().GetData(), (4, 4)), mesh.points)
    return mesh


def _surface(glb, surface, middle):
    attributes = {}
    if surface.colors is not None:
        albedo = albedo_of(surface)
        alpha = [] if (surface.colors[:, 3] == 255).all() else [albedo[:, 3]]
        attributes['COLOR_0'] = np.column_stack([to_light(albedo[:, :3]), *alpha])
    primitive = glb.primitive(
        surface.points - middle,
        surface.faces,
        normals=surface.normals,
        coordinates=None if surface.texture is None else surface.coordinates,
        **attributes,
    )
    return primitive | {'material': _material(glb, surface)}


def _material(glb, surface):
    prop = surface.material
    plain = surface.colors is None and surface.texture is None
    base = to_light(prop.GetColor()) if plain else np.ones(3)
    shine = np.sqrt(2 / (prop.GetSpecularPower() + 2)) if prop.GetSpecular() > 0 else 1.0
    reflection = {
        'baseColorFactor': [*base.tolist(), prop.GetOpacity()],
        'metallicFactor': 0.0,
        'roughnessFactor': float(shine),
    }
    alpha = np.array([255]) if surface.texture is None else surface.texture[..., 3]
    # Viewers do not sort what blends: what is there or not is cut out.
    clear, partly = bool((alpha == 0).any()), bool(((alpha > 0) & (alpha < 255)).any())
    cutoff = surface.cutout
    if cutoff is None and clear and not partly and prop.GetOpacity() >= 1:
        cutoff = 0.5
    if surface.texture is not None and surface.coordinates is not None:
        image = surface.texture if clear or partly else surface.texture[..., :3]
        sampler = ({} if surface.repeat else CLAMPED) | (LINEAR if surface.smooth else NEAREST)
        reflection['baseColorTexture'] = {'index': glb.texture(image, sampler)}
    return glb.material(
        reflection,
        cutoff=cutoff,
        blends=not surface.opaque or clear or partly,
        two_sided=not prop.GetBackfaceCulling(),
        lit=prop.GetLighting(),
    )


def _strokes(glb, mesh, prop, middle) -> list:
    """Return the primitives of lines and vertices."""
    colors = mesh.point_data.get(COLORS)
    plain = to_light(prop.GetColor()) if colors is None else np.ones(3)
    own = {} if colors is None else {'COLOR_0': to_light(np.asarray(colors)[:, :3] / 255)}
    reflection = {'baseColorFactor': [*plain.tolist(), prop.GetOpacity()]}
    material = glb.material(reflection, blends=prop.GetOpacity() < 1, lit=False)
    points = np.asarray(mesh.points, float) - middle
    pairs = [np.stack([c[:-1], c[1:]], 1) for c in _cells(mesh.lines)]
    found = {_LINES: pairs, _POINTS: list(_cells(mesh.verts))}
    return [
        glb.primitive(points, np.concatenate(ids), **own) | {'material': material, 'mode': mode}
        for mode, ids in found.items()
        if ids
    ]


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
