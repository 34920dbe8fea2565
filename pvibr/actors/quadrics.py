"""Spheres by the million: cards on which rays from the eye meet them exactly."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from pvibr import _vtk
from pvibr.actors.anchor import anchor as new_anchor
from pvibr.actors.anchor import set_bounds
from pvibr.actors.billboard_cards import as_points
from pvibr.actors.cards import BLOCK, DULL, PBR, Binder, card_mesh, pack
from pvibr.actors.looks import COLORED, merge
from pvibr.actors.painted import Painted
from pvibr.actors.picking import Hit, pixel_ray
from pvibr.effect import Effect
from pvibr.errors import ShaderError
from pvibr.gl import Texture, set_uniforms, shader_source, uniform_matrix
from pvibr.gl.feature import Feature, sections
from pvibr.maths.blocks import Blocks, frustum_planes, morton_order
from pvibr.params import Param

_ROW = 1024  # texels of a row
_VIEWPORT, _PROGRAM_POINT_SIZE = 0x0BA2, 0x8642  # GL enums
_LARGEST_POINT = 60.0  # px: every driver draws point sprites so large


@dataclass(frozen=True)
class Way:
    """How the spheres of a block are drawn.

    Attributes
    ----------
    name : str
        For reports and marks in shaders.
    corners : int
        Vertices of a card: 1 is a point sprite, cheaper, but gone with its centre.
    chunk : int
        Cards of one draw.
    dots : bool
        Each a pixel and no larger, as deep as its centre.
    """

    name: str
    corners: int
    chunk: int
    dots: bool = False

    def feature(self) -> Feature:
        """Return the shader text by VTK's tags."""
        part = sections(shader_source(__file__))
        values = {'CORNERS': self.corners, 'DOTS': int(self.dots), 'BLOCK': BLOCK}
        defines = ''.join(f'#define {name} {value}\n' for name, value in values.items())
        vertex = {
            'VTK::PositionVC::Dec': defines + part['vertex.declare'],
            'VTK::PositionVC::Impl': part['vertex.position'],
        }
        fragment = {
            'VTK::PositionVC::Dec': defines + part['fragment.declare'],
            'VTK::PositionVC::Impl': part['fragment.meet'],
            'VTK::Color::Impl': '//VTK::Color::Impl\n' + part['fragment.color'],
            'VTK::Normal::Impl': 'vec3 normalVCVSOutput = ibr_normal;\n',
        }
        if not self.dots:
            fragment['VTK::Depth::Impl'] = part['fragment.depth'] + '//VTK::Depth::Impl\n'
        return Feature(f'spheres_{self.name}', vertex, fragment)


DOTS = Way('dots', 1, 65_536, dots=True)
POINTS = Way('points', 1, 65_536)
QUADS = Way('quads', 4, 16_384)
WAYS = (DOTS, POINTS, QUADS)
_DULL = Feature('dull', fragment={'VTK::Light::Impl': '//VTK::Light::Impl\n'.join(DULL)})


