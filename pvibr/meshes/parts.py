"""What is drawn at each pose: meshes of any kind as parts with the looks of ``add_mesh``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.signatures import takes
from pvibr.maths.transforms import transform_normals, transform_points
from pvibr.meshes.trimesh_meshes import as_dataset, is_trimesh, read_mesh, scene_instances
from pvibr.meshes.turntable import Turns

#: Names under which arrays given by value travel through the surface filters.
SCALARS, OPACITY = 'pvibr_scalars', 'pvibr_opacity'

#: What add_mesh would make of a mesh beside its own actor; an instance has only the mesh.
EXTRAS = ('silhouette', 'show_vertices', 'multi_colors')

#: Where VTK keeps the textures of physically based shading; it has no call that lists them.
PROPERTY_TEXTURES = (
    'albedoTex',
    'materialTex',
    'normalTex',
    'emissiveTex',
    'anisotropyTex',
    'coatNormalTex',
)

#: What the plotter that shows the parts decides, not the hidden one that makes them.
FIXED = {
    'name': None,
    'reset_camera': False,
    'render': False,
    'show_scalar_bar': False,
    'remove_existing_actor': False,
}


@dataclass
class Part:
    """One surface with one look."""

    actor: pv.Actor
    mesh: pv.PolyData
    alpha_cutoff: float | None = None
    stand_ins: tuple = ()
    turns: Turns | None = None

    def polydata_mapper(self):
        """Return a new ``vtkPolyDataMapper`` with the look of the actor's own mapper."""
        mapper = _vtk.vtkPolyDataMapper()
        mapper.ShallowCopy(self.actor.mapper)
        mapper.SetInputDataObject(self.mesh)
        return mapper


def dressed(part, mapper):
    """Return a new actor with the look of a part."""
    actor, source = pv.Actor(), part.actor
    actor.SetMapper(mapper)
    actor.SetProperty(source.GetProperty())
    actor.SetBackfaceProperty(source.GetBackfaceProperty())
    actor.SetTexture(source.GetTexture())
    actor.SetForceOpaque(source.GetForceOpaque())
    actor.SetForceTranslucent(source.GetForceTranslucent())
    actor.GetShaderProperty().DeepCopy(source.GetShaderProperty())
    return actor


@takes(add_mesh_kwargs=pv.Plotter.add_mesh, without=(*EXTRAS, *FIXED, 'scalar_bar_args'))
def as_parts(mesh, *, theme=None, alpha_cutoff=None, **add_mesh_kwargs):
    """Return the parts that ``add_mesh`` would draw."""
    if alpha_cutoff is not None and not 0 <= alpha_cutoff <= 1:
        msg = f'alpha_cutoff is {alpha_cutoff!r}; it must be within 0 and 1, or None to blend.'
        raise ValueError(msg)
    if isinstance(mesh, Part):
        return [mesh]
    found: Any = mesh if isinstance(mesh, list | tuple) else getattr(mesh, 'parts', None)
    if are_parts(found):
        return list(found)
    for name in EXTRAS:
        if add_mesh_kwargs.pop(name, None):
            msg = f'{name} is not drawn for instances; add it as an actor of its own.'
            raise ValueError(msg)
    if add_mesh_kwargs.get('style') == 'points_gaussian':
        msg = "style is 'points_gaussian', which draws points, not triangles; use add_billboards."
        raise ValueError(msg)
    looks = add_mesh_kwargs | FIXED
    if alpha_cutoff is not None:
        looks['alpha_cutoff'] = alpha_cutoff
    with _Maker(theme) as maker:
        return _parts_of(mesh, looks, maker)


def as_meshes(meshes, **kwargs):
    """Return the parts of one mesh or of several."""
    if not isinstance(meshes, list | tuple) or are_parts(meshes):
        return [as_parts(meshes, **kwargs)]
    if not meshes:
        msg = 'meshes is empty; give at least one mesh.'
        raise ValueError(msg)
    return [_numbered(place, mesh, kwargs) for place, mesh in enumerate(meshes)]


def _numbered(place, mesh, kwargs):
    try:
        return as_parts(mesh, **kwargs)
    except ValueError as error:
        msg = f'meshes[{place}]: {error}'
        raise ValueError(msg) from error


def are_parts(mesh) -> bool:
    """Return whether something is a list of parts: one mesh."""
    is_list = isinstance(mesh, list | tuple)
    return is_list and bool(mesh) and all(isinstance(part, Part) for part in mesh)


