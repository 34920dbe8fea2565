"""Pictures that wait for what is made in the background, so that they do not depend on time."""

from __future__ import annotations

import time
import weakref
from functools import wraps

from pvibr.capture.clock import draw
from pvibr.core.arguments import checked_number
from pvibr.core.plotters import is_closed, is_never_shown

#: Methods of plotters that take pictures.
PICTURES = 'screenshot', 'write_frame', 'save_graphic'


def wait(self, timeout=None) -> bool:
    """Wait until all that is baked in the background is drawn.

    Windows and notebooks show drafts of instances at once, while another process bakes their
    images. Screenshots, movies and exports wait by themselves. Ctrl+C ends the wait and the bakes;
    another call goes on with them.

    Parameters
    ----------
    timeout : float, optional
        Seconds to wait at most; by default any time.

    Returns
    -------
    bool
        True if all is there, False if the time was too short.

    Raises
    ------
    ValueError
        If the timeout is negative or no number.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_instances(pv.Sphere(), [[0, 0, 0], [2, 0, 0]], wait=False)
    >>> pl.ibr.wait()
    True
    >>> pl.close()
    """
    self._check_open()
    if timeout is not None:
        timeout = checked_number('timeout', timeout, 0)
    end = None if timeout is None else time.monotonic() + timeout
    is_draft = False
    for effect in self._all_effects():
        is_draft |= effect.is_draft
        if not effect.wait(None if end is None else max(end - time.monotonic(), 0.0)):
            return False
    if is_draft and not is_never_shown(self._plotter):
        draw(self._plotter)
    return True


def waiting_pictures(plotter, ibr) -> dict:
    """Return by name the methods of a plotter that take pictures; they wait for bakes."""
    names = [name for name in PICTURES if hasattr(type(plotter), name)]
    return {name: _waiting(name, weakref.ref(plotter), weakref.ref(ibr)) for name in names}


def _waiting(name, plotter, ibr):
    method = getattr(type(plotter()), name)

    @wraps(method)
    def take(*args, **kwargs):
        # `show` takes a picture as the window closes, of the last frame: False is no file.
        if not (is_closed(plotter()) or args[:1] == (False,)):
            ibr().wait()
        return method(plotter(), *args, **kwargs)

    return take
