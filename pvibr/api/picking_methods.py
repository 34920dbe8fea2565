"""Picking, and buffers of frames: methods of ``plotter.ibr``."""

from __future__ import annotations

from functools import partial

from pvibr.api.click_picking import ClickPicking
from pvibr.core.arguments import check_one_of, checked_number, checked_positive, checked_whole
from pvibr.core.colors import as_rgb
from pvibr.core.params import checked_flag


def pick(self, x, y):
    """Pick the thing at a pixel of the active subplot.

    Parameters
    ----------
    x, y : int
        Pixel coordinates from the lower left corner of the window.

    Returns
    -------
    object or None
        The nearest hit, or None. For a thing that replaces actors, such as an impostor,
        ``actor`` is the one hit.
    """
    return hit_at(self, checked_number('x', x), checked_number('y', y))[1]


def hit_at(self, x, y) -> tuple:
    """Return the thing at a pixel and the hit, or (None, None)."""
    thing_hits = [(e, h) for e in self.pipeline.effects if (h := e.pick(x, y)) is not None]
    return min(thing_hits, key=lambda p: getattr(p[1], 'distance', 0.0), default=(None, None))


def enable_picking(
    self,
    callback=None,
    *,
    left_clicking=False,
    show=True,
    show_message=True,
    use_picker=False,
    style='wireframe',
    color='pink',
    line_width=5,
    font_size=18,
):
    """Pick things with the mouse, as PyVista's ``enable_mesh_picking`` picks meshes.

    Parameters
    ----------
    callback : callable, optional
        Called with the result of :meth:`pick`, unless nothing is hit.
    left_clicking : bool
        Pick with the left mouse button instead of the right one; the P key also picks.
    show : bool
        Highlight what was picked; in a set of items, the item.
    show_message : bool or str
        Show instructions, or a message of your own.
    use_picker : bool
        Also pass the callback a ``vtkCellPicker`` that has picked there.
    style, color, line_width : optional
        Look of the highlight, as in ``add_mesh``.
    font_size : int
        Size of the message.

    Raises
    ------
    TypeError
        If the renderer has no PyVista plotter, or `callback` is not callable.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]])
    >>> pl.ibr.enable_picking(lambda hit: print(hit.index), left_clicking=True)
    >>> pl.ibr.disable_picking()
    >>> pl.close()
    """
    if getattr(self._plotter, 'iren', None) is None:
        raise TypeError(
            'mouse picking requires a PyVista plotter; call pick(x, y) from your own events'
        )
    if callback is not None and not callable(callback):
        raise TypeError(f'callback must be a function of the hit or None, got {callback!r}')
    flags = {'left_clicking': left_clicking, 'use_picker': use_picker}
    checked_flags = {name: checked_flag(name, value) for name, value in flags.items()}
    show = checked_flag('show', show)
    check_one_of('style', style, ('surface', 'wireframe', 'points'))
    color, line_width = as_rgb('color', color), checked_positive('line_width', line_width)
    font_size = checked_whole('font_size', font_size, 1, 1000)
    if not isinstance(show_message, str):
        show_message = checked_flag('show_message', show_message)
    self.disable_picking()
    self._clicks = ClickPicking(self._plotter, partial(hit_at, self), callback, **checked_flags)
    if show:
        self._clicks.show(style=style, color=color, line_width=line_width)
    if show_message:
        self._clicks.tell(show_message, font_size)


def disable_picking(self):
    """Stop picking with the mouse."""
    self._thread.check()
    click_picking, self._clicks = self._clicks, None
    if click_picking is not None:
        click_picking.stop()


def buffer(self, name):
    """Render the active subplot and return one of its buffers.

    Normals and ids cover opaque surfaces only, no translucent props, volumes, images or labels;
    an assembly is one object.

    Parameters
    ----------
    name : {'depth', 'normal', 'id', 'color'}
        ``'depth'`` is the distance along the view direction in world units, inf on the
        background; ``'normal'`` is in view space, facing the eye, 0 on the background and on
        unlit surfaces; ``'id'`` is an index into `buffer_objects`, -1 on the background;
        ``'color'`` is the image with all effects and without annotations.

    Returns
    -------
    numpy.ndarray
        (height, width) or (height, width, channels) float32, ids int32; top row first.

    Raises
    ------
    ValueError
        If `name` is not a buffer.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    >>> ball = pl.add_mesh(pv.Sphere())
    >>> ids = pl.ibr.buffer('id')
    >>> ids.shape, ids[24, 32].item(), ids[0, 0].item()
    ((48, 64), 0, -1)
    >>> pl.ibr.buffer_objects[0] is ball
    True
    >>> pl.close()
    """
    pipeline = self.pipeline
    self._show()
    tap = pipeline.buffer(name)
    if name == 'id':
        self._buffer_objects = tap.numbered
    return tap.array
