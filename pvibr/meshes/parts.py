"""Parts: meshes of any kind as triangles, with the looks of ``add_mesh``."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import checked_number, naming
from pvibr.core.signatures import takes
from pvibr.io.trimesh_meshes import as_dataset, is_trimesh
from pvibr.meshes.composites import set_block_look, visible_blocks
from pvibr.meshes.materials import (
    checked_data,
    culled_faces,
    follow_scalars,
    lighting_of,
    look_key,
    merged_look,
)
from pvibr.meshes.mesh_files import has_graph, read_mesh, scene_instances
from pvibr.meshes.surfaces import (
    check_points,
    clipped,
    drop_unseen,
    moved,
    surface_of,
    triangles_of,
)
from pvibr.meshes.texture_maps import attach_maps
from pvibr.meshes.turntable import Turns
from pvibr.textures.material_textures import copied_property, set_textures

#: Names under which arrays passed by value go through surface filters.
SCALARS, OPACITY = 'pvibr_scalars', 'pvibr_opacity'

_SURFACE = 2  # VTK_SURFACE

#: Arguments of add_mesh that add more actors, which instances do not support.
EXTRAS = ('silhouette', 'show_vertices', 'multi_colors')
#: Arguments of add_mesh that have no effect on parts.
USELESS = ('point_shape', 'emissive', 'static', 'copy_mesh', 'label', 'scalar_bar_args')

#: Arguments of add_mesh that are fixed for the hidden plotter that makes parts.
FIXED = {
    'name': None,
    'reset_camera': False,
    'render': False,
    'show_scalar_bar': False,
    'remove_existing_actor': False,
}


@dataclass
class Part:
    """A triangle mesh with one look.

    The actor draws this mesh, or the polygons, lines and vertices that it was triangulated from.
    """

    actor: pv.Actor
    mesh: pv.PolyData
    alpha_cutoff: float | None = None
    #: Lighter levels supplied by the user, heaviest first, a sequence of parts each.
    supplied_levels: tuple = ()
    turns: Turns | None = None
    #: Whether it was made from an actor, which may have a scalar bar.
    of_actor: bool = False
    #: Name of the array that colours it, and whether its values are words.
    scalars: tuple[str, bool] = ('', False)

    @property
    def ineligibility(self) -> str:
        """Why images cannot show it, empty if they can."""
        prop, back_prop = self.actor.GetProperty(), self.actor.GetBackfaceProperty()
        dataset = self.actor.GetMapper().GetInput()
        if prop.GetRepresentation() != _SURFACE:
            return f"its style is '{prop.GetRepresentationAsString().lower()}'"
        if prop.GetEdgeVisibility():
            return 'its edges are shown'
        if dataset is not None and dataset.GetNumberOfVerts() + dataset.GetNumberOfLines():
            return 'it has vertices or lines'
        if back_prop is not None and lighting_of(back_prop) != lighting_of(prop):
            return 'its back faces have another material'
        return ''

    @cached_property
    def strokes(self):
        """End points of line segments, and vertices twice, shape (n, 2, 3)."""
        dataset = pv.wrap(self.actor.GetMapper().GetInput())
        lines, cells = dataset.GetLines(), (dataset.GetLines(), dataset.GetVerts())
        ids, vertices = (_vtk.vtk_to_numpy(c.GetConnectivityArray()) for c in cells)
        is_start = np.ones(len(ids), bool)
        is_start[_vtk.vtk_to_numpy(lines.GetOffsetsArray())[1:] - 1] = False
        segments = np.stack([ids, np.roll(ids, -1)], 1)[is_start]
        ends = np.concatenate([segments, np.stack([vertices] * 2, 1)])
        return np.asarray(dataset.points, float)[ends]

    @cached_property
    def locator(self):
        """Locator of the cells of the mesh."""
        locator = _vtk.vtkStaticCellLocator()
        locator.SetDataSet(self.mesh)
        locator.BuildLocator()
        return locator

    def drawn_points(self):
        """Return the points that its cells use."""
        if self.actor.GetMapper().GetInput() is not self.mesh:
            return self.mesh.points  # lines and vertices have points, too
        is_used = np.bincount(self.mesh.regular_faces.ravel(), minlength=self.mesh.n_points)
        return self.mesh.points[is_used > 0]

    def polydata_mapper(self):
        """Return a new ``vtkPolyDataMapper`` with the look of the actor's mapper."""
        mapper = _vtk.vtkPolyDataMapper()
        mapper.ShallowCopy(self.actor.mapper)
        mapper.SetInputDataObject(self.mesh)
        return mapper

    def new_actor(self, mapper):
        """Return a new actor with this look."""
        actor = pv.Actor()
        actor.SetMapper(mapper)
        actor.SetProperty(self.actor.GetProperty())
        actor.SetBackfaceProperty(self.actor.GetBackfaceProperty())
        copy_look(actor, self.actor)
        return actor

    def with_mesh(self, mesh, interpolation=None) -> Part:
        """Return a part with this look and another mesh, optionally with VTK's shading mode."""
        mapper = self.polydata_mapper()
        follow_scalars(mapper, mesh)
        mapper.SetInputDataObject(mesh)
        part = Part(self.new_actor(mapper), mesh, self.alpha_cutoff)
        if interpolation not in (None, self.actor.GetProperty().GetInterpolation()):
            part = _with_own_property(part)
            part.actor.GetProperty().SetInterpolation(interpolation)
        return part


