"""Handles of a light: position, target and cone; and the frustum of its shadow map."""

from __future__ import annotations

import numpy as np

from pvibr.core._vtk import address
from pvibr.shadows.shadows import Shadows
from pvibr_widgets.handles import Handles
from pvibr_widgets.handles_stage import Stage

_NAMES = ('direction', 'position', 'aim', 'angle')
_RAYS, _FRUSTUM, _CASCADE = (255, 235, 160), (255, 140, 60), (150, 110, 80)
_AROUND = np.linspace(0, 2 * np.pi, 33)
_WITHIN = 0.9  # where the handle of a direction is, in radii of the scene
_CONE = (0.1, 89.0)  # degrees from the axis; VTK takes 90 for light to all sides
_SHORTEST = 1e-9  # of a length over another: what is shorter has no direction
_POINT = 90.0
# Corners of clip space, and the edges between them.
_CORNERS = np.array([[x, y, z, 1.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_EDGES = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]


def light_handles(pl, light, *, callback=None, size=28):
    """Add handles to a light, and show the frustum of its shadow map.

    A directional light has one for its direction, on a sphere around the scene; a point light one
    for its position, and a spot also for its aim and the angle of its cone. Handles are moved as
    those of :func:`projector_handles`; page up and page down bring that of a direction to the far
    and near side of the scene.

    Parameters
    ----------
    pl : pyvista.BasePlotter or vtkRenderer
        Where the light is, in any subplot.
    light : pyvista.Light or vtkLight
        A scene light or a camera light.
    callback : callable, optional
        Called with the light after each change by a handle.
    size : float, optional
        Of a handle, pixels; fingers need 24.

    Returns
    -------
    pvibr_widgets.handles.Handles
        With ``remove()``, ``enabled`` and ``callbacks``; it goes with the light.

    Raises
    ------
    TypeError
        If it is no light.
    ValueError
        If it is in no subplot, or is a headlight.
    ClosedError
        If the plotter is closed.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr_widgets
    >>> pl = pv.Plotter(off_screen=True, lighting='none')
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> light = pv.Light(position=(2, 2, 2), light_type='scene light', cone_angle=30)
    >>> light.positional = True
    >>> pl.add_light(light)
    >>> handles = pvibr_widgets.light_handles(pl, light)
    >>> list(handles.pixels)
    ['position', 'aim', 'angle']
    >>> handles.remove()
    >>> pl.close()
    """
    if not (hasattr(light, 'IsA') and light.IsA('vtkLight')):
        raise TypeError(f'light = {light!r:.80}: must be a pyvista.Light or a vtkLight')
    here = Stage(pl).renderer
    holding = [r for r in (here, *getattr(pl, 'renderers', ())) if _has(r, light)]
    if not holding:
        raise ValueError('light is in no subplot of pl: add it by pl.add_light first')
    if light.LightTypeIsHeadlight():
        raise ValueError(
            'light is a headlight, which is where the camera is: make it a scene light'
        )
    return _LightHandles(Stage(pl, holding[0]), light, callback, size)


def _has(renderer, light) -> bool:
    return any(address(other) == address(light) for other in renderer.GetLights())


class _LightHandles(Handles):
    """See `light_handles`."""

    def __init__(self, stage, light, callback, size):
        self.thing, self._renderer = light, stage.renderer
        super().__init__(stage, _NAMES, callback=callback, size=size)

    def _is_gone(self):
        return not _has(self._renderer, self.thing) or self.thing.LightTypeIsHeadlight()

    # -- the light, in world units

    @property
    def _position(self):
        return np.array(self.thing.GetTransformedPosition(), float)

    @property
    def _aim(self):
        return np.array(self.thing.GetTransformedFocalPoint(), float)

    def _ends(self):
        """Return position, target and unit direction; raise ValueError if there is none."""
        start, end = self._position, self._aim
        length = float(np.linalg.norm(end - start))
        if not length > 0:
            raise ValueError('the light is where it aims')
        return start, end, (end - start) / length

    def _across(self, ahead):
        """Return the unit vector perpendicular to the light that is closest to the image plane."""
        frame = self._stage.frame()
        away = -frame.view_from_world[2, :3]
        if not frame.parallel:
            away = self._aim - frame.eye
        side = np.cross(ahead, away)
        if np.linalg.norm(side) < 1e-6 * np.linalg.norm(away):
            side = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
        return side / np.linalg.norm(side)

    def _sphere(self):
        """Return the centre and radius of a sphere around the scene."""
        bounds = np.array(self._renderer.ComputeVisiblePropBounds())
        if bounds[0] > bounds[1]:
            return self._aim, float(np.linalg.norm(self._position - self._aim)) or 1.0
        low, high = bounds[::2], bounds[1::2]
        return (low + high) / 2, _WITHIN * float(np.linalg.norm(high - low)) / 2 or 1.0

    @property
    def _is_spot(self) -> bool:
        return self.thing.GetConeAngle() < _POINT

    # -- handles

    def _look(self):
        self._renderer.UpdateLightsGeometryToFollowCamera()
        if not self.thing.GetPositional():
            middle, radius = self._sphere()
            return {'direction': middle - radius * self._ends()[2]}
        if not self._is_spot:
            return {'position': self._position}
        start, end, ahead = self._ends()
        wide = np.linalg.norm(end - start) * np.tan(np.radians(self.thing.GetConeAngle()))
        return {'position': start, 'aim': end, 'angle': end + wide * self._across(ahead)}

    def _lines(self):
        own = np.zeros((0, 2, 3))
        if not self.thing.GetPositional():
            own = np.array([[self._places['direction'], self._sphere()[0]]])
        elif self._is_spot:
            own = self._cone()
        selected = self.focused or self._hovered
        views = [v for s in self._shadows() if selected for v in s.views_of(self.thing)]
        whole = views if self.thing.GetPositional() else views[:1]
        return [
            (_edges(views[len(whole) :]), _CASCADE),
            (_edges(whole), _FRUSTUM),
            (own, _RAYS),
        ]

    def _shadows(self):
        effects = [e for pipeline in self._pipelines() for e in pipeline.effects]
        return [e for e in effects if isinstance(e, Shadows)]

    def _pipelines(self):
        found: dict = {}
        for named in self._stage.ibr.contents.values():
            found |= {id(e.pipeline): e.pipeline for e in named.values()}
        return [p for p in found.values() if p.renderer is self._renderer]

    def _cone(self):
        start, end, ahead = self._ends()
        edge = self._places['angle'] - end
        other = np.cross(ahead, edge)
        rim = end + np.outer(np.cos(_AROUND), edge) + np.outer(np.sin(_AROUND), other)
        sides = [[start, rim[k]] for k in range(0, len(rim) - 1, 8)]
        return np.concatenate([np.stack([rim[:-1], rim[1:]], axis=1), sides, [[start, end]]])

    def _bound(self, name):
        if name == 'direction':
            return 'sphere', self._sphere()[0], self._places[name]
        if name == 'angle':
            return 'line', self._aim, self._across(self._ends()[2])
        return None

    def _put(self, name, point):
        if name == 'direction':
            middle, radius = self._sphere()
            away = float(np.linalg.norm(self._position - self._aim))
            self._place(self._aim + away * (point - middle) / radius, self._aim)
        elif name == 'position':
            self._place(point, self._aim)
        elif name == 'aim':
            self._place(self._position, point)
        else:
            start, end, ahead = self._ends()
            wide = (point - end) @ self._across(ahead)
            cone = np.degrees(np.arctan2(wide, np.linalg.norm(end - start)))
            self.thing.SetConeAngle(float(np.clip(cone, *_CONE)))

    def _place(self, position, aim):
        least = _SHORTEST * np.linalg.norm(self._position - self._aim)
        if self._is_spot and not np.linalg.norm(aim - position) > least:
            raise ValueError('a light must aim somewhere')
        matrix = self.thing.GetTransformMatrix()
        inverse = (
            np.eye(4) if matrix is None else np.linalg.inv(np.reshape(matrix.GetData(), (4, 4)))
        )
        position, aim = (inverse[:3, :3] @ p + inverse[:3, 3] for p in (position, aim))
        self.thing.SetPosition(*position.tolist())
        self.thing.SetFocalPoint(*aim.tolist())


def _edges(views):
    """Return the edges of frusta, (n, 2, 3), world units."""
    found = [np.zeros((0, 2, 3))]
    for view in views:
        corners = np.linalg.solve(view.clip_from_view, _CORNERS.T).T
        corners = corners[:, :3] / corners[:, 3:] @ view.view_from_world[:3, :3] + view.eye
        found.append(corners[_EDGES])
    return np.concatenate(found)