class _Maker(pv.BasePlotter):
    """A plotter without a window: its add_mesh gives looks, and no GL is touched."""

    def __init__(self, theme):
        super().__init__(theme=theme, lighting='none')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def make(self, dataset, look):
        """Return the part of one triangulated dataset."""
        look = dict(look)
        cutoff = look.pop('alpha_cutoff', None)
        textures = look.pop('pbr_textures', None) or {}
        shining = look.pop('emissive_factor', None)
        actor = self.add_mesh(dataset, **look)
        if dataset.active_texture_coordinates is not None:
            for name, texture in textures.items():
                actor.prop.SetTexture(name, texture)
        if shining is not None:
            actor.prop.SetEmissiveFactor(shining)
        return _finished(actor, cutoff)


def _parts_of(mesh, look, maker):
    if isinstance(mesh, str | Path):
        mesh = read_mesh(mesh)
    if is_trimesh(mesh, 'Scene'):
        return _from_scene(mesh, look, maker)
    if is_trimesh(mesh, 'Trimesh'):
        dataset, own = as_dataset(mesh, pbr=look.get('pbr'))
        return [_from_dataset(dataset, _merged(own, look), maker)]
    if isinstance(mesh, _vtk.vtkActor):
        return _from_actor(mesh, look)
    if isinstance(mesh, _vtk.vtkDataObject):
        mesh = pv.wrap(mesh)
    if isinstance(mesh, pv.MultiBlock):
        return _from_blocks(mesh, look, maker)
    if isinstance(mesh, pv.DataSet):
        return [_from_dataset(mesh, look, maker)]
    msg = (
        'mesh must be a PyVista dataset, an actor, a trimesh mesh or scene or a path, '
        f'not {type(mesh).__name__}.'
    )
    raise TypeError(msg)


def _from_dataset(dataset, look, maker):
    _check_points(dataset)
    dataset, look = _with_arrays(dataset, look)
    return maker.make(_triangles(dataset), look)


def _check_points(dataset):
    if not dataset.n_points:
        msg = 'mesh is empty: it has no points.'
        raise ValueError(msg)
    bad = np.flatnonzero(~np.isfinite(dataset.points).all(axis=1))
    if bad.size:
        msg = (
            f'mesh.points[{bad[0]}] is {dataset.points[bad[0]].tolist()}; it must be finite '
            f'({bad.size} such points). Remove them or set them.'
        )
        raise ValueError(msg)


def _with_arrays(dataset, look):
    """Put arrays given by value on a shallow copy, so that they follow points and cells."""
    dataset, look = dataset.copy(deep=False), dict(look)
    for keyword, name in (('scalars', SCALARS), ('opacity', OPACITY)):
        values = look.get(keyword)
        if values is None or isinstance(values, str) or np.ndim(values) == 0:
            continue
        values = np.asarray(values)
        on_points = len(values) == dataset.n_points
        # Another length: a transfer function of opacity, or a mistake that add_mesh names.
        if not on_points and len(values) != dataset.n_cells:
            continue
        (dataset.point_data if on_points else dataset.cell_data)[name] = values
        look[keyword] = name
        look.setdefault('preference', 'point' if on_points else 'cell')
    return dataset, look


def _triangles(dataset):
    """Return the triangles of a dataset's surface, with its active arrays still active."""
    active = dataset.active_scalars_info
    if isinstance(dataset, pv.PointSet):
        dataset = dataset.cast_to_polydata(deep=False)
    if not isinstance(dataset, pv.PolyData):
        # The filter that add_mesh's mapper has inside.
        dataset = dataset.extract_surface(
            algorithm='dataset_surface', pass_pointid=False, pass_cellid=False
        )
    surface = dataset if _is_triangulated(dataset) else dataset.triangulate()
    if not surface.n_cells:
        msg = (
            'mesh has no triangles (only points or lines). '
            'Make a surface of it first, with .tube() or .glyph().'
        )
        raise ValueError(msg)
    if active.name is not None and active.association.name in ('POINT', 'CELL'):
        surface.set_active_scalars(active.name, preference=active.association.name.lower())
    return surface


def _is_triangulated(surface):
    return not (surface.n_verts or surface.n_lines or surface.n_strips) and (
        surface.is_all_triangles
    )


def _from_blocks(blocks, look, maker):
    found = [
        block
        for block in blocks.recursive_iterator(skip_none=True, skip_empty=True)
        if isinstance(block, pv.DataSet)
    ]
    if not found:
        msg = 'mesh is empty: no block has points.'
        raise ValueError(msg)
    looks = [_for_block(block, look) for block in found]
    if look.get('clim') is None and not look.get('rgb'):
        _share_range(found, looks)
    return [_from_dataset(block, own, maker) for block, own in zip(found, looks, strict=True)]


