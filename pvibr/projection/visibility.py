"""What a camera sees of a mesh and what light reaches it, as data: no plotter is needed."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.frame import Frame
from pvibr.gl.drawer import Drawer
from pvibr.gl.offscreen import hidden_window
from pvibr.maths import depth_test
from pvibr.maths.cameras import Orthographic, as_camera
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.views import View, corners
from pvibr.scene.casters import Casters
from pvibr.scene.depth_view import DepthView
from pvibr.scene.lights import light_views, lights_of

#: Texels around a picture in its depth view: what is compared at its edge lies beyond.
_EDGE = 4.0
#: The nearest that is drawn, over the farthest.
_NEAREST = 1e-3
#: How far points are moved into the faces that they belong to, as a share of the way.
_INWARD = 1e-3
#: How far points are moved along their normals before they are compared, texels: less than in
#: pictures, since one wrong corner makes a point wrong.
_OFFSET = 0.1
#: Apparent diameter of the sun, degrees.
_SUN = 0.53


def visible(mesh, camera, *, casters=(), to='points', size=None, resolution=4096, two_sided=None):
    """Tell what of a mesh a camera sees.

    Parameters
    ----------
    mesh : pyvista.DataSet
        World units; of volumes the surface counts.
    camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
        See :func:`pvibr.maths.cameras.as_camera`.
    casters : sequence of pyvista.DataSet or actors, optional
        What else may hide it.
    to : {'points', 'cells'}
        What is told about. A point is seen if a face at it is.
    size : tuple of 2 int, optional
        Width and height of the picture in pixels, where the camera does not know; by default that
        of PyVista's windows.
    resolution : int, optional
        Texels along a side of the depth view.
    two_sided : bool, optional
        Whether faces are seen from behind, too; by default where the mesh is not closed.

    Returns
    -------
    numpy.ndarray, shape (n,), bool
        False outside of the picture, behind the camera, turned away and hidden.

    Raises
    ------
    ValueError
        Where an argument is not as above.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> from pvibr.maths.cameras import Orthographic
    >>> above = Orthographic.from_extent(-1, 1, -1, 1, zmax=5)
    >>> roof = pv.Plane(center=(0, 0, 1), i_size=1.2)
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.visible(ground, above, casters=[roof], to='cells').tolist()
    [True, False, False, True]
    """
    if size is None:
        size = getattr(camera, 'size', None) or pv.global_theme.window_size
    camera = as_camera(camera, size)
    samples = Samples.of(mesh, to)
    uv, _ = camera.project(samples.points)
    with np.errstate(invalid='ignore'):
        inside = ((uv >= 0) & (uv <= 1)).all(1)
    toward = camera.toward(samples.points)
    facing = samples.facing(toward, sides_of(mesh, two_sided))
    rows = np.flatnonzero(inside & (facing > 0))
    found = np.zeros(len(inside))
    surfaces = [surface_of(m) for m in (mesh, *casters)]
    view = view_of(camera, bounds_of(surfaces), resolution)
    if view is not None and len(rows):
        (depth,) = depth_maps([view], surfaces, resolution)
        normals = samples.turned(toward)[rows]
        found[rows] = depth_test.seen(view, depth, samples.points[rows], normals, _OFFSET)
    return samples.most(found) >= 0.5


def shadow_mask(
    mesh,
    light,
    casters=(),
    *,
    to='points',
    resolution=4096,
    samples=1,
    extent=None,
    two_sided=None,
):
    """Return how much of a light reaches a mesh.

    Parameters
    ----------
    mesh : pyvista.DataSet
        World units; it shadows itself.
    light : pyvista.Light
        Directional, or positional; outside the cone of a spot there is no light.
    casters : sequence of pyvista.DataSet or actors, optional
        What else throws shadows.
    to : {'points', 'cells'}
        What is told about.
    resolution : int, optional
        Texels along a side of a depth view.
    samples : int, optional
        Places on the light from which it is looked; more than 1 gives soft shadows.
    extent : float, optional
        How large the light is, for more than one sample: apparent diameter of a directional light
        in degrees, by default the sun's 0.53; radius of a positional one in world units.
    two_sided : bool, optional
        Whether faces are lit from behind, too. By default they are not: closed meshes are lit
        from outside, others on the side that is turned to the light on the whole.

    Returns
    -------
    numpy.ndarray, shape (n,), float64
        Lit fraction, 0 to 1; 0 where the surface is turned away.

    Raises
    ------
    ValueError
        Where an argument is not as above, the light has no direction, or is a headlight.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> sun = pv.Light(position=(0, 0, 5), light_type='scene light')
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.shadow_mask(ground, sun, [pv.Plane(center=(0, 0, 1))], to='cells').tolist()
    [1.0, 0.0, 0.0, 1.0]
    """
    _check_light(light, samples, extent)
    found = Samples.of(mesh, to)
    surfaces = [surface_of(m) for m in (mesh, *casters)]
    sides = sides_of(mesh, two_sided) or (0 if two_sided else _lit_side(light, found))
    total = np.zeros(len(found.points))
    with _hidden(surfaces) as scene:
        for place in _spread(_scene_light(light), samples, extent):
            total += _lit(place, _views(scene, place, resolution), found, sides)
    return found.most(total / samples)


def shadowed_area(mesh, lit) -> float:
    """Return the area of a mesh that light does not reach.

    Parameters
    ----------
    mesh : pyvista.DataSet
        What :func:`shadow_mask` was asked about.
    lit : array_like, shape (n,)
        Lit fraction per point or cell.

    Returns
    -------
    float
        In the square of the mesh's unit; half shadow counts half.

    Raises
    ------
    ValueError
        Where there are neither as many numbers as points nor as cells.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> ground = pv.Plane(i_size=2, j_size=2, i_resolution=4, j_resolution=1)
    >>> pvibr.shadowed_area(ground, [1.0, 0.0, 0.5, 1.0])
    1.5
    """
    lit = np.asarray(lit, float)
    if lit.shape not in ((mesh.n_cells,), (mesh.n_points,)):
        msg = f'lit has the shape {lit.shape}; it must be ({mesh.n_cells},) or ({mesh.n_points},).'
        raise ValueError(msg)
    faces = Samples.of(mesh, 'cells')
    own = lit[faces.owner] if len(lit) == mesh.n_cells else lit[faces.corner].mean(1)
    return float((faces.area * (1 - own)).sum())


# -- places on a mesh ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Samples:
    """Places on the faces of a mesh that tell about its points or cells."""

    points: np.ndarray
    normals: np.ndarray
    owner: np.ndarray
    count: int
    corner: np.ndarray
    area: np.ndarray

    @classmethod
    def of(cls, mesh, to) -> Samples:
        """Return samples of a mesh: triangle centroids, or points near the corners."""
        if to not in ('points', 'cells'):
            msg = f"to is {to!r}; it must be 'points' or 'cells'."
            raise ValueError(msg)
        corner, cell, point = _triangles(mesh)
        places = np.asarray(mesh.points, float)[point][corner]
        across = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
        length = np.linalg.norm(across, axis=1)
        normals = across / np.where(length > 0, length, 1)[:, None]
        middle, corner = places.mean(1), point[corner]
        if to == 'cells':
            return cls(middle, normals, cell, mesh.n_cells, corner, length / 2)
        inward = places + _INWARD * (middle[:, None] - places)
        alone = np.setdiff1d(np.arange(mesh.n_points), corner)
        return cls(
            np.concatenate([inward.reshape(-1, 3), np.asarray(mesh.points, float)[alone]]),
            np.concatenate([np.repeat(normals, 3, 0), np.zeros((len(alone), 3))]),
            np.concatenate([corner.ravel(), alone]),
            mesh.n_points,
            np.concatenate([np.repeat(corner, 3, 0), np.stack([alone] * 3, 1)]),
            np.concatenate([np.repeat(length / 2, 3), np.zeros(len(alone))]),
        )

    def facing(self, toward, two_sided) -> np.ndarray:
        """Return the cosines between normals and directions, (m,); 1 without normals."""
        cosine = np.einsum('ij,ij->i', self.normals, toward)
        cosine = np.abs(cosine) if not two_sided else two_sided * cosine
        return np.where(self.normals.any(1), cosine, 1.0)

    def turned(self, toward) -> np.ndarray:
        """Return normals on the side of some directions, (m, 3); those where there is none."""
        back = np.einsum('ij,ij->i', self.normals, toward) < 0
        normals = np.where(back[:, None], -self.normals, self.normals)
        return np.where(self.normals.any(axis=1, keepdims=True), normals, toward)

    def most(self, values) -> np.ndarray:
        """Return the largest value of each owner, (count,); 0 for one without samples."""
        found = np.zeros(self.count)
        np.maximum.at(found, self.owner, values)
        return found

    def mean(self, values, weights) -> np.ndarray:
        """Return the weighted mean of each owner, (count, c); NaN where all weights are 0."""
        total = np.bincount(self.owner, weights, self.count)
        values = np.where(weights[:, None] > 0, values, 0.0)
        sums = [np.bincount(self.owner, weights * c, self.count) for c in values.T]
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.stack(sums, 1) / total[:, None]


def _triangles(mesh):
    """Return triangles by surface point, their cells in the mesh, and its points' numbers."""
    if isinstance(mesh, pv.PolyData):
        surface = mesh.copy(deep=False)
        surface.clear_data()
        point, cell = np.arange(mesh.n_points), np.arange(mesh.n_cells)
    else:
        surface = mesh.extract_surface(pass_pointid=True, pass_cellid=True, algorithm=None)
        point = np.asarray(surface['vtkOriginalPointIds'])
        cell = np.asarray(surface['vtkOriginalCellIds'])
        surface.clear_data()
    surface.cell_data['cell'] = cell
    faces = surface.triangulate()
    return faces.regular_faces.reshape(-1, 3), np.asarray(faces.cell_data['cell']), point


