"""A subplot of plain actors as binary glTF."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.core.errors import warn
from pvibr.core.files import with_suffix
from pvibr.core.plotters import names_of
from pvibr.export.drawn_surfaces import albedo_of, surface_of_part
from pvibr.export.scene import SKY
from pvibr.export.strokes import COLORS
from pvibr.io.glb_writer import CLAMPED, LINEAR, NEAREST, GlbWriter
from pvibr.maths.cameras import aspect_of, vertical_angle
from pvibr.maths.tones import to_light
from pvibr.maths.transforms import transform_points
from pvibr.meshes.parts import as_parts

_POINTS, _LINES = 0, 1  # GL enum
_TOLERANCE = 0.01  # pixels that a view may be off without a warning
#: From z up to glTF's y up: a quarter turn about x.
_UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]


def export_glb(path, subplot_number, make_plain):
    """Write a subplot of the plotter that a function makes once the path is valid."""
    path = with_suffix(path, '.glb')
    plain_plotter = make_plain()
    try:
        write_glb(plain_plotter.renderers[subplot_number], path)
    finally:
        plain_plotter.close()


def write_glb(renderer, path) -> list[str]:
    """Write a renderer's actors and camera; return the names of other props."""
    surfaces, strokes, left_out = _contents(renderer)
    glb = GlbWriter()
    points = [s.points for s in surfaces] + [np.asarray(m.points, float) for m, _ in strokes]
    scene_center = bounds_of(points).mean(0)
    primitives = [_surface(glb, s, scene_center) for s in surfaces]
    primitives += [p for mesh, prop in strokes for p in _strokes(glb, mesh, prop, scene_center)]
    mesh_numbers = [glb.add('meshes', {'primitives': [primitive]}) for primitive in primitives]
    node_numbers = [glb.add('nodes', {'mesh': number}) for number in mesh_numbers]
    node_numbers.append(_camera(glb, renderer, scene_center))
    x, y, z = scene_center.tolist()
    root_node = {'children': node_numbers, 'translation': [x, y, z]}
    if np.abs(renderer.GetActiveCamera().GetViewUp()).argmax() == 2:
        root_node |= {'rotation': _UPRIGHT, 'translation': [x, z, -y]}
    glb.scene([glb.add('nodes', root_node)])
    glb.write(path)
    return left_out


def _contents(renderer):
    """Return surfaces, meshes of strokes with their property, and the names of other props."""
    surfaces, strokes, left_out = [], [], []
    prop_names = names_of(renderer)
    for prop in renderer.GetViewProps():
        name = prop_names.get(address(prop), prop.GetClassName())
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
        is_opaque = prop.IsA('vtkActor') and prop.GetForceOpaque()
        for part in parts:
            surface = surface_of_part(part, prop)
            if is_opaque and surface.texture is not None:
                surface.cutout = 0.5
            surfaces.append(surface)
        if not parts and not prop.IsA('vtkActor2D'):
            left_out.append(name)
    return surfaces, strokes, left_out


def _strokes_of(prop):
    """Return a prop's mesh in world space if it has lines or vertices, otherwise None."""
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return None
    mesh_data = prop.GetMapper().GetInputDataObject(0, 0)
    if mesh_data is None or not mesh_data.IsA('vtkPolyData'):
        return None
    if not mesh_data.GetNumberOfLines() + mesh_data.GetNumberOfVerts():
        return None
    mesh = pv.wrap(mesh_data).copy()
    mesh.points = transform_points(np.reshape(prop.GetMatrix().GetData(), (4, 4)), mesh.points)
    return mesh


def _surface(glb, surface, scene_center):
    attributes = {}
    if surface.colors is not None:
        albedo = albedo_of(surface)
        alpha_columns = [] if (surface.colors[:, 3] == 255).all() else [albedo[:, 3]]
        attributes['COLOR_0'] = np.column_stack([to_light(albedo[:, :3]), *alpha_columns])
    primitive = glb.primitive(
        surface.points - scene_center,
        surface.faces,
        normals=surface.normals,
        coordinates=None if surface.texture is None else surface.coordinates,
        **attributes,
    )
    return primitive | {'material': _material(glb, surface)}


