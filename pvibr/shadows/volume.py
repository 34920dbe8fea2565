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
from pvibr.scene.casters import sized

_SURFACE = 2  # VTK_SURFACE
#: A rounding of float32, and how often it adds up on the way to the screen.
_ROUNDING = 4 * 2.0**-24
#: Apart by less than this, in sizes of what is compared, counts as touching.
_MARGIN = 1e-6


class ShadowVolumes:
    """Masks of lit pixels in one frame, one per light."""

    def __init__(self, drawer):
        self.drawer, self.window = drawer, drawer.window
        self.target: Any = None
        self.drawn = self.silhouettes = 0
        self.counts = {'depth-pass': 0, 'depth-fail': 0, 'out of view': 0}
        self._tables: dict = {}
        self._volumes: dict = {}
        self._key: tuple | None = None
        self._without = 0

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        volumes = sum(v.nbytes for v in self._volumes.values())
        return volumes + (self.target.nbytes if self.target else 0)

    def update(self, frame, lights, casters, shown):
        """Redraw the masks if anything changed."""
        key = self._content_key(frame, lights, casters.key(), shown.key())
        if key == self._key:
            return
        self._fit(frame.size, len(lights))
        meshes = self._meshes(casters)
        view = _view(frame, shown.bounds())
        with self.target.drawing():
            self._draw_depth(frame, view, shown)
            self._draw_masks(view, lights, meshes, shown.bounds())
        self.drawer.doubles.keep(shown.actors, self.window)
        self.drawer.done()
        self.drawn += len(lights)
        self._key = self._content_key(frame, lights, casters.settled(), shown.settled())

    def _content_key(self, frame, lights, *keys):
        return frame.size, frame.view.key(), tuple(lights), *keys

    def _fit(self, size, masks):
        target = self.target
        if target is None or target.size != tuple(size) or target.masks != masks:
            release(target)
            width, height = size
            self.target = StencilTarget(self.window, width, height, masks)

    # -- what casts -----------------------------------------------------------------------------

    def _meshes(self, casters) -> list[tuple]:
        """Return (actor, table of edges, world from model) of each caster."""
        old, self._tables = self._tables, {}  # what is gone is forgotten
        shapes = {key[1:]: table for key, table in old.items()}
        found = []
        solids = [t.solids() for t in casters.things]
        actors = [*casters.actors, *(a for group in solids for a in group)]
        for actor in actors:
            key, data = (None, None) if actor is None else _source(actor)
            if key is None:
                continue
            world, flat = np.reshape(actor.GetMatrix().GetData(), (4, 4)), None
            if np.linalg.matrix_rank(world[:3, :3]) < 3:  # no way back: its shape is the world's
                world, flat = np.eye(4), world
                key = (*key, flat.tobytes())
            if key not in self._tables:
                known = old.get(key)
                if known is None:
                    known = _table(data, flat, shapes.get(key[1:]) if len(key) > 1 else None)
                self._tables[key] = known
            if len(self._tables[key].triangles):
                found.append((actor, self._tables[key], world))
        self._without = len(actors) - len(found)
        return found

    # -- drawing --------------------------------------------------------------------------------

    def _draw_depth(self, frame, view, shown):
        width, height = self.target.size
        self.drawer.look(view, (0, 0, width, height))
        bulge = self.drawer.inner.GetSize()[0] / width
        with sized(shown.actors, frame, frame, bulge):
            self.drawer.draw_depth(shown.actors)
        for thing in shown.things:
            self.drawer.draw(thing.depths())

    def _draw_masks(self, view, lights, meshes, shown):
        boxes = np.array([actor.GetBounds() for actor, *_ in meshes], float).reshape(-1, 6)
        scene = np.stack([shown[:, ::2].min(0), shown[:, 1::2].max(0)], 1).ravel()
        self.counts = dict.fromkeys(self.counts, 0)
        old, self._volumes = self._volumes, {}
        for mask, light in enumerate(lights):
            place = light.homogeneous()
            rects = shadow_rects(view, place, boxes, scene, self.target.size)
            seen, safe = rects[:, 2:].min(1) > 0, safe_before(view, place, boxes)
            ways: tuple = ([], [])
            for k, (actor, edges, world) in enumerate(meshes):
                key = (light.number, address(actor))
                self._volumes[key] = found = old.pop(key, None) or _Volume()
                if seen[k]:
                    way = ways[not (safe[k] and _is_whole(actor))]
                    way.append((found, edges, world, rects[k].tolist()))
            self.counts['out of view'] += int((~seen).sum())
            self._count(view, place, mask, ways)
        for gone in old.values():
            gone.release(self.window)

    def _count(self, view, place, mask, ways):
        state = self.window.GetState()
        with self.target.counting(mask):
            for behind, volumes in enumerate(ways):
                self.target.count(behind=bool(behind))
                self.counts['depth-fail' if behind else 'depth-pass'] += len(volumes)
                for found, edges, world, rect in volumes:
                    state.vtkglScissor(*rect)
                    self.silhouettes += found.update(edges, world, place, caps=bool(behind))
                    actors = found.actors(view, self.target.size[1], caps=bool(behind))
                    self.drawer.draw(actors, translucent=True)

    # -- what receives --------------------------------------------------------------------------

    def uniforms(self, frame) -> dict:
        """Return the uniforms of receivers, with the masks bound."""
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
            'masks drawn': self.drawn,
            'outlines found': self.silhouettes,
            'casters without volume': self._without,
        }

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        for found in self._volumes.values():
            found.release(self.window)
        release(self.target)
        self.target = self._key = None
        self._volumes, self._tables = {}, {}