@takes(add_mesh_kwargs=(pv.Plotter.add_mesh, 'feature_angle'), without=(*EXTRAS, *USELESS, *FIXED))
def as_parts(mesh, *, theme=None, alpha_cutoff=None, **add_mesh_kwargs):
    """Return the parts that ``add_mesh`` would draw."""
    if alpha_cutoff is not None:
        checked_number('alpha_cutoff', alpha_cutoff, 0, 1)
    if isinstance(mesh, Part):
        return [mesh]
    parts = getattr(mesh, 'parts', mesh)
    if are_parts(parts):
        return list(parts)
    _check_keywords(add_mesh_kwargs)
    if isinstance(mesh, list | tuple) and mesh and all(isinstance(m, pv.Actor) for m in mesh):
        return [part for actor in mesh for part in as_parts(actor, **add_mesh_kwargs)]
    look = add_mesh_kwargs | FIXED
    if alpha_cutoff is not None:
        look['alpha_cutoff'] = alpha_cutoff
    with closing(_Maker(theme)) as maker:
        return _parts_of(mesh, look, maker)


def _check_keywords(add_mesh_kwargs):
    for name in EXTRAS:
        if add_mesh_kwargs.pop(name, None):
            raise ValueError(f'{name} must be left out for instances; add it as a separate actor')
    if add_mesh_kwargs.get('style') == 'points_gaussian':
        raise ValueError("style must draw triangles, got 'points_gaussian'; use add_billboards")
    for name in (*USELESS, *FIXED):
        if add_mesh_kwargs.get(name):
            raise ValueError(f'{name} must be left out: an actor for the mesh is not added')


def as_meshes(meshes, **kwargs):
    """Return the parts of one or several meshes."""
    if not isinstance(meshes, list | tuple) or are_parts(meshes):
        return [as_parts(meshes, **kwargs)]
    if not meshes:
        raise ValueError('meshes must hold at least one mesh, got none')
    parts = []
    for i, mesh in enumerate(meshes):
        try:
            parts.append(as_parts(mesh, **kwargs))
        except ValueError as error:
            raise ValueError(f'meshes[{i}]: {error}') from error
    return parts


def check_triangles(parts):
    """Raise if no part has triangles."""
    if not any(part.mesh.n_cells for part in parts):
        raise ValueError('mesh must have triangles, got only points or lines; use tube or glyph')