def _material(glb, surface):
    prop = surface.material
    is_plain = surface.colors is None and surface.texture is None
    base_color = to_light(prop.GetColor()) if is_plain else np.ones(3)
    roughness = np.sqrt(2 / (prop.GetSpecularPower() + 2)) if prop.GetSpecular() > 0 else 1.0
    pbr_factors = {
        'baseColorFactor': [*base_color.tolist(), prop.GetOpacity()],
        'metallicFactor': 0.0,
        'roughnessFactor': float(roughness),
    }
    alpha = np.array([255]) if surface.texture is None else surface.texture[..., 3]
    # Viewers do not sort blended surfaces: cut out images that are either opaque or clear.
    has_clear, has_partial = bool((alpha == 0).any()), bool(((alpha > 0) & (alpha < 255)).any())
    alpha_cutoff = surface.cutout
    if alpha_cutoff is None and has_clear and not has_partial and prop.GetOpacity() >= 1:
        alpha_cutoff = 0.5
    if surface.texture is not None and surface.coordinates is not None:
        image = surface.texture if has_clear or has_partial else surface.texture[..., :3]
        sampler = ({} if surface.repeat else CLAMPED) | (LINEAR if surface.smooth else NEAREST)
        pbr_factors['baseColorTexture'] = {'index': glb.texture(image, sampler)}
    return glb.material(
        pbr_factors,
        cutoff=alpha_cutoff,
        blends=not surface.opaque or has_clear or has_partial,
        two_sided=not prop.GetBackfaceCulling(),
        lit=prop.GetLighting(),
    )


def _strokes(glb, mesh, prop, scene_center) -> list:
    """Return the primitives of lines and vertices."""
    colors = mesh.point_data.get(COLORS)
    base_color = to_light(prop.GetColor()) if colors is None else np.ones(3)
    attributes = {} if colors is None else {'COLOR_0': to_light(np.asarray(colors)[:, :3] / 255)}
    pbr_factors = {'baseColorFactor': [*base_color.tolist(), prop.GetOpacity()]}
    material = glb.material(pbr_factors, blends=prop.GetOpacity() < 1, lit=False)
    points = np.asarray(mesh.points, float) - scene_center
    line_pairs = [np.stack([c[:-1], c[1:]], 1) for c in _cells(mesh.lines)]
    ids_by_mode = {_LINES: line_pairs, _POINTS: list(_cells(mesh.verts))}
    return [
        glb.primitive(points, np.concatenate(ids), **attributes)
        | {'material': material, 'mode': mode}
        for mode, ids in ids_by_mode.items()
        if ids
    ]


def _cells(cell_array):
    offset = 0
    while offset < len(cell_array):
        yield cell_array[offset + 1 : offset + 1 + cell_array[offset]]
        offset += 1 + cell_array[offset]


def _camera(glb, renderer, scene_center):
    camera = renderer.GetActiveCamera()
    width, height = renderer.GetSize()
    aspect = aspect_of(camera, (width, max(height, 1)))
    off_center = np.abs(camera.GetWindowCenter()) * (width, height) / 2
    if off_center.max() > _TOLERANCE:
        warn(
            f'the view in the file is off by {off_center[0]:.3g} and {off_center[1]:.3g} px, as '
            'glTF has no off-centre cameras: the window centre of the camera is left out'
        )
    near, far = camera.GetClippingRange()
    if camera.GetParallelProjection():
        kind, half_height, near = 'orthographic', camera.GetParallelScale(), max(near, 0.0)
        projection = {'xmag': half_height * aspect, 'ymag': half_height}
    else:
        kind, view_angle = 'perspective', float(np.radians(vertical_angle(camera, aspect)))
        projection = {'yfov': view_angle, 'aspectRatio': aspect}
    projection |= {'znear': near, 'zfar': far}
    camera_number = glb.add('cameras', {'type': kind, kind: projection})
    matrix = np.linalg.inv(np.array(camera.GetViewTransformMatrix().GetData()).reshape(4, 4))
    matrix[:3, 3] -= scene_center
    return glb.add('nodes', {'camera': camera_number, 'matrix': matrix.T.ravel().tolist()})


def bounds_of(sets):
    """Return the corners of the smallest box around sets of points, (2, 3); zeros if empty."""
    points = np.concatenate([np.zeros((0, 3)), *sets])
    return np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 3))