def _for_block(block, look):
    """Return the look without what this block cannot follow."""
    look = dict(look)
    scalars = look.get('scalars')
    if isinstance(scalars, str) and scalars not in block.array_names:
        del look['scalars']
        look.pop('rgb', None)
    elif scalars is None and block.active_scalars_name is None:
        look.pop('rgb', None)
    if block.active_texture_coordinates is None:
        look.pop('texture', None)
    return look


def _share_range(blocks, looks):
    """Give blocks that show the same array one range of colours, as add_mesh does."""
    ranges: dict = {}
    for block, look in zip(blocks, looks, strict=True):
        name = look.get('scalars') or block.active_scalars_name
        values = block[name] if isinstance(name, str) else None
        if values is None or values.ndim != 1 or values.dtype.kind not in 'iufb':
            continue
        values = values[np.isfinite(values)]
        if values.size:
            low, high = ranges.setdefault(name, (values.min(), values.max()))
            ranges[name] = (min(low, values.min()), max(high, values.max()))
    for block, look in zip(blocks, looks, strict=True):
        name = look.get('scalars') or block.active_scalars_name
        if isinstance(name, str) and name in ranges:
            look['clim'] = [float(limit) for limit in ranges[name]]


def _from_scene(scene, look, maker):
    meshes, index, matrices = scene_instances(scene)
    textures: dict = {}
    alike: dict = {}
    known = [as_dataset(mesh, look.get('pbr'), textures) for mesh in meshes]
    for which, matrix in zip(index, matrices, strict=True):
        dataset, own = known[which]
        # Every part costs a draw: what looks alike is drawn as one.
        key = tuple(map(_comparable, own.items())) + tuple(dataset.array_names)
        alike.setdefault(key, (own, []))[1].append(_moved(dataset, matrix))
    return [
        _from_dataset(_joined(pieces), _merged(own, look), maker) for own, pieces in alike.values()
    ]


def _comparable(item):
    name, value = item
    return name, id(value) if isinstance(value, _vtk.vtkObject) else value


def _joined(pieces):
    return pieces[0] if len(pieces) == 1 else pieces[0].append_polydata(*pieces[1:])


def _merged(own, look):
    """Let what the user says win over the material: a colour also over texture and colours."""
    if any(look.get(name) is not None for name in ('color', 'scalars', 'texture')):
        own = {
            key: own[key] for key in own if key not in ('color', 'scalars', 'rgb', 'preference')
        }
        if look.get('texture') is None:
            own.pop('texture', None)
            own.pop('alpha_cutoff', None)
    return own | {name: value for name, value in look.items() if value is not None}


def _from_actor(actor, look):
    given = [key for key in look if key not in FIXED and look[key] is not None]
    if set(given) - {'alpha_cutoff'}:
        msg = f'mesh is an actor, which has its own look: set {given} on it, or give its mesh.'
        raise ValueError(msg)
    mapper = actor.GetMapper()
    if mapper is None or mapper.GetInputDataObject(0, 0) is None:
        msg = 'mesh is an actor that shows nothing: its mapper has no input.'
        raise ValueError(msg)
    mapper.Update()
    shown = pv.wrap(mapper.GetInputDataObject(0, 0))
    if isinstance(shown, pv.MultiBlock):
        return _from_composite(actor, mapper, shown)
    return [_copied(actor, mapper, shown, look.get('alpha_cutoff'))]


def _from_composite(actor, mapper, blocks):
    attributes = mapper.GetCompositeDataDisplayAttributes()
    parts = []
    for block in blocks.recursive_iterator(skip_none=True, skip_empty=True):
        if attributes.GetBlockVisibility(block) or not attributes.HasBlockVisibility(block):
            part = _copied(actor, mapper, block)
            _dress(part, attributes, block)
            parts.append(part)
    if not parts:
        msg = 'mesh is an actor that shows nothing: no block of it is visible and has points.'
        raise ValueError(msg)
    return parts


def _dress(part, attributes, block):
    """Give a part the colour and opacity that a composite mapper has for its block."""
    if attributes.HasBlockColor(block):
        color = [0.0, 0.0, 0.0]
        attributes.GetBlockColor(block, color)
        part.actor.prop.color = color
        part.actor.mapper.scalar_visibility = False
    if attributes.HasBlockOpacity(block):
        part.actor.prop.opacity = attributes.GetBlockOpacity(block)


