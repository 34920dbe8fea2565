"""Quadrics by the million, ray-cast on cards."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.core.colors import as_rgb
from pvibr.core.params import checked_flag
from pvibr.core.signatures import takes
from pvibr.gl import nbytes_of
from pvibr.gl.binder import Binder
from pvibr.maths.blocks import BLOCK, Blocks, morton_order
from pvibr.points import replaced_items
from pvibr.points.point_arguments import checked_opacity
from pvibr.points.quadric_cards import (
    BLENDED,
    DRAW_MODES,
    GIANTS,
    Layer,
    Shape,
    eye_of,
    giant_blocks,
    view_uniforms,
    visible_blocks,
    with_eye_at_origin,
)
from pvibr.points.quadric_geometry import Geometry
from pvibr.points.quadric_occlusion import Occlusion
from pvibr.things.appearance import TABLE_OPTIONS, alphas_of, as_rgba, blend
from pvibr.things.draw_order import depths_of, interleaved
from pvibr.things.item_set import ItemSet
from pvibr.things.item_textures import ItemTextures
from pvibr.things.picking import Hit, joined, pixel_ray
from pvibr.things.shader_draws import ROW, is_shiny

# Alpha of looks: 0 hidden; 1 to 127 opacity, in the material's colour; from 128 opacity plus 128,
# in the item's own colour.
_OPAQUE = 127


class Quadrics(ItemSet):
    """Quadrics of one shape by the million, ray-cast per pixel, without triangles.

    Parameters are those of :class:`pvibr.Spheres`, without positions and sizes, which a subclass
    passes as `given`; it has ``_arranged_from`` and ``_geometry_in``.
    """

    FOR_USERS: tuple[str, ...] = ('update',)
    web = 'baked', 'meshes'
    is_cut_out = False
    #: Positions and sizes of the items by name, a row per item, in its own space.
    _arranged: dict
    #: The same, as users gave them.
    _given: dict
    #: Number of items for which the layers have room.
    room = 0
    #: Of the items in world space.
    geometry: Geometry

    @takes(table=TABLE_OPTIONS)
    def __init__(
        self,
        given,
        *,
        nan='raise',
        color=None,
        colors=None,
        scalars=None,
        visible=None,
        opacity=1.0,
        lighting=None,
        ambient=None,
        diffuse=None,
        specular=None,
        specular_power=None,
        pbr=None,
        metallic=None,
        roughness=None,
        pickable=True,
        name=None,
        theme=None,
        **table,
    ):
        super().__init__()
        self.name = name
        looks = replaced_items.adopt(self, nan, given, {'scalars': scalars})
        self._opacity = checked_opacity(opacity, len(self), cut=False)
        self._begin_looks(table, looks['scalars'], colors, visible, theme)
        self.pickable = pickable
        physical = checked_flag('pbr', pbr, optional=True)
        self.prop = pv.Property(
            theme=theme,
            color=None if color is None else as_rgb('color', color),
            lighting=lighting,
            ambient=ambient,
            diffuse=diffuse,
            specular=specular,
            specular_power=specular_power,
            metallic=metallic,
            roughness=roughness,
            interpolation='Physically based rendering' if physical else 'Phong',
        )  # not flat: VTK never lights flat points
        self.geometry = self._geometry_in(None)
        self._noun = self.shape.name
        self.binder, self.item_textures = Binder(), ItemTextures()
        self.uniforms: dict = {}
        self._set_bounds(_bounds_of(self.geometry))
        self._hidden = 0
        self._make_layers()
        self._share_opacity()

    update = replaced_items.update

    def __len__(self):
        return len(next(iter(self._arranged.values())))

    def _arranged_from(self, given, nan_rows) -> dict:
        """Return checked positions and sizes by name, a row per item."""
        raise NotImplementedError

    def given(self) -> dict:
        """Return the user's positions and sizes by name."""
        return self._given

    def _arranged_values(self, name):
        return self._arranged[name]

    def _make_layers(self):
        if len(self) > self.room:
            self.room = max(len(self), 2 * self.room)
        self._layers = [Layer(self, mode) for mode in (*DRAW_MODES, BLENDED)]
        self._lead_materials()
        self._occlusion = Occlusion()

    def _materials_of_all(self):
        return [layer.material for layer in self._layers]

    # -- geometry ---------------------------------------------------------------------------------

    def _geometry_in(self, world) -> Geometry:
        """Return the geometry of the items, transformed by a matrix unless it is None."""
        raise NotImplementedError

    @property
    def shape(self) -> Shape:
        """The shader's type of quadric."""
        return self.geometry.shape

    def _bodies(self, indices=slice(None)) -> list:
        return self.geometry.bodies(self.prop, indices, self._colored(indices))

    def _colored(self, indices):
        return None if self._colors is None else self._colors[indices, ..., :3]

    def _as_colors(self, colors, count=None):
        return as_rgba(colors, len(self) if count is None else count)

    def _alphas(self):
        """Return the items' opacities without the material's, shape (n,), or None if all are 1."""
        item_opacity = self._opacity if self._opacity.ndim else None
        alphas = alphas_of(self._colors)
        if alphas is None:
            return item_opacity
        return alphas / 255 if item_opacity is None else item_opacity * alphas / 255

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of the items' bounding spheres."""
        return self.geometry.spheres()

    def item_mesh(self, index) -> pv.PolyData:
        """Return the mesh of an item in world units, for VTK's pickers."""
        bodies = self._bodies([index])
        return joined([(levels[0], matrices[0]) for levels, _, matrices, _ in bodies])

    def _places(self) -> np.ndarray:
        return self.geometry.spheres()[0]

    # -- looks and positions ------------------------------------------------------------------

    opacity = replaced_items.opacity_property()

    def _share_opacity(self):
        self.prop.SetOpacity(1.0 if self._opacity.ndim else float(self._opacity))

    @property
    def blends(self) -> bool:
        """Whether items are translucent and therefore drawn from far to near."""
        varies = self._opacity.ndim and len(self) and self._opacity.min() < 1
        return bool(varies) or blend(self._colors) or self.prop.GetOpacity() < 1

    @property
    def clips(self) -> bool:
        """Whether clipping planes apply."""
        return bool(self.clipping)

    def _switch_clipping(self):
        for layer in (*self._layers, *self._occlusion.layers):
            layer.clip()

    def _become(self, geometry):
        """Switch to a geometry of another shape, or of more items than there is room for."""
        if self.pipeline is not None:
            self.pipeline.make_current()
            super()._take_out(self.pipeline.renderer)
        self.release()
        self.geometry = geometry
        self._make_layers()
        if self.pipeline is not None:
            super()._put_in(self.pipeline.renderer)

    def _moved(self):
        """Apply changed local positions or sizes."""
        geometry = self._geometry_in(None)
        self._set_bounds(_bounds_of(geometry))
        self._put(geometry if self._world is None else None)

    def _put(self, geometry=None):
        geometry = self._geometry_in(self._world) if geometry is None else geometry
        if geometry.shape == self.shape and len(self) <= self.room:
            self.geometry = geometry
        else:
            self._become(geometry)
        self._invalidate()

    def _invalidate(self):
        """Upload positions for the next frame."""
        for name in ('_order', '_blocks'):
            self.__dict__.pop(name, None)
        bounds = _bounds_of(self.geometry)
        for layer in (*self._layers, *self._occlusion.layers):
            layer.bound(bounds)
        self._drop('ibr_items', 'ibr_looks')

    # -- frames -------------------------------------------------------------------------------

    def actors(self) -> list:
        """Return all actors, invisible ones included."""
        return [actor for layer in self._layers for actor in layer.actors]

    def depths(self) -> list:
        """Return the actors that cast shadows: none if translucent."""
        return [] if self.blends else self.drawn()

    def prepare(self, frame):
        """Choose which items are drawn and how."""
        shiny = is_shiny(self.prop)
        for layer in self._layers:
            layer.set_shiny(shiny)
        super().prepare(frame)

    def _choose(self, frame, other_depths):
        eye_frame = with_eye_at_origin(frame)
        self.uniforms = view_uniforms(eye_frame, len(self))
        eye = frame.view_from_world[:3, 3] - eye_frame.view_from_world[:3, 3]
        self.uniforms['ibr_eye'] = tuple(eye.tolist())
        if self.clips:
            self.uniforms |= self.clipping.uniforms(frame)
        (self._show_blended if self.blends else self._show_opaque)(eye_frame, other_depths)

    def _show_opaque(self, frame, _others):
        visible = visible_blocks(self._blocks, frame, self.shape)
        is_hidden = self._occlusion.hidden(self, frame, visible)
        self._hidden = min(int(is_hidden.sum()) * BLOCK, len(self))
        is_giant = visible.modes == DRAW_MODES.index(GIANTS)
        slots = self._slots(visible.entries[is_giant, 3].astype(int))
        residuals = self.geometry.residuals(eye_of(frame), self._order[slots])
        entries = self._entries_of(frame, slots, own_middles=True)
        self._layers[0].show(entries, 1, residuals=residuals)
        for k, layer in enumerate(self._layers[1:], 1):
            layer.show(visible.entries[(visible.modes == k) & ~is_hidden])

    def _show_blended(self, frame, other_depths):
        """Show the items in view from far to near, with other props in between."""
        for layer in self._layers[:-1]:
            layer.show(np.zeros((0, 4)))
        self._hidden = 0
        block_ids, origins = self._blocks.seen(frame)[:2]
        giant_ids = block_ids[giant_blocks(self._blocks, frame, origins, block_ids)]
        slots = self._slots(block_ids)
        depths = depths_of(frame, self.geometry.spheres()[0][self._order[slots]])
        far_to_near = np.argsort(-depths, kind='stable')
        slots, depths = slots[far_to_near], depths[far_to_near]
        entries, residuals = self._entries_of(frame, slots, own_middles=len(giant_ids) > 0), None
        if len(giant_ids):
            residuals, in_giant = np.zeros((len(slots), 4)), np.isin(slots // BLOCK, giant_ids)
            items_in_giant = self._order[slots[in_giant]]
            residuals[in_giant] = self.geometry.residuals(eye_of(frame), items_in_giant)
        cuts = np.searchsorted(-depths, [-d for d in other_depths], side='right').tolist()
        parts = self._layers[-1].show(entries, 1, cuts, residuals)
        self.order = interleaved(frame, self, other_depths, parts)

    def finish(self, frame):
        """Release the texture units."""
        self.binder.unbind()

    def _slots(self, blocks):
        """Return the slots of the items in blocks."""
        slots = (blocks[:, None] * BLOCK + np.arange(BLOCK)).ravel()
        return slots[slots < len(self)]

    def _entries_of(self, frame, slots, own_middles):
        """Return entries of one item each, with the middle of the item or of its block."""
        view = frame.view_from_world
        middles = (
            self.geometry.spheres()[0][self._order[slots]] if own_middles else self._blocks.centers
        )
        origins = middles @ view[:3, :3].T + view[:3, 3]
        return np.column_stack([origins if own_middles else origins[slots // BLOCK], slots])

    # -- the GPU ------------------------------------------------------------------------------

    def _upload(self, frame):
        texels = {'ibr_items': (self._items, ROW, 4), 'ibr_looks': (self._looks, ROW, 4)}
        self.item_textures.upload(frame.window, texels)

    def _repaint(self):
        self._drop('ibr_looks')

    def _drop(self, *names):
        self.item_textures.drop(*names)
        self._touch()

    @cached_property
    def _order(self):
        """Morton order of the items, shape (n,)."""
        return morton_order(self.geometry.spheres()[0])

    @cached_property
    def _blocks(self):
        """Blocks of neighbours that are culled together."""
        middles, reach = self.geometry.spheres()
        return Blocks.of(middles[self._order], reach[self._order], BLOCK)

    def _items(self):
        middles = self.geometry.spheres()[0].copy()
        middles[self._order] -= np.repeat(self._blocks.centers, BLOCK, 0)[: len(self)]
        return self.geometry.rows(middles)[self._order].astype(np.float32).reshape(-1, 4)

    def _looks(self):
        looks = np.zeros((len(self), self.shape.looks, 4), np.uint8)
        alphas = self._alphas()
        looks[..., 3] = _OPAQUE if alphas is None else np.rint(_OPAQUE * alphas)[:, None]
        if self._colors is not None:
            looks[..., :3] = self._colors[..., :3].reshape(len(self), -1, 3)
            looks[looks[..., 3] > 0, 3] += 1 + _OPAQUE
        looks[~self.drawn_items(), :, 3] = 0
        return looks[self._order].reshape(-1, 4)

    def texels(self) -> tuple:
        """Return the order of the items, their blocks, and texels of shapes and of looks."""
        return self._order, self._blocks, self._items(), self._looks()

    def release(self):
        """Free GPU memory; the context is current."""
        self.binder.unbind()
        for layer in self._layers:
            layer.release(self.item_textures.window)
        self._occlusion.release(self.item_textures.window)
        self.item_textures.release()
        self._content_key = None

    def report(self) -> dict:
        """Return GPU memory and counts by draw mode."""
        return {
            'bytes': nbytes_of(self.item_textures, *self._layers, self._occlusion),
            self._noun: len(self),
            **{layer.mode.name: layer.drawn for layer in self._layers},
            'hidden': self._hidden,
        }

    def bake_into(self, scene):
        """Add the items as meshes to a scene without pvibr."""
        indices = np.flatnonzero(self.drawn_items() & (self.geometry.spheres()[1] > 0))
        alphas = self._alphas()
        for levels, largest, matrices, colors in self._bodies(indices):
            is_finite = np.isfinite(matrices).all((1, 2))
            colors = None if colors is None else colors[is_finite]
            if alphas is not None:
                colors = self._with_opacity(colors, alphas[indices[is_finite]])
            scene.copies(self, levels, matrices[is_finite], largest=largest, colors=colors)

    def _with_opacity(self, colors, alphas):
        if colors is None:
            plain = np.rint(255 * np.array(self.prop.GetColor())).astype(np.uint8)
            colors = np.tile(plain, (len(alphas), 1))
        return np.column_stack([colors, np.rint(255 * alphas).astype(np.uint8)])

    # -- picking ------------------------------------------------------------------------------

    def pick(self, x, y) -> Hit | None:
        """Return the nearest item under a pixel."""
        if not self._can_pick():
            return None
        start, direction = pixel_ray(self.pipeline.renderer, x, y)
        middles, radii = self.geometry.spheres()
        offsets = middles - start
        across = offsets - (offsets @ direction)[:, None] * direction
        ray_distances = np.linalg.norm(across, axis=1)
        index = np.flatnonzero(self.drawn_items() & (ray_distances <= radii) & (radii > 0))
        if not len(index):
            return None
        meeting = self.geometry.meet(start, direction, index)
        if self.clips:
            points = start + np.nan_to_num(meeting.distances)[..., None] * direction
            meeting = meeting._replace(hits=meeting.hits & self.clipping.kept(points))
        distances, _, _ = meeting.first()
        k = int(distances.argmin())
        if not np.isfinite(distances[k]):
            return None
        distance = float(distances[k])
        return Hit(int(index[k]), tuple((start + distance * direction).tolist()), distance)


def _bounds_of(geometry) -> tuple[float, ...]:
    middles, extents = geometry.spheres()[0], geometry.extents()
    if not len(middles):
        return (1.0, -1.0) * 3
    low, high = (middles - extents).min(0), (middles + extents).max(0)
    return tuple(np.stack([low, high], 1).ravel().tolist())