def surface_of(thing) -> pv.PolyData:
    """Return the surface of a mesh or an actor in world units, without data."""
    matrix = None
    if hasattr(thing, 'GetMapper'):
        matrix = thing.GetMatrix()
        matrix = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        mapper = thing.GetMapper()
        mapper.Update()
        thing = pv.wrap(mapper.GetInput())
    if isinstance(thing, pv.MultiBlock):
        thing = thing.combine()
    if not isinstance(thing, pv.DataSet):
        msg = f'{thing!r:.100} is no mesh and no actor.'
        raise TypeError(msg)
    surface = thing if isinstance(thing, pv.PolyData) else thing.extract_surface(algorithm=None)
    points = np.asarray(surface.points, np.float64)
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return _with_points(surface, points)


def _with_points(surface, points):
    """Return a surface with other points and no data; the given one stays as it is."""
    found = surface.copy(deep=False)
    found.clear_data()
    found.SetPoints(pv.vtk_points(points))  # setting `points` would write into the given one's
    return found


def bounds_of(surfaces) -> np.ndarray:
    """Return the bounds of those that are not empty, (n, 6)."""
    return np.array([s.bounds for s in surfaces if s.n_points], float).reshape(-1, 6)


def sides_of(mesh, two_sided) -> int:
    """Return which side of a mesh's faces is outside, 1 or -1; 0 where both count."""
    if two_sided is None:
        surface = surface_of(mesh).triangulate().clean()
        two_sided = not len(surface.regular_faces) or surface.n_open_edges > 0
        if not two_sided:
            a, b, c = np.moveaxis(
                (surface.points - surface.center)[surface.regular_faces.reshape(-1, 3)], 1, 0
            )
            return 1 if np.einsum('ij,ij->', a, np.cross(b, c)) > 0 else -1
    return 0 if two_sided else 1