def with_own_culling(parts):
    """Return parts with copied properties if they cull, so that culling can be switched."""
    return [_with_own_property(p) if any(culled_faces(p.actor.prop)) else p for p in parts]


def _with_own_property(part):
    actor = part.new_actor(part.actor.GetMapper())
    actor.SetProperty(copied_property(actor.GetProperty()))
    return replace(part, actor=actor)


def are_parts(mesh) -> bool:
    """Return True for a list of parts, which form one mesh."""
    is_list = isinstance(mesh, list | tuple)
    return is_list and bool(mesh) and all(isinstance(part, Part) for part in mesh)


class _Maker(pv.BasePlotter):
    """A plotter without a window, whose add_mesh makes actors without OpenGL."""

    def __init__(self, theme):
        with naming('theme', theme):
            super().__init__(theme=theme, lighting='none')

    def make(self, dataset, look):
        """Return the part of one triangulated dataset."""
        look = dict(look)
        cutoff = look.pop('alpha_cutoff', None)
        textures = look.pop('pbr_textures', None) or {}
        emissive_factor = look.pop('emissive_factor', None)
        actor = self.add_mesh(dataset, **look)
        if dataset.active_texture_coordinates is not None:
            set_textures(actor.prop, textures)
        if emissive_factor is not None:
            actor.prop.SetEmissiveFactor(emissive_factor)
        attach_maps(actor, emissive_factor)
        return replace(_finished(actor, cutoff), scalars=_scalars_of(dataset, look))


def _scalars_of(dataset, look) -> tuple[str, bool]:
    name = look.get('scalars')
    name = name if isinstance(name, str) else dataset.active_scalars_name or ''
    return name, name in dataset.array_names and dataset[name].dtype.kind in 'bUS'


def _parts_of(mesh, look, maker):
    if isinstance(mesh, str | Path) and not has_graph(mesh):
        mesh = read_mesh(mesh)
    if has_graph(mesh):
        return _from_scene(mesh, look, maker)
    if is_trimesh(mesh, 'Trimesh') or hasattr(mesh, 'surfaces'):
        return [_from_surface(d, s, look, maker) for d, s in _surfaces(mesh, look)]
    if isinstance(mesh, _vtk.vtkActor):
        return _from_actor(mesh, look)
    if isinstance(mesh, _vtk.vtkDataObject):
        mesh = pv.wrap(mesh)
    if isinstance(mesh, pv.MultiBlock):
        return _from_blocks(mesh, look, maker)
    if isinstance(mesh, pv.DataSet):
        return [_from_dataset(mesh, look, maker)]
    raise TypeError(
        'mesh must be a PyVista dataset, an actor, a trimesh mesh or scene, or a path, got '
        f'{type(mesh).__name__}'
    )


def _from_dataset(dataset, look, maker):
    check_points(dataset)
    dataset, look = _with_arrays(dataset, look)
    return maker.make(surface_of(dataset), look)


def _with_arrays(dataset, look):
    """Store arrays passed by value on a shallow copy, so that filters pass them on."""
    dataset, look = dataset.copy(deep=False), dict(look)
    for keyword, name in (('scalars', SCALARS), ('opacity', OPACITY)):
        values = checked_data(dataset, keyword, look.get(keyword))
        if np.ndim(values) == 0:
            continue
        values = np.asarray(values)
        on_points = len(values) == dataset.n_points
        # Another length: an opacity transfer function, or an error that add_mesh reports.
        if not on_points and len(values) != dataset.n_cells:
            continue
        (dataset.point_data if on_points else dataset.cell_data)[name] = values
        look[keyword] = name
        look.setdefault('preference', 'point' if on_points else 'cell')
    return dataset, look