def _copied(actor, mapper, shown, cutoff=None):
    _check_points(shown)
    copy = pv.Actor()
    copy.mapper = _copied_mapper(mapper)
    copy.mapper.dataset = _triangles(shown.copy(deep=False))
    copy.SetProperty(_copied_property(actor.GetProperty()))
    if actor.GetBackfaceProperty() is not None:
        copy.SetBackfaceProperty(_copied_property(actor.GetBackfaceProperty()))
    copy.SetTexture(actor.GetTexture())
    copy.SetForceOpaque(actor.GetForceOpaque())
    copy.SetForceTranslucent(actor.GetForceTranslucent())
    copy.GetShaderProperty().DeepCopy(actor.GetShaderProperty())
    copy.user_matrix = pv.array_from_vtkmatrix(actor.GetMatrix())
    return _finished(copy, cutoff)


def _copied_mapper(mapper):
    copy = pv.DataSetMapper()
    copy.ShallowCopy(mapper)
    copy.SetStatic(False)
    # A table of its own: recolouring the user's actor must not recolour the instances.
    table = mapper.GetLookupTable()
    if table is not None:
        own = table.NewInstance()
        own.DeepCopy(table)
        copy.SetLookupTable(own)
    return copy


def _copied_property(prop):
    copy = pv.Property()
    copy_property(copy, prop)
    return copy


def copy_property(copy, prop):
    """Make a property a copy of another one, textures shared."""
    copy.DeepCopy(prop)
    for name in PROPERTY_TEXTURES:
        texture = copy.GetTexture(name)
        if texture is not None:
            texture.Register(copy)  # which VTK 9.7 forgets, and gives back when the copy goes


def _finished(actor, cutoff):
    """Return the part of an actor: matrix applied, other arrays dropped, cut-outs cut."""
    actor.mapper.Update()
    mesh = pv.wrap(actor.mapper.GetInputDataObject(0, 0)).copy(deep=False)
    mesh = _moved(mesh, pv.array_from_vtkmatrix(actor.GetMatrix()))
    actor.user_matrix = np.eye(4)
    _drop_unseen(mesh, actor.mapper)
    # No filter is left between mesh and mapper: smooth shading is done.
    actor.mapper.dataset = mesh
    if cutoff is not None:
        _cut_out(actor, cutoff)
    return Part(actor, mesh, cutoff)


def _moved(mesh, matrix):
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    moved = mesh.copy(deep=False)
    # A shallow copy shares its vtkPoints; its points setter would move the original too.
    moved.SetPoints(pv.vtk_points(transform_points(matrix, mesh.points)))
    for old, new in ((mesh.point_data, moved.point_data), (mesh.cell_data, moved.cell_data)):
        if old.active_normals is not None:
            new.active_normals = transform_normals(matrix, old.active_normals)
    if np.linalg.det(matrix[:3, :3]) < 0:
        # A mirror turns triangles inside out; turn them back.
        faces = moved.regular_faces if _is_triangulated(moved) else None
        moved = moved.flip_faces() if faces is None else _with_faces(moved, faces[:, ::-1])
    return moved


def _with_faces(mesh, faces):
    mesh.regular_faces = np.ascontiguousarray(faces)
    return mesh


def _drop_unseen(mesh, mapper):
    if mapper.GetArrayAccessMode() == 0 and mapper.GetScalarMode() in (3, 4):
        return  # The array shown has a number, which dropping others would change.
    shown = {mapper.GetArrayName()} if mapper.GetScalarVisibility() else set()
    for mode, data in ((1, mesh.point_data), (2, mesh.cell_data)):
        keep = shown | {data.active_normals_name, data.active_texture_coordinates_name}
        if mapper.GetScalarVisibility() and mapper.GetScalarMode() in (0, mode):
            keep.add(data.active_scalars_name)
        tangents = data.VTKObject.GetTangents()
        keep.add(tangents.GetName() if tangents is not None else None)
        for name in set(data.keys()) - keep:
            del data[name]
    mesh.clear_field_data()


def _cut_out(actor, cutoff):
    opacity = actor.prop.opacity
    if opacity == 1:
        actor.ForceOpaqueOn()
    # After the texture is multiplied in; the fragment's alpha has the opacity in it. What stays
    # is solid: VTK blends in its opaque pass too, and a soft edge would show what lies behind.
    text = f"""//VTK::TCoord::Impl
  if (gl_FragData[0].a < {cutoff * opacity:.6f}) discard;
  gl_FragData[0].a = {opacity:.6f};
"""
    actor.GetShaderProperty().AddFragmentShaderReplacement(
        '//VTK::TCoord::Impl', True, text, False
    )
