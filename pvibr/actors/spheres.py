"""Spheres by the million: cards on which rays from the eye meet them exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.actors.anchor import Anchored, set_bounds
from pvibr.actors.anchor import anchor as new_anchor
from pvibr.actors.billboard_cards import as_points
from pvibr.actors.cards import BLOCK, PBR, Binder, pack
from pvibr.actors.looks import COLORED, merge
from pvibr.actors.painted import Painted
from pvibr.actors.picking import Hit, pixel_ray
from pvibr.actors.sphere_cards import ROW, WAYS, Layer, chosen, view_uniforms
from pvibr.gl import Texture
from pvibr.maths.blocks import Blocks, morton_order
from pvibr.params import Param


class Spheres(Painted, Anchored):
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
    perspective too. What is smaller than a pixel is drawn one pixel large; spheres of up to four
    pixels have one depth each. They are opaque, cast and receive shadows, and meet other props by
    depth. Hardware picking does not see them; :meth:`pick` does.

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

    _title = 'Spheres'

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
        self._layers = [Layer(self, way) for way in WAYS]

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

    # -- the life of an effect ----------------------------------------------------------------

    def _take_out(self, renderer):
        self.rest()
        super()._take_out(renderer)

    def stamp(self) -> tuple:
        """Return what changes whenever what is drawn does, the camera left out."""
        shown = self.visibility and bool(self._anchor.GetVisibility())
        return self._changes, self._revision, shown

    def actors(self) -> list:
        """Return the actors that draw them, those that are not visible now too."""
        return [actor for layer in self._layers for actor in layer.actors]

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
            self._uniforms = view_uniforms(frame, len(self))
            blocks, ways = chosen(self._blocks, frame)
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
            self._textures.setdefault(name, Texture(window)).upload(pack(rows[name](), ROW, 4))

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