def _from_blocks(blocks, look, maker):
    datasets = [
        block
        for block in blocks.recursive_iterator(skip_none=True, skip_empty=True)
        if isinstance(block, pv.DataSet)
    ]
    if not datasets:
        raise ValueError('mesh must have points, got no block with any')
    if look.get('scalars') is None and len({b.active_scalars_name for b in datasets}) > 1:
        # add_mesh colours only by an array that all share.
        datasets = [_without_active(block) for block in datasets]
    block_looks = [_for_block(block, look) for block in datasets]
    if look.get('clim') is None and not look.get('rgb'):
        _share_range(datasets, block_looks)
    pairs = zip(datasets, block_looks, strict=True)
    return [_from_dataset(block, block_look, maker) for block, block_look in pairs]


def _without_active(block):
    block = block.copy(deep=False)
    block.set_active_scalars(None)
    return block


def _for_block(block, look):
    """Return the look without arguments that the block does not support."""
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
    """Give blocks coloured by the same array the same range, as add_mesh does."""
    ranges: dict = {}
    for block, look in zip(blocks, looks, strict=True):
        name = look.get('scalars') or block.active_scalars_name
        values = block[name] if isinstance(name, str) else None
        if values is None or values.ndim != 1 or values.dtype.kind not in 'iufb':
            continue
        values = values[np.isfinite(values)]
        if values.size:
            low_value, high_value = ranges.setdefault(name, (values.min(), values.max()))
            ranges[name] = (min(low_value, values.min()), max(high_value, values.max()))
    for block, look in zip(blocks, looks, strict=True):
        name = look.get('scalars') or block.active_scalars_name
        if isinstance(name, str) and name in ranges:
            look['clim'] = [float(limit) for limit in ranges[name]]


def _from_scene(scene, look, maker):
    meshes, index, matrices = scene_instances(scene, look.get('pbr'))
    textures: dict = {}
    by_look: dict = {}
    surfaces = [_surfaces(mesh, look, textures) for mesh in meshes]
    for mesh_index, matrix in zip(index, matrices, strict=True):
        for dataset, surface_look in surfaces[mesh_index]:
            # Each part costs a draw call: surfaces of equal looks are merged.
            key = look_key(surface_look) + tuple(dataset.array_names)
            by_look.setdefault(key, (surface_look, []))[1].append(moved(dataset, matrix))
    return [
        _from_surface(first.append_polydata(*rest) if rest else first, surface_look, look, maker)
        for surface_look, (first, *rest) in by_look.values()
    ]


def _surfaces(mesh, look, textures=None):
    """Return the datasets of a glTF or trimesh mesh, each with its look."""
    if hasattr(mesh, 'surfaces'):
        return mesh.surfaces
    return [as_dataset(mesh, look.get('pbr'), textures)]


def _from_surface(dataset, own_look, look, maker):
    """Return the part of a surface with the look of its material."""
    merged = merged_look(own_look, look)
    # smooth_shading would replace the file's normals.
    keeps_normals = merged.get('smooth_shading') and own_look.get('smooth_shading')
    keeps_normals = keeps_normals and not look.get('split_sharp_edges')
    shading = {'smooth_shading': False} if keeps_normals else {}
    part = _from_dataset(dataset, merged | shading, maker)
    if keeps_normals and not merged.get('pbr'):
        part.actor.prop.interpolation = 'Phong'
    return part


def _from_actor(actor, look):
    conflicting = [key for key in look if key not in FIXED and look[key] is not None]
    if set(conflicting) - {'alpha_cutoff'}:
        raise ValueError(
            f'{", ".join(conflicting)} must be left out for an actor: set its look, or pass its '
            'mesh'
        )
    mapper = actor.GetMapper()
    if mapper is None or mapper.GetInputDataObject(0, 0) is None:
        raise ValueError('mesh must be an actor with a mesh, got one whose mapper has no input')
    mapper.Update()
    dataset = pv.wrap(mapper.GetInputDataObject(0, 0))
    if isinstance(dataset, pv.MultiBlock):
        return _from_composite(actor, mapper)
    return [_copied(actor, mapper, dataset, look.get('alpha_cutoff'))]


