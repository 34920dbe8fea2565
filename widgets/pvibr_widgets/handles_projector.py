"""Handles of a projector: position, target, roll and field of view."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pvibr.maths.cameras import as_camera
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole
from pvibr.photos.projector import Projector
from pvibr_widgets.handles import Handles
from pvibr_widgets.handles_stage import Stage

_NAMES = ('position', 'aim', 'roll', 'angle')
_LINES, _AXIS = (150, 210, 255), (200, 200, 200)
_ABOVE = 1.3  # where the handle of the roll is, in halves of the picture's height
_ALONG = np.linspace(0, 1, 9)  # lenses bend the borders of pictures
_WIDEST, _NARROWEST = 170.0, 0.01  # degrees
_SHORTEST = 1e-9  # of a length over another: what is shorter has no direction


def projector_handles(pl, photo, *, view=0, callback=None, size=28):
    """Add handles to a projector: position, target, roll and angle; its frustum is drawn.

    The picture is seen on the scene where it is meanwhile. Handles are dragged by mouse or finger;
    Tab goes from one to the next, arrow keys move it by ten pixels, with Shift by one, page up
    and page down away and nearer; Escape lets go.

    Parameters
    ----------
    pl : pyvista.BasePlotter or vtkRenderer
        Where the projector is, in any subplot.
    photo : pvibr.Projector
        A ``pyvista.Camera`` that it was given is moved itself; in place of any other camera it
        gets new ones, see ``photo.cameras``.
    view : int, optional
        Which of several pictures.
    callback : callable, optional
        Called with the projector after each change by a handle.
    size : float, optional
        Of a handle, pixels; fingers need 24.

    Returns
    -------
    pvibr_widgets.handles.Handles
        With ``remove()``, ``enabled`` and ``callbacks``; it goes with the projector.

    Raises
    ------
    TypeError
        If it is no projector.
    ValueError
        If it is in no subplot, or has no such picture.
    ClosedError
        If the plotter is closed.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> import pvibr_widgets
    >>> from pyvista import examples
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Plane(i_size=4, j_size=4))
    >>> camera = pv.Camera()
    >>> camera.position, camera.focal_point, camera.up = (0, -2, 6), (0, 0, 0), (0, 1, 0)
    >>> photo = pl.ibr.add(pvibr.Projector(examples.mapfile, camera))
    >>> handles = pvibr_widgets.projector_handles(pl, photo)
    >>> list(handles.pixels)
    ['position', 'aim', 'roll', 'angle']
    >>> pl.close()
    """
    if not isinstance(photo, Projector):
        raise TypeError(f'photo = {photo!r:.80}: must be a pvibr.Projector')
    stage = Stage.of(pl, photo)
    if not 0 <= view < len(photo.cameras):
        raise ValueError(
            f'view = {view!r}: {photo.name} has pictures 0 to {len(photo.cameras) - 1}'
        )
    return _ProjectorHandles(stage, photo, view, callback, size)


class _ProjectorHandles(Handles):
    """See `projector_handles`."""

    def __init__(self, stage, photo, view, callback, size):
        self.thing, self._view, self._renderer = photo, view, stage.renderer
        self._reach = _reach(stage.renderer, self._camera())
        super().__init__(stage, _NAMES, callback=callback, size=size)

    def _camera(self):
        return as_camera(self.thing.cameras[self._view], self.thing.size_of(self._view))

    def _is_gone(self):
        pipeline = self.thing.pipeline
        return pipeline is None or pipeline.renderer is not self._renderer

    def _aimed(self) -> _Aimed:
        return _Aimed.of(self.thing.cameras[self._view], self._camera(), self._reach)

    def _look(self):
        camera, aimed = self._camera(), self._aimed()
        return {
            'position': aimed.position,
            'aim': aimed.aim,
            'roll': aimed.aim + _ABOVE * _half(camera, aimed, aimed.up) * aimed.up,
            'angle': _at(camera, aimed, [_side(camera, aimed)])[0],
        }

    def _lines(self):
        camera, aimed = self._camera(), self._aimed()
        zero, one = np.zeros_like(_ALONG), np.ones_like(_ALONG)
        sides = [(_ALONG, zero), (one, _ALONG), (_ALONG[::-1], one), (zero, _ALONG[::-1])]
        border = _at(camera, aimed, np.concatenate([np.column_stack(s) for s in sides]))
        corners = border[:: len(_ALONG)]
        starts = camera.rays(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]))[0]
        rim = np.stack([border, np.roll(border, -1, axis=0)], axis=1)
        frustum = np.concatenate([rim, np.stack([starts, corners], axis=1)])
        frustum = frustum[np.isfinite(frustum).all(axis=(1, 2))]
        top = aimed.aim + _ABOVE * _half(camera, aimed, aimed.up) * aimed.up
        axes = np.array([[aimed.position, aimed.aim], [aimed.aim, top]])
        return [(axes, _AXIS), (frustum, _LINES)]

    def _bound(self, name):
        if name in ('position', 'aim'):
            return None
        aimed = self._aimed()
        if name == 'roll':
            return 'plane', aimed.aim, aimed.ahead
        return 'line', self._places['angle'], aimed.right

    def _put(self, name, point):
        given, camera, aimed = self.thing.cameras[self._view], self._camera(), self._aimed()
        widen, is_view = 1.0, hasattr(given, 'focal_point')
        # As VTK's cameras have it: what is upward stays so, wherever one looks from.
        up = np.array(given.up, float) if is_view else aimed.up
        if name == 'position':
            aimed = aimed.turned(point, aimed.aim, up)
        elif name == 'aim':
            aimed = aimed.turned(aimed.position, point, up)
        elif name == 'roll':
            aimed = aimed.turned(aimed.position, aimed.aim, point - aimed.aim)
        else:
            old = (self._look()['angle'] - aimed.aim) @ aimed.right
            widen = ((point - aimed.aim) @ aimed.right) / old
        if not widen > 0:
            return
        self._reach = float(np.linalg.norm(aimed.aim - aimed.position))
        if is_view:
            _set_view(given, aimed, widen)
            if name == 'roll':
                given.up = aimed.up.tolist()
        else:
            self.thing.set_camera(_moved(camera, aimed, widen), self._view)


@dataclass(frozen=True)
class _Aimed:
    """Position, direction and target of a camera; world units, unit vectors."""

    position: np.ndarray
    aim: np.ndarray
    up: np.ndarray

    @classmethod
    def of(cls, given, camera, reach):
        if isinstance(camera, Orthographic):
            up, right = camera.up, camera.right
            ahead = np.cross(up, right)
            position = camera.origin + (camera.width * right + camera.height * up) / 2
        else:
            position, up, ahead = camera.position, -camera.R[1], camera.R[2]
        if hasattr(given, 'focal_point'):
            position, aim = np.array(given.position, float), np.array(given.focal_point, float)
        else:
            aim = position + reach * ahead
        return cls(position, aim, up)

    def turned(self, position, aim, up):
        """Return a rotated, upright copy; raise ValueError without a direction."""
        reach = float(np.linalg.norm(aim - position))
        least = _SHORTEST * float(np.linalg.norm(self.aim - self.position))
        ahead = (aim - position) / max(reach, 1e-300)
        up = up - ahead * (up @ ahead)
        if reach <= least or not np.linalg.norm(up) > _SHORTEST:
            raise ValueError('a camera must look somewhere, and not along its upward direction')
        return _Aimed(position, aim, up / np.linalg.norm(up))

    @property
    def ahead(self):
        return (self.aim - self.position) / np.linalg.norm(self.aim - self.position)

    @property
    def right(self):
        return np.cross(self.ahead, self.up)


def _reach(renderer, camera) -> float:
    """Return the default distance of the target: that of the centre of the scene."""
    bounds = np.array(renderer.ComputeVisiblePropBounds())
    aimed = _Aimed.of(None, camera, 1.0)
    if bounds[0] > bounds[1]:
        return 1.0
    middle = (bounds[::2] + bounds[1::2]) / 2
    away = float((middle - aimed.position) @ aimed.ahead)
    return away if away > 0 else float(np.linalg.norm(bounds[1::2] - bounds[::2])) or 1.0


def _at(camera, aimed, uv):
    """Return points of the picture on the plane through the target, (n, 3)."""
    starts, ways = camera.rays(np.asarray(uv, float))
    away = (aimed.aim - starts) @ aimed.ahead / (ways @ aimed.ahead)
    return starts + away[:, None] * ways


def _side(camera, aimed):
    """Return the centre of the picture's side farther from the axis."""
    sides = np.array([[1.0, 0.5], [0.0, 0.5]])
    away = np.abs((_at(camera, aimed, sides) - aimed.aim) @ aimed.right)
    return sides[int(np.nan_to_num(away[1]) > np.nan_to_num(away[0]) * 1.001)]