# -- depth views --------------------------------------------------------------------------------


def view_of(camera, bounds, resolution) -> View | None:
    """Return the view of a calibrated camera, deep enough for the whole scene."""
    matrix = camera.view_from_world
    away = -(corners(bounds) @ matrix[2, :3] + matrix[2, 3])
    if not away.size:
        return None
    low, high = float(away.min()), float(away.max())
    margin = _EDGE / resolution
    if not isinstance(camera, Orthographic):
        if high <= 0:
            return None
        near, far = max(0.999 * low, _NEAREST * high), 1.001 * high
        return View(matrix, camera.clip_from_view(near, far, margin), near, far, False)
    low = max(low, camera.near)
    if low >= high and camera.near >= high:
        return None
    room = max(1e-3 * (high - low), 1e-3 * max(camera.width, camera.height))
    low, high = low - (room if low > camera.near else 0.0), high + room
    # The eye is put before all: a camera's planes must be in front of it.
    back = np.eye(4)
    back[2, 3] = low - (high - low)
    near, far = high - low, 2 * (high - low)
    return View(back @ matrix, camera.clip_from_view(near, far, margin), near, far, True)


def depth_maps(views, surfaces, resolution) -> list:
    """Return what some views see of meshes, drawn in a hidden window."""
    with _hidden(surfaces) as scene:
        return [scene.depth(view, resolution) for view in views]


@contextmanager
def _hidden(surfaces):
    with hidden_window() as (_, renderer):
        scene = _Scene(renderer, surfaces)
        try:
            yield scene
        finally:
            scene.release()


class _Scene:
    """Meshes in a hidden window, around the origin so that no place is too far for floats."""

    def __init__(self, renderer, surfaces):
        self.renderer = renderer
        self.bounds = bounds_of(surfaces)
        corner = corners(self.bounds).reshape(-1, 3)
        self.center = (corner.min(0) + corner.max(0)) / 2 if len(corner) else np.zeros(3)
        self.actors = [_actor(s, self.center) for s in surfaces if s.n_points]
        for actor in self.actors:
            renderer.AddActor(actor)
        self.drawer = Drawer(renderer)
        self._map = None

    def depth(self, view, resolution):
        """Return what a view in world units sees, (n, n)."""
        if self._map is None:
            self._map = DepthView(self.drawer, 1, resolution)
        shift = np.eye(4)
        shift[:3, 3] = self.center
        moved = replace(view, view_from_world=view.view_from_world @ shift)
        self._map.update(Frame.of(self.renderer), [moved], Casters(self.actors))
        return self._map.texture.download()[..., 0]

    def release(self):
        if self._map is not None:
            self._map.release()
        self.drawer.release()
        self.renderer.RemoveAllViewProps()
        for actor in self.actors:
            actor.ReleaseGraphicsResources(self.renderer.GetRenderWindow())