def _from_composite(actor, mapper):
    parts = []
    for block in visible_blocks(mapper):
        part = _copied(actor, mapper, block)
        set_block_look(part.actor, mapper, block)
        parts.append(part)
    if not parts:
        raise ValueError(
            'mesh must be an actor with visible points, got no visible block with any'
        )
    return parts


def copy_with(actor, mapper, dataset) -> pv.Actor:
    """Return an actor that draws the surface of a dataset with the look of another's mapper."""
    copy = pv.Actor()
    copy.mapper = _copied_mapper(mapper)
    copy.mapper.dataset = surface_of(dataset.copy(deep=False))
    copy.SetProperty(copied_property(actor.GetProperty()))
    if actor.GetBackfaceProperty() is not None:
        copy.SetBackfaceProperty(copied_property(actor.GetBackfaceProperty()))
    copy_look(copy, actor)
    copy.user_matrix = pv.array_from_vtkmatrix(actor.GetMatrix())
    return copy


def _copied(actor, mapper, dataset, cutoff=None):
    check_points(dataset)
    part = _finished(copy_with(actor, mapper, dataset), cutoff)
    part.of_actor = True
    return part


def copy_look(copy, actor):
    """Copy the texture, opacity modes and shader of an actor."""
    copy.SetTexture(actor.GetTexture())
    copy.SetForceOpaque(actor.GetForceOpaque())
    copy.SetForceTranslucent(actor.GetForceTranslucent())
    copy.GetShaderProperty().DeepCopy(actor.GetShaderProperty())


def _copied_mapper(mapper):
    copy = pv.DataSetMapper()
    copy.ShallowCopy(mapper)
    copy.SetStatic(False)
    # Its own lookup table: recolouring the user's actor must not recolour the instances.
    table = mapper.GetLookupTable()
    if table is not None:
        table_copy = pv.LookupTable() if isinstance(table, pv.LookupTable) else table.NewInstance()
        table_copy.DeepCopy(table)
        copy.SetLookupTable(table_copy)
    return copy


def _finished(actor, cutoff):
    """Return the part of an actor, with matrix and planes applied and unused arrays dropped."""
    mapper = actor.mapper
    mapper.Update()
    dataset = pv.wrap(mapper.GetInputDataObject(0, 0)).copy(deep=False)
    dataset = moved(dataset, pv.array_from_vtkmatrix(actor.GetMatrix()))
    actor.user_matrix = np.eye(4)
    # Clipping planes are in world space and must not clip instances elsewhere.
    dataset = clipped(dataset, mapper.GetClippingPlanes())
    mapper.SetClippingPlanes(_vtk.vtkPlaneCollection())
    drop_unseen(dataset, mapper)
    mesh = triangles_of(dataset)
    # Bypass the mapper's filters: smooth shading is already applied.
    mapper.dataset = dataset if draws_more(actor, dataset) else mesh
    if cutoff is not None:
        _cut_out(actor, cutoff)
    return Part(actor, mesh, cutoff)


def draws_more(actor, dataset) -> bool:
    """Return True if VTK draws more than the triangles of a mesh: edges, lines or points."""
    prop = actor.GetProperty()
    is_plain_surface = prop.GetRepresentation() == _SURFACE and not prop.GetEdgeVisibility()
    return not is_plain_surface or bool(dataset.GetNumberOfVerts() + dataset.GetNumberOfLines())


def _cut_out(actor, cutoff):
    opacity = actor.prop.opacity
    if opacity == 1:
        actor.ForceOpaqueOn()
    # After texturing; alpha includes the opacity. What remains is opaque: VTK blends in its opaque
    # pass too, and soft edges would show what lies behind.
    text = f"""//VTK::TCoord::Impl
  if (gl_FragData[0].a < {cutoff * opacity:.6f}) discard;
  gl_FragData[0].a = {opacity:.6f};
"""
    actor.GetShaderProperty().AddFragmentShaderReplacement(
        '//VTK::TCoord::Impl', True, text, False
    )
