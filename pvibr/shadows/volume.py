"""Shadow volumes counted in a stencil buffer: shadows exact to the pixel."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl import release, set_fragment_uniforms, set_vertex_uniforms, shader_source
from pvibr.gl.doubles import is_cut_out
from pvibr.gl.feature import Feature, sections
from pvibr.gl.stencil import StencilTarget
from pvibr.maths.silhouettes import LitMesh, edge_table, moved_table
from pvibr.maths.views import View, corners
from pvibr.things.casters import sized

_SURFACE = 2  # VTK_SURFACE
#: Rounding of float32, times the operations on the way to the screen.
_ROUNDING = 4 * 2.0**-24
#: Gaps below this fraction of the compared sizes count as touching.
_MARGIN = 1e-6


class ShadowVolumes:
    """Masks of lit pixels in one frame, one per light."""

    def __init__(self, drawer):
        self.drawer, self.window = drawer, drawer.window
        self.target: Any = None
        self.masks_drawn = self.silhouettes = 0
        self.counts = {'depth-pass': 0, 'depth-fail': 0, 'out of view': 0}
        self._edge_tables: dict = {}
        self._volumes: dict = {}
        self._key: tuple | None = None
        self._without_volume = 0

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        volumes = sum(v.nbytes for v in self._volumes.values())
        return volumes + (self.target.nbytes if self.target else 0)

    def update(self, frame, lights, casters, visible):
        """Redraw the masks if anything changed."""
        content_key = self._content_key(frame, lights, casters.key(), visible.key())
        if content_key == self._key:
            return
        self._fit(frame.size, len(lights))
        caster_meshes = self._meshes(casters)
        view = _view(frame, visible.bounds())
        with self.target.drawing():
            self._draw_depth(frame, view, visible)
            self._draw_masks(view, lights, caster_meshes, visible.bounds())
        self.drawer.doubles.keep(visible.actors, self.window)
        self.drawer.done()
        self.masks_drawn += len(lights)
        self._key = self._content_key(frame, lights, casters.settled(), visible.settled())

    def _content_key(self, frame, lights, *keys):
        return frame.size, frame.view.key(), tuple(lights), *keys

    def _fit(self, size, masks):
        target = self.target
        if target is None or target.size != tuple(size) or target.masks != masks:
            release(target)
            width, height = size
            self.target = StencilTarget(self.window, width, height, masks)

    def _meshes(self, casters) -> list[tuple]:
        """Return (actor, edge table, world from model) of each caster."""
        old_tables, self._edge_tables = self._edge_tables, {}
        tables_by_shape = {key[1:]: table for key, table in old_tables.items()}
        caster_meshes = []
        solid_groups = [t.solids() for t in casters.things]
        actors = [*casters.actors, *(a for group in solid_groups for a in group)]
        for actor in actors:
            key, mesh_data = (None, None) if actor is None else _source(actor)
            if key is None:
                continue
            world_from_model, flat_matrix = np.reshape(actor.GetMatrix().GetData(), (4, 4)), None
            if np.linalg.matrix_rank(world_from_model[:3, :3]) < 3:  # bake what cannot be inverted
                world_from_model, flat_matrix = np.eye(4), world_from_model
                key = (*key, flat_matrix.tobytes())
            if key not in self._edge_tables:
                same_shape = tables_by_shape.get(key[1:]) if len(key) > 1 else None
                self._edge_tables[key] = old_tables.get(key) or _table(
                    mesh_data, flat_matrix, same_shape
                )
            if len(self._edge_tables[key].triangles):
                caster_meshes.append((actor, self._edge_tables[key], world_from_model))
        self._without_volume = len(actors) - len(caster_meshes)
        return caster_meshes

    def _draw_depth(self, frame, view, visible):
        width, height = self.target.size
        self.drawer.look(view, (0, 0, width, height))
        bulge = self.drawer.inner.GetSize()[0] / width
        with sized(visible.actors, frame, frame, bulge):
            self.drawer.draw_depth(visible.actors)
        for thing in visible.things:
            self.drawer.draw(thing.depths())

    def _draw_masks(self, view, lights, meshes, visible_bounds):
        caster_bounds = np.array([actor.GetBounds() for actor, *_ in meshes], float).reshape(-1, 6)
        low, high = visible_bounds[:, ::2].min(0), visible_bounds[:, 1::2].max(0)
        scene_bounds = np.stack([low, high], 1).ravel()
        self.counts = dict.fromkeys(self.counts, 0)
        old_volumes, self._volumes = self._volumes, {}
        for mask_number, light in enumerate(lights):
            light_place = light.homogeneous()
            rects = shadow_rects(view, light_place, caster_bounds, scene_bounds, self.target.size)
            in_view = rects[:, 2:].min(1) > 0
            safe_near = safe_before(view, light_place, caster_bounds)
            volumes_by_way: tuple = ([], [])
            for k, (actor, edges, world) in enumerate(meshes):
                key = (light.number, address(actor))
                self._volumes[key] = volume = old_volumes.pop(key, None) or _Volume()
                if in_view[k]:
                    way_volumes = volumes_by_way[not (safe_near[k] and _is_whole(actor))]
                    way_volumes.append((volume, edges, world, rects[k].tolist()))
            self.counts['out of view'] += int((~in_view).sum())
            self._count(view, light_place, mask_number, volumes_by_way)
        for stale_volume in old_volumes.values():
            stale_volume.release(self.window)

    def _count(self, view, light_place, mask_number, volumes_by_way):
        state = self.window.GetState()
        with self.target.counting(mask_number):
            for behind, volumes in enumerate(volumes_by_way):
                self.target.count(behind=bool(behind))
                self.counts['depth-fail' if behind else 'depth-pass'] += len(volumes)
                for volume, edges, world, rect in volumes:
                    state.vtkglScissor(*rect)
                    self.silhouettes += volume.update(edges, world, light_place, caps=bool(behind))
                    actors = volume.actors(view, self.target.size[1], caps=bool(behind))
                    self.drawer.draw(actors, translucent=True)

    def uniforms(self, frame) -> dict:
        """Bind the masks, and return the uniforms of receivers."""
        masks = enumerate(self.target.textures)
        return {
            'ibr_shadow_clip': frame.clip_from_view,
            'ibr_shadow_tile': (*frame.origin, *self.target.size),
            **{f'ibr_shadow_mask_{k}': texture.activate() for k, texture in masks},
        }

    def finish(self):
        """Release the texture units."""
        for texture in self.target.textures if self.target else ():
            texture.deactivate()

    def report(self) -> dict:
        """Return the number of volumes by counting method, and of casters without volume."""
        return self.counts | {
            'masks drawn': self.masks_drawn,
            'outlines found': self.silhouettes,
            'casters without volume': self._without_volume,
        }

    def release(self):
        """Free GPU memory; the context must be current."""
        for volume in self._volumes.values():
            volume.release(self.window)
        release(self.target)
        self.target = self._key = None
        self._volumes, self._edge_tables = {}, {}


def receiver_text(lights) -> tuple[dict[str, str], str]:
    """Return samplers and source of the receivers' shader."""
    shader_parts = sections(shader_source(__file__))
    receiver_code = shader_parts['declare']
    for light_index, (number, positional) in enumerate(lights):
        replacements = {
            'NUMBER': str(number),
            'POSITIONAL': str(bool(positional)).lower(),
            'MASK': f'ibr_shadow_mask_{light_index // 4}',
            'CHANNEL': 'rgba'[light_index % 4],
        }
        light_code = shader_parts['light']
        for name, value in replacements.items():
            light_code = light_code.replace(name, value)
        receiver_code += light_code
    mask_count = -(-len(lights) // 4)
    return {f'ibr_shadow_mask_{k}': 'sampler2D' for k in range(mask_count)}, receiver_code


class _Volume:
    """The shadow volume of one caster and light, in model space."""

    def __init__(self):
        self.sides, self.caps = _Part(_feature(False)), _Part(_feature(True))
        self._edges = self._world_from_model = None
        self._model_light = np.full(4, np.nan)  # none yet
        self._is_mirrored = False
        self._has_caps: bool | None = None

    @property
    def nbytes(self) -> int:
        return self.sides.nbytes + self.caps.nbytes

    def update(self, edges, world_from_model, light_place, *, caps) -> bool:
        """Update the silhouette; return whether it changed."""
        model_light = np.linalg.inv(world_from_model) @ light_place
        model_light[3] = light_place[3]
        is_mirrored = np.linalg.det(world_from_model[:3, :3]) < 0
        is_same = self._edges is edges and np.array_equal(model_light, self._model_light)
        is_new = not (is_same and is_mirrored == self._is_mirrored)
        if is_new:
            self._edges, self._model_light, self._is_mirrored = edges, model_light, is_mirrored
        if is_new or (caps and not self._has_caps):
            self._fill(caps)
        self._world_from_model = world_from_model
        return is_new

    def _fill(self, caps):
        lit_mesh = LitMesh(self._edges, self._model_light)
        vertices, triangles = lit_mesh.volume(caps=caps)
        side_count = len(triangles)
        if caps:
            side_count = len(lit_mesh.volume_triangles(caps=False))
        if self._is_mirrored:  # mirroring reverses the winding
            triangles = triangles[:, ::-1]
        self.sides.fill(vertices, triangles[:side_count])
        if caps:
            self.caps.fill(vertices, triangles[side_count:])
        self._has_caps = caps

    def actors(self, view, height, *, caps) -> list:
        """Return the actors to draw in a view."""
        aim = _clip_from_caster(view, self._world_from_model, self._edges, height)
        parts = [p for p in (self.sides, self.caps)[: 1 + caps] if p.filled]
        for part in parts:
            part.aim(*aim)
        return [part.actor for part in parts]

    def release(self, window):
        for part in (self.sides, self.caps):
            part.release(window)


class _Part:
    """Triangles with vertices at infinity, as an actor that writes no depth."""

    def __init__(self, feature):
        self.mesh = _vtk.vtkPolyData()
        self.nbytes = self._near = 0
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputData(self.mesh)
        mapper.ScalarVisibilityOff()
        mapper.SetVBOShiftScaleMethod(0)  # the shader needs unscaled coordinates
        self.actor = _vtk.vtkActor()
        self.actor.SetMapper(mapper)
        self.actor.GetProperty().LightingOff()
        self.actor.ForceTranslucentOn()  # VTK then writes no depth
        feature.attach(self.actor)

    @property
    def filled(self) -> bool:
        return self.nbytes > 0

    def fill(self, vertices, triangles):
        """Set homogeneous vertices, those at infinity last, and triangles."""
        points, polys = _vtk.vtkPoints(), _vtk.vtkCellArray()
        float_points, triangle_ids = np.float32(vertices[:, :3]), np.int32(triangles)
        points.SetData(_vtk.numpy_to_vtk(float_points, deep=True))
        offsets = np.arange(0, triangle_ids.size + 1, 3, dtype=np.int32)
        polys.SetData(*(_vtk.numpy_to_vtk(a, deep=True) for a in (offsets, triangle_ids.ravel())))
        self.mesh.SetPoints(points)
        self.mesh.SetPolys(polys)
        self._near = int(np.count_nonzero(vertices[:, 3]))
        self.nbytes = (float_points.nbytes + triangle_ids.nbytes) if len(triangle_ids) else 0

    def aim(self, clip_from_caster, depth_slack):
        uniforms = {'ibr_volume_clip': clip_from_caster, 'ibr_volume_near': self._near}
        set_vertex_uniforms([self.actor], uniforms)
        set_fragment_uniforms([self.actor], {'ibr_volume_slack': depth_slack})

    def release(self, window):
        self.actor.ReleaseGraphicsResources(window)
        self.actor.GetMapper().ReleaseGraphicsResources(window)


@lru_cache(maxsize=2)
def _feature(caps) -> Feature:
    parts = sections(shader_source(__file__))
    fragment = {'VTK::Depth::Impl': parts['cap']} if caps else {}
    return Feature('shadow_volume', {'VTK::PositionVC::Impl': parts['vertex']}, fragment)


# -- meshes -------------------------------------------------------------------------------------


def _source(actor):
    """Return a key of a caster's shape and its mesh, or None and None."""
    mapper = actor.GetMapper()
    if (
        any(mapper.IsA(name) for name in ('vtkGlyph3DMapper', 'vtkPointGaussianMapper'))
        or actor.GetProperty().GetRepresentation() != _SURFACE
        or actor.HasTranslucentPolygonalGeometry()
        or _is_part(actor)
    ):
        return None, None
    if mapper.GetInputAlgorithm() is not None:
        mapper.GetInputAlgorithm().Update()
    mesh_data = mapper.GetInputDataObject(0, 0)
    if mesh_data is None:
        return None, None
    mesh_parts = [mesh_data]
    if mesh_data.IsA('vtkPolyData'):
        # Colours do not count.
        arrays = mesh_data.GetPoints(), mesh_data.GetPolys(), mesh_data.GetStrips()
        mesh_parts = [array for array in arrays if array is not None]
    return tuple((address(p), p.GetMTime()) for p in mesh_parts), mesh_data


def _is_part(actor) -> bool:
    """Return True if only a part of an actor's polygons is drawn."""
    mapper = actor.GetMapper()
    planes = mapper.GetClippingPlanes()
    if is_cut_out(actor) or (planes is not None and planes.GetNumberOfItems()):
        return True
    attributes = getattr(mapper, 'GetCompositeDataDisplayAttributes', lambda: None)()
    return attributes is not None and attributes.HasBlockVisibilities()


def _table(data, matrix, old_table=None):
    """Return the edge table of a mesh, updated from an old one if only points moved."""
    if old_table is not None and matrix is None:
        table = moved_table(old_table, _vtk.vtk_to_numpy(data.GetPoints().GetData()))
        if table is not None:
            return table
    points, triangles = _triangles(data)
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return edge_table(points, triangles)


def _triangles(data):
    """Return points (n, 3) and triangles (m, 3); polygons are fans, as in VTK's mappers."""
    if not data.IsA('vtkPolyData'):
        surface_filter = _vtk.vtkGeometryFilter()
        if data.IsA('vtkCompositeDataSet'):
            surface_filter = _vtk.vtkCompositeDataGeometryFilter()
        surface_filter.SetInputDataObject(data)
        surface_filter.Update()
        data = surface_filter.GetOutput()
    if data.GetPoints() is None:
        return np.zeros((0, 3)), np.zeros((0, 3), int)
    groups = [*_cut(data.GetPolys(), _fan), *_cut(data.GetStrips(), _strip)]
    triangles = np.concatenate([np.zeros((0, 3), int), *groups])
    return _vtk.vtk_to_numpy(data.GetPoints().GetData()), triangles


def _fan(size):
    return [(0, i, i + 1) for i in range(1, size - 1)]


def _strip(size):
    return [(i + i % 2, i + 1 - i % 2, i + 2) for i in range(size - 2)]


def _cut(cells, triangle_pattern):
    """Yield the triangles of all cells of each size."""
    if cells is None or not cells.GetNumberOfCells():
        return
    point_ids = _vtk.vtk_to_numpy(cells.GetConnectivityArray())
    size = cells.IsHomogeneous()
    if size > 0:
        offsets = np.arange(0, len(point_ids) + 1, size)
    else:
        offsets = _vtk.vtk_to_numpy(cells.GetOffsetsArray())
    sizes = np.diff(offsets)
    for size in np.unique(sizes[sizes > 2]):
        starts = offsets[:-1][sizes == size]
        yield point_ids[(starts[:, None, None] + np.array(triangle_pattern(size))).reshape(-1, 3)]


def _is_whole(actor) -> bool:
    """Return True if an actor is drawn without culling and clipping."""
    prop, planes = actor.GetProperty(), actor.GetMapper().GetClippingPlanes()
    is_clipped = planes is not None and planes.GetNumberOfItems() > 0
    return not (is_clipped or prop.GetBackfaceCulling() or prop.GetFrontfaceCulling())


# -- views --------------------------------------------------------------------------------------


def _view(frame, bounds) -> View:
    """Return the frame's view with near and far planes fitted to bounds."""
    near_plane, far_plane = frame.near, frame.far
    clip_from_view = frame.clip_from_view.copy()
    is_parallel = bool(clip_from_view[3, 3])
    view_distances = (frame.eye - corners(bounds)) @ frame.view_from_world[2, :3]
    if view_distances.size:
        padding = 1e-3 * np.ptp(view_distances) if is_parallel else 0.5 * abs(view_distances.min())
        near_plane = max(near_plane, float(view_distances.min() - padding))
        far_plane = min(far_plane, float(view_distances.max() + padding))
    own_depth_row = _depth_row(frame.near, frame.far, is_parallel)
    if near_plane < far_plane and np.allclose(clip_from_view[2], own_depth_row):
        clip_from_view[2] = _depth_row(near_plane, far_plane, is_parallel)
    return replace(frame.view, clip_from_view=clip_from_view, near=near_plane, far=far_plane)


def _depth_row(near, far, parallel):
    if parallel:
        return [0.0, 0.0, -2 / (far - near), -(far + near) / (far - near)]
    return [0.0, 0.0, -(far + near) / (far - near), -2 * far * near / (far - near)]


def _clip_from_caster(view, world_from_model, edges, height):
    """Return clip from model space, and the rounding error in pixels and depth."""
    view_axes = view.view_from_world[:3, :3]
    model_axes, view_from_model = world_from_model[:3, :3], np.eye(4)
    view_from_model[:3, :3] = view_axes @ model_axes
    # Subtract first: far from the world's origin both terms are large.
    from_eye = model_axes @ edges.origin + world_from_model[:3, 3] - view.eye
    view_from_model[:3, 3] = view_axes @ from_eye
    clip_from_view = view.clip_from_view
    caster_size = np.linalg.norm(np.abs(model_axes) @ edges.half_box)
    depth_step = clip_from_view[2, 2] if view.parallel else clip_from_view[2, 3]
    pixel_scale = clip_from_view[1, 1] * height / 2
    depth_slack = _ROUNDING * caster_size * np.array([pixel_scale, 0.5 * abs(depth_step)])
    return clip_from_view @ view_from_model, depth_slack.tolist()


def shadow_rects(view, light_point, bounds, scene, size) -> np.ndarray:
    """Return the rectangles of pixels where boxes may cast shadows."""
    box_corners = corners(bounds) - view.eye
    light_offset = light_point[:3] - light_point[3] * view.eye
    light_away = light_point[3] * box_corners - light_offset
    # How far each corner's ray from the light goes until it leaves the scene, in its own lengths.
    low_corner, high_corner = np.asarray(scene, float).reshape(3, 2).T - view.eye
    with np.errstate(divide='ignore', invalid='ignore'):
        exits = np.where(light_away > 0, high_corner - box_corners, low_corner - box_corners)
        exit_factors = exits / light_away
    one_way = (light_away > 0).all(1) | (light_away < 0).all(1)
    ray_reach = np.where(one_way, exit_factors.max(1), np.inf).min(1)
    ray_reach = np.where(np.isfinite(ray_reach), np.maximum(ray_reach, 0.0), 1e6)
    far_corners = box_corners + ray_reach[:, None, None] * light_away
    points = np.concatenate([box_corners, far_corners], axis=1)
    axes, clip = view.view_from_world[:3, :3], view.clip_from_view
    x, y, _, w = np.moveaxis(points @ (clip[:, :3] @ axes).T + clip[:, 3], -1, 0)
    outside = [(side > w).all(1) for side in (x, -x, y, -y)] + [(w < 0).all(1)]
    in_front = (w > 1e-6 * np.abs(w).max(1, keepdims=True)).all(1)[:, None]
    pixel_spans = []
    for across, side in zip((x, y), size, strict=True):
        pixel_coords = (across / np.where(in_front, w, 1.0) + 1) / 2 * side
        first_pixel = np.where(in_front[:, 0], np.floor(pixel_coords.min(1)) - 2, 0).clip(0, side)
        end_pixel = np.where(in_front[:, 0], np.ceil(pixel_coords.max(1)) + 2, side).clip(0, side)
        pixel_spans.append((first_pixel, end_pixel - first_pixel))
    (left, width), (bottom, height) = pixel_spans
    rects = np.stack([left, bottom, width, height], axis=1).astype(int)
    rects[np.any(outside, axis=0)] = 0
    return rects


def safe_before(view, light_point, bounds) -> np.ndarray:
    """Return the mask of boxes that cannot shadow the near plane."""
    view_axes = view.view_from_world[:3, :3]
    square = np.array([(-1, -1, -1, 1), (1, -1, -1, 1), (1, 1, -1, 1), (-1, 1, -1, 1)])
    near_corners = square @ np.linalg.inv(view.clip_from_view).T
    near_corners = near_corners[:, :3] / near_corners[:, 3:] @ view_axes
    box_corners = corners(bounds) - view.eye
    light_offset = light_point[:3] - light_point[3] * view.eye
    near_edges = np.roll(near_corners, -1, axis=0) - near_corners
    side_normals = np.cross(near_edges, light_point[3] * near_corners - light_offset)
    normals = np.concatenate([np.eye(3), view_axes[2:], side_normals])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals = np.concatenate([normals, -normals])
    prism_reach = (near_corners @ normals.T).max(0)
    if light_point[3]:
        prism_reach = np.maximum(prism_reach, normals @ light_offset)
    else:
        prism_reach[normals @ light_offset > 1e-9 * np.linalg.norm(light_offset)] = np.inf
    corner_heights = box_corners @ normals.T
    size_scale = np.abs(corner_heights).max(axis=(1, 2), initial=0)[:, None]
    size_scale = size_scale + np.abs(near_corners).max()
    return (corner_heights.min(1) > prism_reach + _MARGIN * size_scale).any(1)
