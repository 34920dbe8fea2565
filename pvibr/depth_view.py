"""Depth seen from elsewhere than the camera: what shadows, projectors and queries share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.gl import Target, texture_limit


class DepthView:
    """Depth textures of one or more views, side by side in one, drawn again only when stale.

    Parameters
    ----------
    drawer : pvibr.gl.drawer.Drawer
        Draws the props.
    views : int
        How many.
    resolution : int
        Texels along a side of each; less where the driver's limit asks for it.
    compare : bool
        Whether it is read by a ``sampler2DShadow``.

    Attributes
    ----------
    bakes : int
        Views drawn so far.
    """

    def __init__(self, drawer, views, resolution, *, compare=False):
        self.drawer = drawer
        self.columns = int(np.ceil(np.sqrt(views)))
        self.rows = -(-views // self.columns)
        limit = texture_limit(drawer.window)
        self.resolution = min(int(resolution), limit // self.columns)
        size = self.columns * self.resolution, self.rows * self.resolution
        self.target = Target(drawer.window, *size, (), depth=True)
        if compare:
            self.target.depth.compare()
        self.views: list = [None] * views
        self._keys: list = [None] * views
        self.bakes = 0

    @property
    def texture(self):
        """The depth texture: 0 near, 1 far."""
        return self.target.depth

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.target.nbytes

    def corner(self, k) -> tuple[int, int]:
        """Return the lower left texel of a view in the texture."""
        return k % self.columns * self.resolution, k // self.columns * self.resolution

    def update(self, frame, views, casters) -> list[int]:
        """Draw the views that are stale.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        views : sequence of pvibr.maths.views.View
            As many as it was made for.
        casters : Casters
            What is drawn.

        Returns
        -------
        list of int
            Those that were drawn.
        """
        shared = casters.key()
        stale = [k for k, v in enumerate(views) if self._keys[k] != (v.key(), shared)]
        self.views = list(views)
        if not stale:
            return []
        with self.target.drawing():
            for k in stale:
                self._draw(frame, views[k], k, casters)
            self.drawer.done()
        # Taken again: things may have made actors for these views.
        shared = casters.key()
        for k in stale:
            self._keys[k] = (views[k].key(), shared)
        self.bakes += len(stale)
        return stale

    def _draw(self, frame, view, k, casters):
        seen = seen_from(frame, view, self.resolution)
        casters = casters.seen(view)
        for thing in casters.things:
            thing.prepare(seen)
        self.drawer.look(view, (*self.corner(k), self.resolution, self.resolution))
        self.drawer.draw(casters.actors)
        for thing in casters.things:
            self.drawer.draw(thing.drawn())
            thing.finish(seen)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.target.release()


def seen_from(frame, view, resolution):
    """Return a frame as it would be from another view, drawn for its depth alone.

    Parameters
    ----------
    frame : pvibr.frame.Frame
        The frame about to be drawn.
    view : pvibr.maths.views.View
        Where from.
    resolution : int
        Pixels along a side.

    Returns
    -------
    pvibr.frame.Frame
        Of the same renderer.
    """
    return replace(
        frame, size=(resolution, resolution), origin=(0, 0), parallel=view.parallel,
        view_from_world=view.view_from_world, clip_from_view=view.clip_from_view,
        near=view.near, far=view.far, eye=view.eye, casting=True,
    )  # fmt: skip
