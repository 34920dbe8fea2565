"""Billboards: an image at each point, turned toward the eye, all in one draw."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pyvista as pv

from pvibr.core.errors import ShaderError
from pvibr.core.params import Param
from pvibr.core.signatures import takes
from pvibr.gl import nbytes_of
from pvibr.gl.binder import Binder
from pvibr.maths.blocks import BLOCK
from pvibr.points import replaced_items
from pvibr.points.billboard_cards import CORNERS, BillboardLayout, checked_cutout
from pvibr.points.billboard_images import LiveImage, SheetImages
from pvibr.points.billboard_shader import billboard_feature
from pvibr.points.point_arguments import checked_opacity
from pvibr.points.replaced_items import item_property
from pvibr.textures.projected import is_live
from pvibr.textures.sheet import as_images
from pvibr.things.appearance import TABLE_OPTIONS, alphas_of, blend
from pvibr.things.draw_order import PARTS, interleaved
from pvibr.things.frame import Frame
from pvibr.things.item_set import ItemSet
from pvibr.things.item_textures import ItemTextures
from pvibr.things.picking import Hit, pixel_ray
from pvibr.things.shader_draws import ROW, ShaderDraws

_CHUNK, _WIDE = 65_536, 3072  # billboards per draw; texels, a multiple of 3 and 4
_MIN_PICK_ALPHA = 0.05  # of blended billboards


class Billboards(ItemSet):
    """An image at each of many points, turned toward the eye.

    Parameters
    ----------
    points : array_like, shape (n, 3), dataset or table
        World units.
    image : path, array, pyvista.Texture, pvibr.LiveTexture, or a list of the first three
        Image or images; several are packed into one texture. Arrays are (h, w) or (h, w, c), row 0
        at the top, of uint8, uint16, bool, or float from 0 to 1.
    size : float or array_like, shape (n,), (n, 2) or (1, 2)
        Height, or width and height, of each card or of all; a height alone keeps the image's
        proportions.
    facing : {'spherical', 'cylindrical', 'screen', 'world'}
        Towards the camera; towards it about `axis` only; parallel to the screen; fixed.
    axis : array_like, shape (3,) or (n, 3), optional
        Up direction of the cards; by default z for cylindrical cards, the camera's up for
        spherical ones.
    towards : {'point', 'plane'}
        Face the camera's position, or its image plane.
    orientation : array_like, shape (4,) or (n, 4), optional
        Quaternions (w, x, y, z) of cards with ``facing='world'``, from x right, y up, z front.
    rotation : float or array_like, shape (n,)
        Radians counter-clockwise about the card's normal.
    index : array_like of int, shape (n,), optional
        Image of each card; by default in turn, or the first frame of a flipbook.
    frames : tuple of 2 int, optional
        Columns and rows of a sprite sheet.
    fps : float, optional
        Frame rate of a flipbook, which starts at `index` and loops.
    cutout : float or None
        Alpha threshold above which texels are opaque; None for alpha blending.
    size_unit : {'world', 'pixel'}
        Unit of `size`.
    anchor : {'center', 'bottom', 'top'} or array_like, shape (2,)
        Position of the point on the card, in shares of width and height from the lower left.
    views : int
        Number of consecutive images that show an object from around the axis of cylindrical
        cards, the first from x (from y if the axis is close to x), the others counter-clockwise.
        Each card shows the view nearest to the camera.
    blend_views : bool
        Blend the two nearest views.
    yaw : float or array_like, shape (n,)
        Rotation of the object itself about the axis, in radians.
    colors : array_like, shape (n, 3), optional
        Colours that multiply the image; uint8 or float.
    scalars : array_like, shape (n,), optional
        Values mapped to colours as in ``add_mesh``.
    visible : array_like of bool, shape (n,), optional
        Mask of the items that are drawn.
    opacity : float or array_like, shape (n,)
        Opacity of all, or of each if they are blended.
    lighting : bool
        Apply lighting to the cards.
    pickable : bool
        Allow picking.
    name : str, optional
        Name in the plotter and in reports.
    theme : pyvista.plotting.themes.Theme, optional
        Defaults of the colour map.
    nan : {'raise', 'hide'}
        Refuse items with NaN among their positions, sizes and turns, or hide them. NaN scalars
        have ``nan_color`` and ``nan_opacity``.
    **table
        Colour map of the scalars, as in ``add_mesh``.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.
    FileNotFoundError
        If an image does not exist.

    Notes
    -----
    Cut-outs are opaque and depth-tested. Blended billboards are sorted from far to near among
    other translucent props by the centres of these, or per pixel with depth peeling. All cast
    shadows, turned to the light, in the size that the camera sees; blended ones where texels are
    at least half opaque.

    Examples
    --------
    >>> import numpy as np
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> dots = pl.ibr.add(pvibr.Billboards([[0, 0, 0], [1, 0, 0]], np.ones((8, 8)), size=0.5))
    >>> len(dots), dots.facing
    (2, 'spherical')
    >>> pl.close()
    """

    web = 'baked', 'quads, turned to the current camera'
    fps = Param(None, 'Frame rate of a flipbook.', range='(-inf, inf)', unit='1/s', kind=float)
    FOR_USERS: tuple[str, ...] = ('update',)
    _noun = 'points'
    cutout: float | None
    _arranged: BillboardLayout | None = None
    _room = 0  # items for which the draws have room
    _draws: Any = None
    _shadow_draws: Any = None

    @takes(table=TABLE_OPTIONS)
    def __init__(
        self,
        points,
        image,
        *,
        size=1.0,
        facing='spherical',
        axis=None,
        towards='point',
        orientation=None,
        rotation=0.0,
        index=None,
        frames=None,
        fps=None,
        cutout=0.5,
        size_unit='world',
        anchor='center',
        views=1,
        blend_views=False,
        yaw=0.0,
        colors=None,
        scalars=None,
        visible=None,
        opacity=1.0,
        lighting=False,
        pickable=True,
        name=None,
        theme=None,
        nan='raise',
        **table,
    ):
        super().__init__(fps=fps)
        self.name = name
        self.cutout = checked_cutout(cutout)
        self.is_cut_out = self.cutout is not None
        self._images: LiveImage | SheetImages
        if is_live(image):
            self._images = LiveImage(image)
        else:
            self._images = SheetImages(as_images(image, frames), cutout)
        if index is None and fps is not None:
            index = 0
        self._settings = {'facing': facing, 'towards': towards, 'size_unit': size_unit}
        self._settings |= {'anchor': anchor, 'views': views, 'blend_views': blend_views}
        given = {'points': points, 'size': size, 'axis': axis, 'orientation': orientation}
        given |= {'rotation': rotation, 'index': index, 'yaw': yaw}
        looks = replaced_items.adopt(self, nan, given, {'scalars': scalars})
        self._opacity = checked_opacity(opacity, len(self), self.is_cut_out)
        self._begin_looks(table, looks['scalars'], colors, visible, theme)
        self.pickable = pickable
        self._begin(lighting)

    def _begin(self, lighting):
        self._binder, self._textures = Binder(), ItemTextures()
        self._uniforms: dict = {}
        self._drawn_count = 0
        self.prop = pv.Property(color='white', lighting=bool(lighting), interpolation='Gouraud')
        self._share_opacity()
        self._fit()

    def _new_draws(self, draws, blends) -> ShaderDraws:
        feature = billboard_feature(bool(self.clipping))
        look = {'prop': self.prop, 'feature': feature, 'translucent': blends}
        return ShaderDraws(draws=draws, chunk=self._chunk, binder=self._binder, **look)

    def _materials_of_all(self):
        return [draws.material for draws in self._all_draws()]

    def _switch_clipping(self):
        for draws in self._all_draws():
            draws.set_feature(billboard_feature(bool(self.clipping)))

    def _all_draws(self) -> list:
        return [draws for draws in (self._draws, self._shadow_draws) if draws is not None]

    def _fit(self):
        """Adopt the bounds of local positions and sizes, then the transform."""
        self._set_bounds(self.layout.bounds)
        if self._world is not None:
            self.layout.place(self._world)
        self._fit_draws()

    def _moved(self):
        """Apply changed local positions or sizes."""
        if len(self) > self._room:
            self._remake_draws()
        self._fit()
        self._drop('ibr_points', 'ibr_looks')

    def _remake_draws(self):
        """Make draws with room for all items, and those that blend if they do."""
        pipeline = self.pipeline
        if pipeline is not None:
            pipeline.make_current()
            self._take_out(pipeline.renderer)
        self.release()
        if len(self) > self._room:
            self._room = max(len(self), 2 * self._room)
        slot_count = max(-(-self._room // BLOCK), 1) * BLOCK
        self._chunk, draw_count = min(slot_count, _CHUNK), -(-slot_count // _CHUNK)
        # Blended billboards have other draws for shadows, of texels at least half opaque.
        self._draws = self._new_draws(draw_count + PARTS * self.blends, self.blends)
        self._shadow_draws = self._new_draws(draw_count, False) if self.blends else None
        self._lead_materials()
        self._fit_draws()
        if pipeline is not None:
            self._put_in(pipeline.renderer)

    def _share_opacity(self):
        self.prop.SetOpacity(1.0 if np.ndim(self._opacity) else float(self._opacity))
        if self._draws is None or self.blends != (self._shadow_draws is not None):
            self._remake_draws()

    def _fit_draws(self):
        for draws in self._all_draws():
            draws.place_cards(self.layout.reach_bounds())

    def _check_linear(self, linear):
        super()._check_linear(linear)
        if self.facing == 'world':
            self._check_similar(linear, "cards with facing='world' stay rectangles")
        if np.linalg.det(linear) < 0:
            raise ValueError(f'scale or user_matrix of {self.name} must not mirror images')

    def _put(self):
        """Upload positions for the next frame."""
        self.layout.place(self._world)
        self._fit_draws()
        self._drop('ibr_points', 'ibr_looks')

    # -- positions and looks ------------------------------------------------------------------

    def __len__(self):
        return len(self.layout)

    update = replaced_items.update

    @property
    def layout(self) -> BillboardLayout:
        """Where the cards are, and how they are turned."""
        return cast('BillboardLayout', self._arranged)

    def _arranged_from(self, given, nan_rows) -> BillboardLayout:
        """Return the checked layout of the cards."""
        neighbours = None if self._arranged is None else self._arranged.neighbours
        kept = {'images': self._images.sizes, 'nan_rows': nan_rows, 'neighbours': neighbours}
        return BillboardLayout(**given, **kept, **self._settings)

    def _arranged_values(self, name):
        return getattr(self.layout, 'own_points' if name == 'points' else name)

    def _places(self) -> np.ndarray:
        return self.layout.points

    def item_spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points, shape (n, 3), and the reach of their cards."""
        indices = np.arange(len(self))
        sizes = self.layout.placed(Frame.of(self.pipeline.renderer), indices)[1]
        return self.layout.points, np.hypot(*np.moveaxis(sizes, 1, 0))

    def item_mesh(self, index) -> pv.PolyData:
        """Return the whole card of an item in world space, for VTK's pickers."""
        corners = self.layout.corners(Frame.of(self.pipeline.renderer), np.array([index]))
        return pv.PolyData(corners[0], faces=[4, 0, 1, 2, 3])

    @property
    def facing(self) -> str:
        """What the cards face."""
        return self.layout.facing

    @property
    def blends(self) -> bool:
        """Whether images are translucent and therefore drawn from far to near."""
        return self.cutout is None or self.prop.GetOpacity() < 1

    points = item_property('points', 'Positions, shape (n, 3), in its own space.')
    size = item_property(
        'size', 'Height, or width and height, of all cards or each, in world units or pixels.'
    )
    rotation = item_property('rotation', 'Rotation in the plane of the card, shape (n,), radians.')
    index = item_property('index', "Index of each card's image, shape (n,).")
    opacity = replaced_items.opacity_property()

    def _mapped(self, table, scalars):
        colors = super()._mapped(table, scalars)
        if self.is_cut_out and blend(colors):
            alpha = table.nan_opacity / 255
            raise ValueError(
                f'nan_opacity must be 0 or 1 for cut-outs, got {alpha:g}: use cutout=None'
            )
        return colors

    # -- frames -------------------------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a value that changes with the content, camera excluded."""
        return *super().content_key(), self._step(), self._images.draws, self.layout.size_key()

    def _step(self) -> int:
        """Return the number of images that a flipbook has advanced."""
        if not self.fps or self.pipeline is None:
            return 0
        return int(np.floor(self.pipeline.time * self.fps + 1e-9)) % self.layout.n_images

    def actors(self) -> list:
        """Return all actors, invisible ones included."""
        return [actor for draws in self._all_draws() for actor in draws.actors]

    def drawn(self) -> list:
        """Return the visible actors, without those of shadow maps."""
        return [a for a in self._draws.actors if a.GetVisibility()]

    def depths(self) -> list:
        """Return the actors that cast shadows."""
        return [a for a in (self._shadow_draws or self._draws).actors if a.GetVisibility()]

    @property
    def cast_bounds(self) -> np.ndarray:
        """World bounds of the shadow casters, shape (6,)."""
        return self.layout.cast_bounds()

    def needed(self, frame) -> bool | str:
        """Return True if there is anything to draw, else the reason why not."""
        return (self.visibility and self._images.missing) or super().needed(frame)

    def prepare(self, frame):
        """Choose which items are drawn and in which order."""
        failure = next((draws.failure for draws in self._all_draws() if draws.failure), None)
        if failure:
            raise ShaderError(failure)
        super().prepare(frame)

    def _choice_key(self, frame) -> tuple:
        return *super()._choice_key(frame), self._step()

    def _choose(self, frame, other_depths):
        active_draws, idle_draws, least_opacity = self._draws, self._shadow_draws, 0.5 / 255
        if frame.casting and idle_draws is not None:
            active_draws, idle_draws = idle_draws, active_draws
            least_opacity = 0.5 / max(self.prop.GetOpacity(), 1e-6)
        sort = self.blends and active_draws is self._draws
        entries, unit, part_cuts = self.layout.entries_in_view(frame, other_depths, sort=sort)
        self._drawn_count = min(len(entries) * unit, len(self))
        active_draws.uniforms = self._uniforms = {
            **self._uniforms,
            **self.layout.view_uniforms(frame),
            **(self.clipping.uniforms(frame) if self.clipping else {}),
            'ibr_unit': unit,
            'ibr_step': self._step(),
            'ibr_eye_from_world': frame.view_from_world[:3, :3],
            'ibr_clip_from_eye': frame.clip_from_view,
            'ibr_parallel': int(frame.parallel),
            'ibr_least_opacity': least_opacity,
        }
        if idle_draws is not None:
            idle_draws.show_spans(())
        active_draws.upload(self._textures.window, np.asarray(entries, np.float32).reshape(-1, 1))
        parts = active_draws.show_parts(part_cuts, unit)
        if sort:
            self.order = interleaved(frame, self, other_depths, parts)

    def finish(self, frame):
        """Release the texture units."""
        self._binder.unbind()

    # -- the GPU ------------------------------------------------------------------------------

    def _upload(self, frame):
        if self._textures.window is None:
            self._images.upload(frame.window)
        texels = {
            'ibr_points': (self.layout.texels, _WIDE, 4),
            'ibr_looks': (self._looks, ROW, 4),
            'ibr_rects': (self._images.rects, ROW, 4),
        }
        if 'ibr_points' in self._textures.upload(frame.window, texels):
            self._uniforms = self._uniforms | self.layout.uniforms()
        self._uniforms = {
            **self._uniforms,
            **self._images.uniforms(),
            'ibr_cutout': float(self.cutout or 0.0),
            'ibr_padded': int(not isinstance(self._images, LiveImage)),
        }
        for draws in self._all_draws():
            draws.textures = {**self._textures.by_name, 'ibr_sheet': self._images.texture}
            draws.uniforms = self._uniforms

    def _drop(self, *names):
        self._textures.drop(*names)
        self._touch()

    def _repaint(self):
        self._drop('ibr_looks')

    def _looks(self):
        looks = self._tints(1.0)
        looks[~self.drawn_items(), 3] = 0
        return looks[self.layout.order]

    def release(self):
        """Free GPU memory; the context is current."""
        for draws in self._all_draws():
            draws.release(self._textures.window)
        self._textures.release()
        self._images.release()
        self._content_key = None

    def report(self) -> dict:
        """Return GPU memory, counts and the size of the texture."""
        return {
            'bytes': nbytes_of(self._textures, *self._all_draws(), self._images),
            'billboards': len(self),
            'drawn': self._drawn_count,
            'images': self.layout.n_images,
            **self._images.report(),
        }

    def bake_into(self, scene):
        """Add the cards as quads, turned to the camera, to a scene without pvibr."""
        indices = np.flatnonzero(self.drawn_items())
        frame = scene.frame
        corners = self.layout.corners(frame, indices)
        image, rects = self._images.whole()
        low, high = rects[self._shown_images(frame, indices)].reshape(-1, 2, 1, 2).swapaxes(0, 1)
        coordinates = (low + CORNERS * (high - low)) / image.shape[1::-1]
        cutout, lighting = None if self.blends else self.cutout, bool(self.prop.GetLighting())
        colors = self._tints(self.prop.GetOpacity())[indices]
        look = {'cutout': cutout, 'colors': colors, 'lighting': lighting}
        scene.quads(self, corners, coordinates, image, **look)

    def _shown_images(self, frame, indices) -> np.ndarray:
        """Return the index of the image that each of some cards shows."""
        layout = self.layout
        image_ids = (layout.index[indices] + self._step()) % layout.n_images
        views = [layout.view_of(frame, i) for i in indices] if layout.views > 1 else 0
        return image_ids * layout.views + views

    def _tints(self, opacity):
        looks = np.empty((len(self), 4), np.uint8)
        looks[:, :3] = 255 if self._colors is None else self._colors[:, :3]
        opacity = np.asarray(self._opacity if np.ndim(self._opacity) else opacity)
        alphas = alphas_of(self._colors)
        looks[:, 3] = np.rint(opacity * (255 if alphas is None else alphas))
        return looks

    # -- picking ------------------------------------------------------------------------------

    def pick(self, x, y) -> Hit | None:
        """Return the nearest billboard whose image is not transparent under a pixel."""
        if not self._can_pick():
            return None
        renderer = self.pipeline.renderer
        start, direction = pixel_ray(renderer, x, y)
        is_drawn, frame = self.drawn_items(), Frame.of(renderer)
        for i, distance, uv in self.layout.hits(frame, start, direction):
            point = start + distance * direction
            if not (is_drawn[i] and self.clipping.kept(point)):
                continue
            (number,) = self._shown_images(frame, [i])
            if self._images.alpha(number, uv) >= (self.cutout or _MIN_PICK_ALPHA):
                return Hit(int(i), tuple(point.tolist()), float(distance))
        return None