def receiver_text(lights) -> tuple[dict[str, str], str]:
    """Return samplers and source of the shader of receivers."""
    parts = sections(shader_source(__file__))
    text = parts['declare']
    for k, (number, positional) in enumerate(lights):
        values = {
            'NUMBER': str(number),
            'POSITIONAL': str(bool(positional)).lower(),
            'MASK': f'ibr_shadow_mask_{k // 4}',
            'CHANNEL': 'rgba'[k % 4],
        }
        light = parts['light']
        for name, value in values.items():
            light = light.replace(name, value)
        text += light
    return {f'ibr_shadow_mask_{k}': 'sampler2D' for k in range(-(-len(lights) // 4))}, text


class _Volume:
    """The shadow volume of one caster and light, in model space."""

    def __init__(self):
        self.sides, self.caps = _Part(_feature(False)), _Part(_feature(True))
        self._edges = self._world = None
        self._light = np.full(4, np.nan)  # of none yet
        self._mirrored = False
        self._filled: bool | None = None

    @property
    def nbytes(self) -> int:
        return self.sides.nbytes + self.caps.nbytes

    def update(self, edges, world, place, *, caps) -> bool:
        """Update the silhouette; return whether it changed."""
        light = np.linalg.inv(world) @ place
        light[3] = place[3]
        mirrored = np.linalg.det(world[:3, :3]) < 0
        same = self._edges is edges and np.array_equal(light, self._light)
        fresh = not (same and mirrored == self._mirrored)
        if fresh:
            self._edges, self._light, self._mirrored = edges, light, mirrored
        if fresh or (caps and not self._filled):
            self._fill(caps)
        self._world = world
        return fresh

    def _fill(self, caps):
        lit = LitMesh(self._edges, self._light)
        vertices, triangles = lit.volume(caps=caps)
        sides = len(triangles)
        if caps:
            sides = len(lit.volume_triangles(caps=False))
        if self._mirrored:  # what is turned outward winds the other way there
            triangles = triangles[:, ::-1]
        self.sides.fill(vertices, triangles[:sides])
        if caps:
            self.caps.fill(vertices, triangles[sides:])
        self._filled = caps

    def actors(self, view, height, *, caps) -> list:
        """Return the actors to draw in a view."""
        clip, slack = _clip_from_caster(view, self._world, self._edges, height)
        parts = [p for p in (self.sides, self.caps)[: 1 + caps] if p.filled]
        for part in parts:
            part.aim(clip, slack)
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
        mapper.SetVBOShiftScaleMethod(0)  # the shader takes the numbers as they are
        self.actor = _vtk.vtkActor()
        self.actor.SetMapper(mapper)
        self.actor.GetProperty().LightingOff()
        self.actor.ForceTranslucentOn()  # what VTK draws so writes no depth
        feature.attach(self.actor)

    @property
    def filled(self) -> bool:
        return self.nbytes > 0

    def fill(self, vertices, triangles):
        """Set homogeneous vertices, those at infinity last, and triangles."""
        points, polys = _vtk.vtkPoints(), _vtk.vtkCellArray()
        floats, cells = np.float32(vertices[:, :3]), np.int32(triangles)
        points.SetData(_vtk.numpy_to_vtk(floats, deep=True))
        offsets = np.arange(0, cells.size + 1, 3, dtype=np.int32)
        polys.SetData(*(_vtk.numpy_to_vtk(a, deep=True) for a in (offsets, cells.ravel())))
        self.mesh.SetPoints(points)
        self.mesh.SetPolys(polys)
        self._near = int(np.count_nonzero(vertices[:, 3]))
        self.nbytes = (floats.nbytes + cells.nbytes) if len(cells) else 0

    def aim(self, clip, slack):
        uniforms = {'ibr_volume_clip': clip, 'ibr_volume_near': self._near}
        set_vertex_uniforms([self.actor], uniforms)
        set_fragment_uniforms([self.actor], {'ibr_volume_slack': slack})

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
    """Return a mesh that throws a shadow with a key of its shape, or None and None."""
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
    data = mapper.GetInputDataObject(0, 0)
    if data is None:
        return None, None
    parts = [data]
    if data.IsA('vtkPolyData'):
        # Colours may change as they like.
        parts = [p for p in (data.GetPoints(), data.GetPolys(), data.GetStrips()) if p is not None]
    return tuple((address(p), p.GetMTime()) for p in parts), data


def _is_part(actor) -> bool:
    """Return whether only a part of an actor's polygons is drawn."""
    mapper = actor.GetMapper()
    planes = mapper.GetClippingPlanes()
    if is_cut_out(actor) or (planes is not None and planes.GetNumberOfItems()):
        return True
    attributes = getattr(mapper, 'GetCompositeDataDisplayAttributes', lambda: None)()
    return attributes is not None and attributes.HasBlockVisibilities()


def _table(data, matrix, like=None):
    """Return the edge table of a mesh, from that of the same triangles if only points moved."""
    if like is not None and matrix is None:
        moved = moved_table(like, _vtk.vtk_to_numpy(data.GetPoints().GetData()))
        if moved is not None:
            return moved
    points, triangles = _triangles(data)
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return edge_table(points, triangles)


def _triangles(data):
    """Return points (n, 3) and triangles (m, 3); polygons are fans, as in VTK's mappers."""
    if not data.IsA('vtkPolyData'):
        composite = data.IsA('vtkCompositeDataSet')
        surface = _vtk.vtkCompositeDataGeometryFilter() if composite else _vtk.vtkGeometryFilter()
        surface.SetInputDataObject(data)
        surface.Update()
        data = surface.GetOutput()
    if data.GetPoints() is None:
        return np.zeros((0, 3)), np.zeros((0, 3), int)
    found = [*_cut(data.GetPolys(), _fan), *_cut(data.GetStrips(), _strip)]
    triangles = np.concatenate(found) if found else np.zeros((0, 3), int)
    return _vtk.vtk_to_numpy(data.GetPoints().GetData()), triangles


def _fan(size):
    return [(0, i, i + 1) for i in range(1, size - 1)]


def _strip(size):
    return [(i + i % 2, i + 1 - i % 2, i + 2) for i in range(size - 2)]


def _cut(cells, pattern):
    """Yield the triangles of all cells of each size."""
    if cells is None or not cells.GetNumberOfCells():
        return
    ids = _vtk.vtk_to_numpy(cells.GetConnectivityArray())
    size = cells.IsHomogeneous()
    if size > 0:
        offsets = np.arange(0, len(ids) + 1, size)
    else:
        offsets = _vtk.vtk_to_numpy(cells.GetOffsetsArray())
    sizes = np.diff(offsets)
    for size in np.unique(sizes[sizes > 2]):
        starts = offsets[:-1][sizes == size]
        yield ids[(starts[:, None, None] + np.array(pattern(size))).reshape(-1, 3)]


def _is_whole(actor) -> bool:
    """Return whether an actor is drawn without culling and clipping."""
    prop, planes = actor.GetProperty(), actor.GetMapper().GetClippingPlanes()
    cut = planes is not None and planes.GetNumberOfItems() > 0
    return not (cut or prop.GetBackfaceCulling() or prop.GetFrontfaceCulling())


# -- views --------------------------------------------------------------------------------------


def _view(frame, bounds) -> View:
    """Return the frame's view with near and far planes fitted to bounds."""
    near, far = frame.near, frame.far
    clip = frame.clip_from_view.copy()
    parallel = bool(clip[3, 3])
    away = (frame.eye - corners(bounds)) @ frame.view_from_world[2, :3]
    if away.size:
        pad = 1e-3 * np.ptp(away) if parallel else 0.5 * abs(away.min())
        near = max(near, float(away.min() - pad))
        far = min(far, float(away.max() + pad))
    if near < far and np.allclose(clip[2], _depth_row(frame.near, frame.far, parallel)):
        clip[2] = _depth_row(near, far, parallel)
    return replace(frame.view, clip_from_view=clip, near=near, far=far)


def _depth_row(near, far, parallel):
    if parallel:
        return [0.0, 0.0, -2 / (far - near), -(far + near) / (far - near)]
    return [0.0, 0.0, -(far + near) / (far - near), -2 * far * near / (far - near)]


def _clip_from_caster(view, world, edges, height):
    """Return clip from model space, and the rounding error in pixels and depth."""
    axes = view.view_from_world[:3, :3]
    local = np.eye(4)
    local[:3, :3] = axes @ world[:3, :3]
    # The difference first: far from the world's origin both are large.
    local[:3, 3] = axes @ (world[:3, :3] @ edges.origin + world[:3, 3] - view.eye)
    clip = view.clip_from_view
    size = np.linalg.norm(np.abs(world[:3, :3]) @ edges.half_box)
    step = clip[2, 2] if view.parallel else clip[2, 3]
    pixel = clip[1, 1] * height / 2
    return clip @ local, (_ROUNDING * size * np.array([pixel, 0.5 * abs(step)])).tolist()


def shadow_rects(view, light, bounds, scene, size) -> np.ndarray:
    """Return the rectangles of pixels where boxes may cast shadows."""
    near = corners(bounds) - view.eye
    place = light[:3] - light[3] * view.eye
    away = light[3] * near - place
    # How often a corner's way from the light is gone until the scene ends, at most.
    low, high = np.asarray(scene, float).reshape(3, 2).T - view.eye
    with np.errstate(divide='ignore', invalid='ignore'):
        ends = np.where(away > 0, high - near, low - near) / away
    one_way = (away > 0).all(1) | (away < 0).all(1)
    reach = np.where(one_way, ends.max(1), np.inf).min(1)
    reach = np.where(np.isfinite(reach), np.maximum(reach, 0.0), 1e6)
    points = np.concatenate([near, near + reach[:, None, None] * away], axis=1)
    axes, clip = view.view_from_world[:3, :3], view.clip_from_view
    x, y, _, w = np.moveaxis(points @ (clip[:, :3] @ axes).T + clip[:, 3], -1, 0)
    outside = [(side > w).all(1) for side in (x, -x, y, -y)] + [(w < 0).all(1)]
    ahead = (w > 1e-6 * np.abs(w).max(1, keepdims=True)).all(1)[:, None]
    pixels = []
    for across, side in zip((x, y), size, strict=True):
        at = (across / np.where(ahead, w, 1.0) + 1) / 2 * side
        first = np.where(ahead[:, 0], np.floor(at.min(1)) - 2, 0).clip(0, side)
        last = np.where(ahead[:, 0], np.ceil(at.max(1)) + 2, side).clip(0, side)
        pixels.append((first, last - first))
    (left, width), (bottom, height) = pixels
    rects = np.stack([left, bottom, width, height], axis=1).astype(int)
    rects[np.any(outside, axis=0)] = 0
    return rects


def safe_before(view, light, bounds) -> np.ndarray:
    """Return which boxes cannot shadow the near plane."""
    axes = view.view_from_world[:3, :3]
    square = np.array([(-1, -1, -1, 1), (1, -1, -1, 1), (1, 1, -1, 1), (-1, 1, -1, 1)])
    near = square @ np.linalg.inv(view.clip_from_view).T
    near = near[:, :3] / near[:, 3:] @ axes
    boxes = corners(bounds) - view.eye
    place = light[:3] - light[3] * view.eye
    sides = np.cross(np.roll(near, -1, axis=0) - near, light[3] * near - place)
    normals = np.concatenate([np.eye(3), axes[2:], sides])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals = np.concatenate([normals, -normals])
    reach = (near @ normals.T).max(0)
    if light[3]:
        reach = np.maximum(reach, normals @ place)
    else:
        reach[normals @ place > 1e-9 * np.linalg.norm(place)] = np.inf
    heights = boxes @ normals.T
    size = np.abs(heights).max(axis=(1, 2), initial=0)[:, None] + np.abs(near).max()
    return (heights.min(1) > reach + _MARGIN * size).any(1)