def _half(camera, aimed, up) -> float:
    """Return the extent of the picture from the axis along a direction."""
    ends = (_at(camera, aimed, [[0.5, 1.0], [0.5, 0.0]]) - aimed.aim) @ up
    return float(np.nanmax(np.abs(ends)))


def _set_view(camera, aimed, widen):
    """Move a ``pyvista.Camera``."""
    camera.position, camera.focal_point = aimed.position.tolist(), aimed.aim.tolist()
    if widen != 1 and camera.parallel_projection:
        camera.parallel_scale = camera.parallel_scale * widen
    elif widen != 1:
        tangent = np.tan(np.radians(camera.view_angle) / 2) * widen
        angle = 2 * np.degrees(np.arctan(tangent))
        camera.view_angle = float(np.clip(angle, _NARROWEST, _WIDEST))


def _moved(camera, aimed, widen):
    """Return a moved copy of a camera."""
    right, up = aimed.right, aimed.up
    if isinstance(camera, Orthographic):
        width, height = camera.width * widen, camera.height * widen
        corner = aimed.position - (width * right + height * up) / 2
        return replace(camera, origin=corner, right=right, up=up, width=width, height=height)
    rotation = np.array([right, -up, aimed.ahead])
    K = camera.K.copy()
    K[:2, :2] /= widen
    return Pinhole(K, rotation, -rotation @ aimed.position, camera.size, camera.distortion)