class Spheres(Painted, Effect):
    """Spheres by the million, exact to the pixel, without triangles.

    Parameters
    ----------
    centers : array_like, shape (n, 3), or dataset
        World units.
    radius : float or array_like, shape (n,)
        Of all or of each, world units; one of radius 0 is not drawn.
    color : color, optional
        Of all that have none of their own; the theme's by default.
    colors : array_like, shape (n, 3), optional
        Of each; uint8 or float.
    scalars : array_like, shape (n,), optional
        Mapped to colours as in ``add_mesh``.
    visible : array_like of bool, shape (n,), optional
        Which are drawn.
    lighting : bool
        Whether lights fall on them.
    ambient, diffuse, specular, specular_power : float, optional
        Of the material, as in ``add_mesh``.
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

    Notes
    -----
    Silhouettes, normals and depth are those of the sphere at the middle of each pixel, in
    perspective too. What is smaller than a pixel is drawn one pixel large. They are opaque, cast
    and receive shadows, and meet other props by depth.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add(pvibr.Spheres([[0, 0, 0], [2, 0, 0]], [1.0, 0.5]))
    >>> balls.bounds
    (-1.0, 2.5, -1.0, 1.0, -1.0, 1.0)
    >>> pl.close()
    """

    visibility = Param(True, 'Whether they are drawn at all.')
    #: Frames that are drawn to pick need them too.
    picks = True
    _changes = 0

    def __init__(
        self, centers, radius=0.5, *, color=None, colors=None, scalars=None, visible=None,
        lighting=True, ambient=None, diffuse=None, specular=None, specular_power=None,
        pickable=True, name=None, **table,
    ):  # fmt: skip
        super().__init__()
        self.name = name
        self._centers = as_points(centers)
        self._radii = _checked_radius(radius, len(self))
        self._begin_looks(table, scalars, colors, visible)
        self.pickable = pickable
        self.property = pv.Property(
            color=color, lighting=lighting, ambient=ambient, diffuse=diffuse, specular=specular,
            specular_power=specular_power, interpolation='Phong',
        )  # fmt: skip  # VTK lights flat points never
        self._anchor, self._binder = new_anchor(), Binder()
        self._textures: dict[str, Texture] = {}
        self._uniforms: dict = {}
        self._window: Any = None
        self._stamp: tuple | None = None
        self._stale = {'ibr_items', 'ibr_looks'}
        self._arrange()
        self._layers = [_Layer(self, way) for way in WAYS]

    def _arrange(self):
        """Put neighbours together, in blocks that are culled as one."""
        self._order = morton_order(self._centers)
        if len(self):
            self._blocks = Blocks.of(self._centers[self._order], self._radii[self._order], BLOCK)
        set_bounds(self._anchor, self.bounds)

    # -- what they are ------------------------------------------------------------------------

    def __len__(self):
        return len(self._centers)

    @property
    def centers(self) -> np.ndarray:
        """Where they are, shape (n, 3), world units."""
        return self._centers

    @centers.setter
    def centers(self, centers):
        centers = as_points(centers)
        if len(centers) != len(self):
            msg = f'centers has {len(centers)} rows; it must keep its {len(self)} spheres'
            raise ValueError(msg)
        self._centers = centers
        self._moved('ibr_items', 'ibr_looks')

    @property
    def radius(self) -> np.ndarray:
        """Of each, shape (n,), world units."""
        return self._radii

    @radius.setter
    def radius(self, radius):
        self._radii = _checked_radius(radius, len(self))
        self._moved('ibr_items')

    def _moved(self, *stale):
        self._arrange()
        for layer in self._layers:
            layer.bound(self.bounds)
        self._drop(*stale)

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds: x, y and z, low and high; of none (1, -1, 1, -1, 1, -1)."""
        if not len(self):
            return (1.0, -1.0) * 3
        low = (self._centers - self._radii[:, None]).min(0)
        high = (self._centers + self._radii[:, None]).max(0)
        return tuple(np.stack([low, high], 1).ravel().tolist())

    @property
    def center(self) -> tuple[float, ...]:
        """Middle of the bounds, world units."""
        return tuple(np.reshape(self.bounds, (3, 2)).mean(1).tolist())

    @property
    def actor(self):
        """The prop that stands for all of them in the plotter's ``actors``."""
        return self._anchor

    # -- the life of an effect ----------------------------------------------------------------

    @property
    def props(self) -> tuple:
        """The prop that stands for them in the scene."""
        return (self._anchor,)

    def attach(self, pipeline):
        """Put the props into the scene.

        Parameters
        ----------
        pipeline : pvibr.pipeline.Pipeline
            Where it was added.
        """
        super().attach(pipeline)
        renderer = pipeline.renderer
        if hasattr(renderer, 'add_actor'):
            name = self._name or f'Spheres({self._anchor.GetAddressAsString("")})'
            renderer.add_actor(
                self._anchor, name=name, reset_camera=False, render=False, pickable=False
            )
        else:
            renderer.AddViewProp(self._anchor)
        for actor in self.actors():
            renderer.AddViewProp(actor)

    def detach(self):
        """Take the props out of the scene."""
        renderer = self.pipeline.renderer
        self.rest()
        for actor in self.actors():
            renderer.RemoveViewProp(actor)
        if renderer.HasViewProp(self._anchor):
            if hasattr(renderer, 'remove_actor'):
                renderer.remove_actor(self._anchor, reset_camera=False, render=False)
            else:
                renderer.RemoveViewProp(self._anchor)
        super().detach()

    def remove(self):
        """Take them out of their plotter and free what they hold on the GPU."""
        if self.pipeline is not None:
            self.pipeline.remove(self)

    def stamp(self) -> tuple:
        """Return what changes whenever what is drawn does, the camera left out."""
        shown = self.visibility and bool(self._anchor.GetVisibility())
        return self._changes, self._revision, shown

    def actors(self) -> list:
        """Return the actors that draw them, those that are not visible now too."""
        return [actor for layer in self._layers for actor in layer.actors]

    def drawn(self) -> list:
        """Return the actors that `prepare` chose."""
        return [actor for actor in self.actors() if actor.GetVisibility()]

    def needed(self, frame) -> bool | str:
        """Tell whether there is anything to draw.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        if not self.visibility or not self._anchor.GetVisibility():
            return 'not visible'
        return bool(len(self)) or 'no spheres'

    def rest(self):
        """Draw nothing: frames are drawn without them now."""
        for actor in self.actors():
            actor.VisibilityOff()
        self._stamp = None

    def prepare(self, frame):
        """Choose what is drawn, and how.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        self._upload(frame.window)
        shiny = self.property.GetSpecular() > 0 or self.property.GetInterpolation() == PBR
        for layer in self._layers:
            layer.dress(shiny)
        camera = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        stamp = (*camera, self._changes, self._revision)
        if stamp != self._stamp:
            self._uniforms = _view_uniforms(frame, len(self))
            blocks, ways = _chosen(self._blocks, frame)
            for k, layer in enumerate(self._layers):
                layer.show(blocks[ways == k])
            self._stamp = stamp

    def finish(self, frame):
        """Give the texture units back.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that was drawn.
        """
        self._binder.unbind()

    # -- the GPU ------------------------------------------------------------------------------

    def _repaint(self):
        self._drop('ibr_looks')

    def _drop(self, *names):
        """Have textures made anew for the next frame."""
        self._stale |= set(names)
        self._stamp = None
        self._changes += 1

    def _upload(self, window):
        if self._window is None:
            self._window = window
            self._stale = {'ibr_items', 'ibr_looks'}
        made, self._stale = self._stale, set()
        rows = {'ibr_items': self._items, 'ibr_looks': self._looks}
        for name in made:
            self._textures.setdefault(name, Texture(window)).upload(pack(rows[name](), _ROW, 4))

    def _items(self):
        origins = np.repeat(self._blocks.centers, BLOCK, 0)[: len(self)]
        items = np.empty((len(self), 4), np.float32)
        items[:, :3] = self._centers[self._order] - origins
        items[:, 3] = self._radii[self._order]
        return items

    def _looks(self):
        looks = merge(len(self), self._colors, self._visible)
        if looks is None:
            return np.full((len(self), 4), COLORED // 2 + 1, np.uint8)
        return looks[self._order]

    def release(self):
        """Free what they hold on the GPU; the context is current."""
        self._binder.unbind()
        for layer in self._layers:
            layer.release(self._window)
        for texture in self._textures.values():
            texture.release()
        self._textures, self._window, self._stamp = {}, None, None

    def report(self) -> dict:
        """Return bytes, how many there are, and how many are drawn in which way."""
        textures = [*self._textures.values(), *(t for a in self._layers if (t := a.blocks))]
        return {
            'bytes': sum(t.nbytes for t in textures),
            'spheres': len(self),
            **{layer.way.name: min(layer.count * BLOCK, len(self)) for layer in self._layers},
        }

    # -- picking ------------------------------------------------------------------------------

    def pick(self, x, y) -> Hit | None:
        """Return the nearest sphere under a pixel.

        Parameters
        ----------
        x, y : float
            Pixels from the lower left corner of the window.

        Returns
        -------
        pvibr.actors.picking.Hit or None
            ``index`` of the sphere and ``point`` on it, world units.
        """
        if not self.pickable or self.pipeline is None or self.needed(None) is not True:
            return None
        renderer = self.pipeline.renderer
        start, direction = pixel_ray(renderer, x, y)
        index, distance = self._met(start, direction)
        if index is None:
            return None
        return Hit(index, tuple((start + distance * direction).tolist()), distance)

    def _met(self, start, direction):
        """Return which sphere a ray meets first and how far away; None where it meets none."""
        away = self._centers - start
        along = away @ direction
        square = self._radii**2 - ((away - along[:, None] * direction) ** 2).sum(1)
        half = np.sqrt(np.maximum(square, 0))
        distances = np.where(along > half, along - half, along + half)  # cut open: its inside
        found = self.visible & (square >= 0) & (distances >= 0) & (self._radii > 0)
        distances = np.where(found, distances, np.inf)
        index = int(distances.argmin())
        return (index, float(distances[index])) if found[index] else (None, np.inf)


class _Layer:
    """The spheres that are drawn in one way: draws of a chunk each that share one mapper."""

    def __init__(self, spheres, way):
        self._owner: Any = weakref.ref(spheres)
        self.way = way
        self._feature = way.feature()
        self._landed, self._shiny = False, True
        self.failure = ''
        self.blocks: Texture | None = None
        self.count = 0
        self._mapper = _vtk.vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self._mapper.AddObserver('UpdateShaderEvent', self._updater())
        slots = max(-(-len(spheres) // BLOCK), 1) * BLOCK
        self._chunk = min(way.chunk, slots)
        self.bound(spheres.bounds)
        self.actors = [self._actor(spheres.property) for _ in range(-(-slots // self._chunk))]

    def bound(self, bounds):
        """Tell VTK where they are."""
        self._mapper.SetInputData(card_mesh(self._chunk, self.way.corners, bounds))

    def _actor(self, prop):
        actor = pv.Actor()
        actor.SetMapper(self._mapper)
        actor.SetProperty(prop)
        actor.ForceOpaqueOn()
        actor.VisibilityOff()
        actor.PickableOff()
        actor.UseBoundsOff()
        self._feature.attach(actor)
        return actor

    def dress(self, shiny):
        """Have highlights computed or not."""
        if self.failure:
            raise ShaderError(self.failure)
        if shiny != self._shiny:
            for actor in self.actors:
                (_DULL.detach if shiny else _DULL.attach)(actor)
            self._shiny = shiny

    def show(self, blocks):
        """Draw blocks: rows of their middle in eye space and their number."""
        self.count = len(blocks)
        owner = self._owner()
        if self.count:
            self.blocks = self.blocks or Texture(owner._window)
            self.blocks.upload(pack(blocks.astype(np.float32), _ROW, 4))
        step = self._chunk // BLOCK
        for i, actor in enumerate(self.actors):
            first = i * step
            actor.SetVisibility(first < self.count)
            if first < self.count:
                uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
                uniforms.SetUniformi('ibr_first', first * BLOCK)
                uniforms.SetUniformi('ibr_end', min(first + step, self.count))

    def _updater(self):
        # The mapper keeps the function, which must not keep the mapper: no cycle through C++.
        layer = weakref.ref(self)

        @_vtk.calldata_type(_vtk.VTK_OBJECT)
        def update(_mapper, _event, program):
            alive = layer()
            if alive is not None:
                alive._update(program)

        return update

    def _update(self, program):
        owner = self._owner()
        state = owner._window.GetState()
        if self.way.corners == 1:
            state.SetEnumState(_PROGRAM_POINT_SIZE, True)
        textures = {**owner._textures, 'ibr_blocks': self.blocks}
        set_uniforms(program, owner._binder.bind(self, textures))
        set_uniforms(program, owner._uniforms)
        set_uniforms(program, _pixel_uniforms(state, owner._uniforms))
        if not self._landed:
            self._landed = True
            if not self._feature.landed(program):
                self.failure = f'the shader text of the spheres ({self.way.name}) did not land'

    def release(self, window):
        if window is not None:
            self._mapper.ReleaseGraphicsResources(window)
            for actor in self.actors:
                actor.ReleaseGraphicsResources(window)
        if self.blocks is not None:
            self.blocks.release()
            self.blocks = None


def _chosen(blocks, frame):
    """Return rows of the blocks that are drawn, the nearest first, and the way of each."""
    with np.errstate(divide='ignore', invalid='ignore'):  # the eye may be in the middle of one
        index, origins, _, large = (a[::-1] for a in blocks.seen(frame))
    around = (blocks.reach + blocks.largest)[index]
    planes = frustum_planes(frame.clip_from_view)[:5]
    inside = (planes[:, :3] @ origins.T + planes[:, 3:]).min(0) > around
    ways = np.where(inside & (large <= _LARGEST_POINT), WAYS.index(POINTS), WAYS.index(QUADS))
    ways[inside & (large <= 1.0)] = WAYS.index(DOTS)
    return np.column_stack([origins, index]), ways


def _view_uniforms(frame, count) -> dict:
    """Return what both shaders know of the eye."""
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    return {
        'ibr_count': count,
        'ibr_parallel': int(frame.parallel),
        'ibr_size': tuple(map(float, frame.size)),
        'ibr_pixel': float(frame.scale / frame.pixel_scale),
        'ibr_near': float(frame.near),
        'ibr_ndc_from_slope': (float(m[0, 0]), float(m[1, 1]), *map(float, offset)),
        'ibr_zw_from_z': (float(m[2, 2]), float(m[2, 3]), float(m[3, 2]), float(m[3, 3])),
        'ibr_eye_from_world': uniform_matrix(frame.view_from_world[:3, :3]),
    }


def _pixel_uniforms(state, uniforms) -> dict:
    """Return how slopes follow from pixels of the target, wherever in it the picture is drawn."""
    found = [0, 0, 0, 0]
    state.vtkglGetIntegerv(_VIEWPORT, found)
    corner, size = np.array(found[:2], float), np.array(found[2:], float)
    scale, offset = np.reshape(uniforms['ibr_ndc_from_slope'], (2, 2))
    factors = 2 / size / scale
    offsets = (-1 - offset) / scale - corner * factors
    return {'ibr_slope_from_pixel': (*factors.tolist(), *offsets.tolist())}


def _checked_radius(radius, count):
    array = np.asarray(radius, float)
    if array.shape not in ((), (count,)):
        msg = f'radius has shape {array.shape}; it must be one number or ({count},)'
        raise ValueError(msg)
    bad = ~(np.isfinite(array) & (array >= 0))
    if bad.any():
        msg = f'radius has the value {array[bad].flat[0]}; each must be finite and 0 or more'
        raise ValueError(msg)
    return np.broadcast_to(array, (count,)).copy()