def _actor(surface, center):
    mapper = _vtk.vtkPolyDataMapper()
    mapper.SetInputData(_with_points(surface, surface.points - center))
    mapper.ScalarVisibilityOff()
    actor = _vtk.vtkActor()
    actor.SetMapper(mapper)
    return actor


# -- light --------------------------------------------------------------------------------------


def _check_light(light, samples, extent):
    if not hasattr(light, 'GetConeAngle') or not light.LightTypeIsSceneLight():
        msg = f"light is {light!r:.100}; it must be a pyvista.Light of light_type 'scene light'."
        raise ValueError(msg)
    if light.GetPosition() == light.GetFocalPoint():
        msg = f'light.position and focal_point are both {light.GetPosition()}: no direction.'
        raise ValueError(msg)
    if int(samples) != samples or samples < 1:
        msg = f'samples is {samples}; it must be a whole number of 1 or more.'
        raise ValueError(msg)
    if samples > 1 and extent is None and light.GetPositional():
        msg = 'extent is None; samples of a positional light need its radius in world units.'
        raise ValueError(msg)


def _scene_light(light):
    renderer = _vtk.vtkOpenGLRenderer()
    renderer.AddLight(light)
    (found,) = lights_of(renderer)
    return found


def _spread(found, samples, extent):
    """Yield lights without extent that stand for one that has it."""
    if samples == 1:
        yield found
        return
    middle, ahead = np.array(found.position), np.array(found.direction)
    helper = np.eye(3)[np.abs(ahead).argmin()]
    right = np.cross(ahead, helper) / np.linalg.norm(np.cross(ahead, helper))
    axes = np.stack([right, np.cross(ahead, right)])
    if not found.positional:
        extent = np.tan(np.radians((_SUN if extent is None else extent) / 2))
    for aside in vogel_disk(int(samples)) * extent @ axes:
        if found.positional:
            yield replace(found, position=tuple(middle + aside))
        else:
            way = ahead + aside
            yield replace(found, direction=tuple(way / np.linalg.norm(way)))


def _lit_side(light, samples) -> int:
    """Return which side of a sheet is turned to a light on the whole, 1 or -1."""
    toward = toward_light(_scene_light(light), samples.points)
    return 1 if (np.einsum('ij,ij->i', samples.normals, toward) @ samples.area) >= 0 else -1


def toward_light(light, points) -> np.ndarray:
    """Return unit vectors to a light, (m, 3)."""
    toward = light.homogeneous()[:3] - (points if light.positional else np.zeros_like(points))
    length = np.linalg.norm(toward, axis=1, keepdims=True)
    return toward / np.where(length > 0, length, 1)


def _views(scene, light, resolution) -> list:
    """Return what a light without extent sees: views and their depth."""
    views = light_views(light, scene.bounds, Frame.of(scene.renderer), resolution, 1)
    return [(view, scene.depth(view, resolution)) for view in views]


def _lit(light, views, samples, sides):
    """Return how much of a light without extent reaches each sample."""
    toward = toward_light(light, samples.points)
    reached = samples.facing(toward, sides) > 0
    if light.kind == 'spot':
        reached &= -toward @ np.array(light.direction) > np.cos(np.radians(light.cone))
    normals = samples.turned(toward)
    matrices = [v.texture_from_world()[3] for v, _ in views]
    ahead = [samples.points @ m[:3] + m[3] for m in matrices]
    nearest = np.argmax(ahead, axis=0)
    found = np.zeros(len(normals))
    for k, (view, depth) in enumerate(views):
        rows = np.flatnonzero(reached & (nearest == k))
        if len(rows):
            points, turned = samples.points[rows], normals[rows]
            found[rows] = depth_test.seen(view, depth, points, turned, _OFFSET)
    return found


class Reach:
    """How much of some lights reaches places among meshes, which are drawn once for each light."""

    def __init__(self, surfaces, lights, resolution, samples=1, extents=()):
        self._places: list = []
        extents = list(extents) or [None] * len(lights)
        if not any(surface.n_points for surface in surfaces):
            self._places = [[] for _ in lights]
            return
        with _hidden(surfaces) as scene:
            for light, extent in zip(lights, extents, strict=True):
                places = _spread(light, samples, extent)
                self._places.append([(p, _views(scene, p, resolution)) for p in places])

    def of(self, number, samples) -> np.ndarray:
        """Return how much of a light reaches samples that are turned to it, (m,), 0 to 1."""
        places = self._places[number]
        if not places:
            return np.ones(len(samples.points))
        return np.mean([_lit(place, views, samples, 0) for place, views in places], axis=0)
