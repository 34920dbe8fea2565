"""Billboards: an image at each point, turned toward the eye, all in one draw."""

from __future__ import annotations

import weakref
from itertools import pairwise
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.billboards.cards import BillboardLayout, as_anchor, checked_cutout, checked_opacity
from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.core.frame import Frame
from pvibr.core.params import Param
from pvibr.gl import Texture, set_uniforms, shader_source
from pvibr.gl.binder import Binder
from pvibr.gl.feature import Feature, sections
from pvibr.images.projected import is_live
from pvibr.images.sheet import Sheet, as_images
from pvibr.instances.cards import card_mesh, pack
from pvibr.scene.painted import Painted
from pvibr.scene.picking import Hit, pixel_ray
from pvibr.scene.thing import Thing, set_bounds
from pvibr.scene.thing import anchor as new_anchor
from pvibr.scene.translucent import MOST, DepthSortedDraws

_CHUNK = 65_536  # billboards of one draw
_ROW, _WIDE = 1024, 3072  # texels; the second is a multiple of 3 and of 4
_HIT = 0.05  # alpha from which a blended billboard can be picked


class Billboards(Painted, Thing):
    """An image at each of many points, turned toward the eye.

    Parameters
    ----------
    points : array_like, shape (n, 3), or dataset
        World units.
    image : path, array, pyvista.Texture, pvibr.LiveTexture, or a list of the first three
        What is shown; several are packed into one texture. Arrays are (h, w) or (h, w, c), row 0
        at the top, uint8, uint16, bool or float from 0 to 1.
    size : float or array_like, shape (n,), (n, 2) or (1, 2)
        Height, or width and height, of each or of all; a height keeps the image's proportions.
    facing : {'spherical', 'cylindrical', 'screen', 'world'}
        Turned to the eye; only about `axis`; parallel to the screen; not at all.
    axis : array_like, shape (3,) or (n, 3), optional
        What is up on the cards: z for cylindrical ones, the camera's up for spherical ones unless
        given.
    towards : {'point', 'plane'}
        Whether cards turn to the eye's place, or all alike to its plane.
    orientation : array_like, shape (4,) or (n, 4), optional
        Quaternions (w, x, y, z) of cards that face the world: from x right, y up, z to the front.
    rotation : float or array_like, shape (n,)
        Radians counter-clockwise about the card's normal.
    index : array_like of int, shape (n,), optional
        Which of several images each shows; by turns by default, or the first of a flipbook.
    frames : tuple of 2 int, optional
        Columns and rows of images in the image.
    fps : float, optional
        Images a second of a flipbook: each goes on from its `index` and round.
    cutout : float or None
        Alpha from which a texel is drawn, opaque; None blends.
    size_unit : {'world', 'pixel'}
        What `size` is in.
    anchor : {'center', 'bottom', 'top'} or array_like, shape (2,)
        What of the card is at the point: shares of width and height from the lower left.
    views : int
        How many of the images, in turn, are views of one thing about the axis of cylindrical
        cards: the first from x (from y where the axis is close to x), the others
        counter-clockwise. Each card shows the one from the eye's side.
    blend_views : bool
        Mix the two views on both sides of the eye, not the nearest alone.
    yaw : float or array_like, shape (n,)
        Radians by which the thing itself is turned about the axis.
    colors : array_like, shape (n, 3), optional
        Multiply the image; uint8 or float.
    scalars : array_like, shape (n,), optional
        Mapped to colours as in ``add_mesh``.
    visible : array_like of bool, shape (n,), optional
        Which are drawn.
    opacity : float or array_like, shape (n,)
        Of each it is for those that blend only.
    lighting : bool
        Whether lights fall on the cards.
    pickable : bool
        Whether :meth:`pick` finds them.
    name : str, optional
        What the plotter and reports call it.
    **table
        ``cmap``, ``clim``, ``n_colors``, ``nan_color``, ``below_color``, ``above_color``,
        ``log_scale`` as in ``add_mesh``.

    Raises
    ------
    TypeError, ValueError
        Where an argument is not allowed.
    FileNotFoundError
        Where there is no such image.

    Notes
    -----
    Cut-outs are opaque to VTK and meet other props by depth. Those that blend are drawn from far
    to near, with other translucent props in between by the middle of these, or pixel by pixel
    where depth peeling is on. All cast shadows, each turned to the light, as large as the camera
    sees them; of those that blend, what is at least half opaque does.

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

    web = 'baked', 'quads, turned to the eye as it is now'
    _title = 'Billboards'

    visibility = Param(True, 'Whether they are drawn at all.')
    fps = Param(
        None, 'Images a second of a flipbook.', range='(-inf, inf)', unit='1/s', kind=float
    )
    _changes = 0

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
        **table,
    ):
        super().__init__(fps=fps)
        self.name = name
        self.cutout = checked_cutout(cutout)
        self._live: Any = image if is_live(image) else None
        self._sheet: Any = None
        if self._live is None:
            self._sheet = Sheet(as_images(image, frames), cutout)
        if index is None and fps is not None:
            index = 0
        self.field = BillboardLayout(
            points,
            self._image_sizes(),
            size,
            facing=facing,
            axis=axis,
            towards=towards,
            orientation=orientation,
            rotation=rotation,
            index=index,
            size_unit=size_unit,
            anchor=as_anchor(anchor),
            views=views,
            blend_views=blend_views,
            yaw=yaw,
        )
        self._opacity = checked_opacity(opacity, len(self.field), self.cutout is not None)
        self._begin_looks(table, scalars, colors, visible)
        self.pickable = pickable
        self._begin(lighting)

    def _image_sizes(self):
        return np.array([self._live.size]) if self._sheet is None else self._sheet.sizes

    def _begin(self, lighting):
        self._anchor = new_anchor()
        self._binder, self._sorted_draws = Binder(), DepthSortedDraws()
        self._textures: dict[str, Texture] = {}
        self._uniforms: dict = {}
        self._window: Any = None
        self._content_key: tuple | None = None
        self._stale: set = set()
        self._landed, self._failure = False, ''
        self._drawn_count = self._skipped = 0
        self.property = prop = _vtk.vtkProperty()
        prop.SetLighting(bool(lighting))
        prop.SetOpacity(float(self._opacity) if np.ndim(self._opacity) == 0 else 1.0)
        self._feature = _feature()
        self._mapper = _vtk.vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self._mapper.AddObserver('UpdateShaderEvent', self._updater())
        draws = -(-max(len(self), 1) // _CHUNK)
        # What blends, and beside it, for lights, what of it is at least half opaque.
        self._draws = [self._actor(self.blends) for _ in range(draws + MOST * self.blends)]
        self._dense = [self._actor(False) for _ in range(draws)] if self.blends else []
        self._set_bounds()

    def _actor(self, blends):
        actor = pv.Actor()
        actor.SetMapper(self._mapper)
        actor.SetProperty(self.property)
        (actor.ForceTranslucentOn if blends else actor.ForceOpaqueOn)()
        actor.VisibilityOff()
        actor.PickableOff()
        actor.UseBoundsOff()
        self._feature.attach(actor)
        return actor

    def _set_bounds(self):
        set_bounds(self._anchor, self.field.bounds)
        self._mapper.SetInputData(card_mesh(min(len(self), _CHUNK), 4, self.field.reach_bounds()))

    # -- what they are ------------------------------------------------------------------------

    def __len__(self):
        return len(self.field)

    @property
    def facing(self) -> str:
        """What the cards are turned to."""
        return self.field.facing

    @property
    def blends(self) -> bool:
        """Whether what is behind shines through, so that they are drawn from far to near."""
        return self.cutout is None or self.property.GetOpacity() < 1

    @property
    def points(self) -> np.ndarray:
        """Where they are, shape (n, 3), world units."""
        return self.field.points

    @points.setter
    def points(self, points):
        self.field.move(points)
        self._set_bounds()
        self._drop('ibr_points', 'ibr_looks')

    @property
    def size(self) -> np.ndarray:
        """Height, or width and height, of all or of each, world units or pixels."""
        return self.field.given_size

    @size.setter
    def size(self, size):
        self.field.resize(size)
        self._set_bounds()
        self._drop('ibr_points', 'ibr_looks')

    @property
    def rotation(self) -> np.ndarray:
        """By how much each is turned in its plane, shape (n,), radians."""
        return self.field.rotation

    @rotation.setter
    def rotation(self, rotation):
        self.field.rotate(rotation)
        self._drop('ibr_points')

    @property
    def index(self) -> np.ndarray:
        """Which image each shows, shape (n,)."""
        return self.field.index

    @index.setter
    def index(self, index):
        self.field.set_index(index)
        self._drop('ibr_points')

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds: x, y and z, low and high; of none (1, -1, 1, -1, 1, -1)."""
        return tuple(float(v) for v in self.field.bounds)

    # -- the life of an effect ----------------------------------------------------------------

    def _take_out(self, renderer):
        self._hide()
        super()._take_out(renderer)

    def content_key(self) -> tuple:
        """Return what changes whenever what is drawn does, the camera left out."""
        shown = self.visibility and bool(self._anchor.GetVisibility())
        draws = self._live.draws if self._live is not None else 0
        sizes = self.field.seen_as()
        return self._changes, self._revision, shown, self._step(), draws, sizes

    def _step(self) -> int:
        """Return how many images a flipbook has gone on."""
        if not self.fps or self.pipeline is None:
            return 0
        return int(np.floor(self.pipeline.time * self.fps + 1e-9)) % self.field.n_images

    def actors(self) -> list:
        """Return the actors that draw them, those that are not visible now too."""
        return self._draws + self._dense

    def drawn(self) -> list:
        """Return the actors that `prepare` chose; of those that blend none for a light."""
        return [a for a in self._draws if a.GetVisibility()]

    def depths(self) -> list:
        """Return the actors that cast shadows."""
        return [a for a in self._dense or self._draws if a.GetVisibility()]

    @property
    def cast_bounds(self) -> np.ndarray:
        """World bounds of what throws shadows, shape (6,)."""
        return self.field.cast_bounds()

    #: Frames that are drawn to pick need them too.
    picks = True

    def needed(self, frame) -> bool | str:
        """Tell whether there is anything to draw."""
        if not self.visibility or not self._anchor.GetVisibility():
            return 'not visible'
        if self._live is not None and self._live.shown is None:
            return 'its live texture is in no subplot, or not drawn yet: add it'
        return bool(len(self)) or 'no points'

    def deactivate(self):
        """Draw nothing: frames are drawn without them now."""
        self._hide()

    def _hide(self):
        for actor in self.actors():
            actor.VisibilityOff()
        self._content_key = None

    def prepare(self, frame):
        """Choose what is drawn, in which order."""
        if self._failure:
            raise ShaderError(self._failure)
        self._upload(frame.window)
        props = frame.renderer.GetViewProps()
        camera = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        content_key: tuple = (*camera, frame.casting, self._changes, self._step(), self._revision)
        others = []
        if self.blends and not frame.casting:
            others = self._sorted_draws.others(frame, self.actors())
            content_key += (self._sorted_draws.key(others), props.GetMTime())
        if content_key != self._content_key:
            self._choose(frame, others)
            self._content_key = (*content_key[:-1], props.GetMTime()) if others else content_key

    def _choose(self, frame, others):
        dense = self._dense if frame.casting else []
        sort = self.blends and not dense
        entries, unit, cuts = self.field.chosen(frame, [d for d, _ in others], sort=sort)
        self._drawn_count = min(len(entries) * unit, len(self))
        if len(entries):
            table = np.zeros((len(entries), 1), np.float32)
            table[:, 0] = entries
            self._textures.setdefault('ibr_order', Texture(self._window))
            self._textures['ibr_order'].upload(pack(table, _ROW, 1))
        self._uniforms |= self.field.view_uniforms(frame) | {
            'ibr_unit': unit,
            'ibr_step': self._step(),
            'ibr_eye_from_world': frame.view_from_world[:3, :3],
            'ibr_clip_from_eye': frame.clip_from_view,
            'ibr_parallel': int(frame.parallel),
            'ibr_least': 0.5 / max(self.property.GetOpacity(), 1e-6) if dense else 0.5 / 255,
        }
        parts = [_spans(first, end, unit) for first, end in pairwise(cuts)]
        spans = [span for part in parts for span in part]
        for actor in self._draws if dense else self._dense:
            actor.VisibilityOff()
        for i, actor in enumerate(dense or self._draws):
            actor.SetVisibility(i < len(spans))
            if i < len(spans):
                uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
                uniforms.SetUniformi('ibr_first', spans[i][0])
                uniforms.SetUniformi('ibr_end', spans[i][1])
        if others:
            free = iter(self._draws)
            groups = [[next(free) for _ in part] for part in parts]
            self._sorted_draws.arrange(frame.renderer, groups, [actor for _, actor in others])

    def finish(self, frame):
        """Give the texture units back."""
        self._binder.unbind()
        self._sorted_draws.finish(frame.renderer)

    # -- the GPU ------------------------------------------------------------------------------

    def _repaint(self):
        self._drop('ibr_looks')

    def _drop(self, *names):
        """Have textures made anew for the next frame."""
        self._stale |= set(names)
        self._content_key = None
        self._changes += 1

    def _upload(self, window):
        if self._window is None:
            self._window = window
            self._stale = {'ibr_points', 'ibr_looks', 'ibr_rects'}
        made, self._stale = self._stale, set()
        if 'ibr_rects' in made and self._sheet is not None:
            self._textures['ibr_sheet'], self._skipped = self._sheet.upload(window)
        arrays = {
            'ibr_points': (self._rows, _WIDE, 4),
            'ibr_looks': (self._looks, _ROW, 4),
            'ibr_rects': (self._rects, _ROW, 4),
        }
        for name in made:
            make, width, channels = arrays[name]
            self._textures.setdefault(name, Texture(window)).upload(pack(make(), width, channels))
        if 'ibr_points' in made:
            self._uniforms |= self.field.uniforms()
        self._uniforms |= self._sheet_uniforms()

    def _rows(self):
        return self.field.rows()

    def _rects(self):
        if self._sheet is None:
            return np.array([[0, 0, *self._live.size]], np.float32)
        return self._sheet.rects * np.float32(0.5**self._skipped)

    def _sheet_uniforms(self):
        live = self._live is not None
        levels = np.floor(np.log2(max(self._live.size))) if live else len(self._sheet.levels) - 1
        return {
            'ibr_smallest': float(levels - self._skipped),
            'ibr_cutout': float(self.cutout or 0.0),
            'ibr_straight': int(live),
        }

    def _looks(self):
        looks = np.full((len(self), 4), 255, np.uint8)
        if self._colors is not None:
            looks[:, :3] = self._colors
        if np.ndim(self._opacity):
            looks[:, 3] = np.rint(255 * self._opacity)
        looks[~self.visible, 3] = 0
        return looks[self.field.order]

    def _updater(self):
        # The mapper keeps the function, which must not keep the mapper: no cycle through C++.
        owner = weakref.ref(self)

        @_vtk.calldata_type(_vtk.VTK_OBJECT)
        def update(_mapper, _event, program):
            alive = owner()
            if alive is not None:
                alive._update(program)

        return update

    def _update(self, program):
        textures = dict(self._textures)
        if self._live is not None:
            textures['ibr_sheet'] = self._live.shown
        set_uniforms(program, self._binder.bind(self, textures))
        set_uniforms(program, self._uniforms)
        if not self._landed:
            self._landed = True
            if not self._feature.landed(program):
                self._failure = 'the shader text of the billboards did not land'

    def release(self):
        """Free what they hold on the GPU; the context is current."""
        self._binder.unbind()
        if self._window is not None:
            self._mapper.ReleaseGraphicsResources(self._window)
            for actor in self.actors():
                actor.ReleaseGraphicsResources(self._window)
        for texture in self._textures.values():
            texture.release()
        self._textures, self._window, self._content_key = {}, None, None

    def report(self) -> dict:
        """Return bytes, how many are drawn, and the texture that holds the images."""
        out: dict = {
            'bytes': sum(t.nbytes for t in self._textures.values()),
            'billboards': len(self),
            'drawn': self._drawn_count,
            'images': self.field.n_images,
        }
        if self._sheet is not None:
            height, width = self._sheet.levels[self._skipped].shape[:2]
            out['texture'] = f'{width} x {height}'
        return out

    def bake_into(self, scene):
        """Hand them to a scene without pvibr, as they are turned to the eye now."""
        rows = np.flatnonzero(self.visible)
        field, frame = self.field, scene.frame
        axes, sizes = field.placed(frame, rows)
        right, up, _ = np.moveaxis(axes, 2, 0)
        shares = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        off = (shares - field.anchor) * sizes[:, None]
        corners = field.points[rows, None] + off[..., :1] * right[:, None]
        corners = corners + off[..., 1:] * up[:, None]
        image, rects = self._picture()
        height, width = image.shape[:2]
        rects = rects[self._shown_images(frame, rows)].reshape(-1, 2, 2)
        places = rects[:, :1] + shares * (rects[:, 1:] - rects[:, :1])
        scene.quads(
            self,
            corners,
            places / [width, height],
            image,
            colors=self._tints()[rows],
            lighting=bool(self.property.GetLighting()),
            cutout=None if self.blends else self.cutout,
        )

    def _picture(self):
        """Return all images as one, row 0 at the top, and the places of each, from below."""
        if self._sheet is None:
            return self._live.image(), np.array([[0, 0, *self._live.size]], float)
        image = self._sheet.levels[0][::-1].astype(float)
        image[..., :3] *= 255 / np.maximum(image[..., 3:], 1)
        return np.rint(np.minimum(image, 255)).astype(np.uint8), self._sheet.rects

    def _shown_images(self, frame, rows) -> np.ndarray:
        """Return the number of the image that some show."""
        if self._sheet is None:
            return np.zeros(len(rows), int)
        turned = (self.field.index[rows] + self._step()) % self.field.n_images
        views = [self.field.view_of(frame, i) for i in rows] if self.field.views > 1 else 0
        return turned * self.field.views + views

    def _tints(self):
        looks = np.full((len(self), 4), 255, np.uint8)
        if self._colors is not None:
            looks[:, :3] = self._colors
        opacity = self._opacity if np.ndim(self._opacity) else self.property.GetOpacity()
        looks[:, 3] = np.rint(255 * np.asarray(opacity))
        return looks

    # -- picking ------------------------------------------------------------------------------

    def pick(self, x, y) -> Hit | None:
        """Return the nearest billboard under a pixel, where its image is not transparent.

        Parameters
        ----------
        x, y : float
            Pixels from the lower left corner of the window.

        Returns
        -------
        pvibr.scene.picking.Hit or None
            ``index`` of the billboard and ``point`` on its card, world units.
        """
        if not self.pickable or self.pipeline is None or not self.visibility or not len(self):
            return None
        renderer = self.pipeline.renderer
        start, direction = pixel_ray(renderer, x, y)
        shown, frame = self.visible, Frame.of(renderer)
        for i, distance, uv in self.field.met(frame, start, direction):
            if shown[i] and self._alpha(frame, i, uv) >= (self.cutout or _HIT):
                return Hit(int(i), tuple((start + distance * direction).tolist()), float(distance))
        return None

    def _alpha(self, frame, i, uv) -> float:
        """Return the opacity of a billboard's image at a place, 0 to 1 from the lower left."""
        if self._sheet is None:
            picture = self._live.image()[::-1]
            left, bottom, (width, height) = 0, 0, self._live.size
        else:
            picture = self._sheet.levels[0]
            k = (self.field.index[i] + self._step()) % self.field.n_images
            k = k * self.field.views + self.field.view_of(frame, i)
            left, bottom, right, top = self._sheet.rects[k].astype(int)
            width, height = right - left, top - bottom
        x = left + min(int(uv[0] * width), width - 1)
        y = bottom + min(int(uv[1] * height), height - 1)
        return float(picture[y, x, 3]) / 255


def _feature() -> Feature:
    part = sections(shader_source(__file__))
    vertex = {
        'VTK::PositionVC::Dec': part['vertex.declare'],
        'VTK::PositionVC::Impl': part['vertex.position'],
    }
    fragment = {
        'VTK::PositionVC::Dec': part['fragment.declare'],
        'VTK::PositionVC::Impl': part['fragment.sample'],
        'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
        'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
    }
    return Feature('billboards', vertex, fragment)


def _spans(first, end, unit):
    """Return the first slot and the end entry of each draw of some entries."""
    step = _CHUNK // unit
    return [(a * unit, min(a + step, end)) for a in range(first, end, step)]
