"""A scene with any one thing or effect, wherever it lies and however large it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr
from tests.browser import everything
from tests.browser.everything import DISC, EVERYTHING, RINGS, STRIPES
from tests.pictures import plotter, shot

SIZE = (120, 90)
EYE, FOCUS, UP = np.array([2.0, -11, 6]), np.array([0.0, 0, 0.5]), np.array([0.0, 0, 1])


class Place(NamedTuple):
    """Where a scene lies: turned, then scaled, then moved."""

    scale: float = 1.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: np.ndarray = np.eye(3)

    def points(self, points):
        """Return points of the scene in the world."""
        return self.scale * np.asarray(points, float) @ self.turn.T + self.offset

    def matrices(self, points):
        """Return poses of instances at points of the scene."""
        found = np.tile(np.eye(4), (len(points), 1, 1))
        found[:, :3, :3], found[:, :3, 3] = self.scale * self.turn, self.points(points)
        return found

    def mesh(self, mesh):
        """Return a mesh of the scene in the world, in float64."""
        found = mesh.copy()
        found.clear_data()
        if mesh.active_texture_coordinates is not None:
            found.active_texture_coordinates = mesh.active_texture_coordinates
        found.points = self.points(mesh.points)
        return found

    def camera(self, eye, focus=(0, 0, 0), up=(0, 1, 0)):
        """Return a camera of the scene in the world."""
        camera = pv.Camera()
        camera.position, camera.focal_point = self.points([eye, focus])
        camera.up = self.turn @ np.asarray(up, float)
        return camera


def _cone(pl, place):
    cone = place.mesh(pv.Cone(center=(0, 0, 2.5), height=3, radius=1, resolution=99))
    return pl.add_mesh(cone, name='wall', color='red')


def _wall(pl, place, texture):
    wall = place.mesh(everything._wall())
    pl.add_mesh(wall, lighting=False, texture=texture, name='wall')


def _live(pl, place):
    live = pl.ibr.add(pvibr.LiveTexture(place.camera((0, 0, 9)), size=(128, 128)))
    _wall(pl, place, live.texture)


def _mirror(pl, place):
    corner, right, up = place.points([(-2, 2, 0), (2, 2, 0), (-2, 2, 2)])
    mirror = pl.ibr.add(pvibr.Mirror(corner, right - corner, up - corner))
    _wall(pl, place, mirror.texture)


def _photos(pl, place):
    K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
    R = np.diag([1.0, -1.0, -1.0]) @ place.turn.T
    (eye,) = place.points([(0, 0, 5)])
    camera = pvibr.Pinhole(K, R, -R @ eye, (2048, 1024))
    mesh = pv.Plane(center=(0, 0, 1), i_size=4, j_size=2, i_resolution=8, j_resolution=4)
    pl.ibr.add_photos(place.mesh(mesh), pvibr.Photo('a.jpg', camera, examples.mapfile))


def _figure(pl, place):
    actor = pl.ibr.add_animated(everything._figure(), clip='rise')
    (actor.user_matrix,) = place.matrices([(0, 0, 0)])


def _large_mesh(pl, place):
    hill = pv.Sphere(radius=1.5, center=(0, 1, 1), theta_resolution=120, phi_resolution=120)
    pl.ibr.add_large_mesh(place.mesh(hill), color='tan', smooth_shading=True, cache=False)


def _ground(pl, place):
    """Put the ground where the floor is: by default it is below a box along the axes."""
    up = place.turn @ UP
    height = float(up @ place.points([(0, 0, -0.01)])[0])
    pl.ibr.add(pvibr.Ground(up=tuple(up), height=height))


#: What is added otherwise than by the table of all, as it has a place of its own.
PLACED = {
    'Projector': lambda pl, p: pl.ibr.add(pvibr.Projector(STRIPES, p.camera((0, 0, 9)))),
    'Projector, two images': lambda pl, p: pl.ibr.add(
        pvibr.Projector([STRIPES] * 2, [p.camera((0, 0, 9)), p.camera((3, 0, 8))])
    ),
    'Fog': lambda pl, p: pl.ibr.add(
        pvibr.Fog(2.0 * p.scale, color=(1, 0, 1), up=tuple(p.turn @ UP))
    ),
    'AmbientOcclusion': lambda pl, p: pl.ibr.add(
        pvibr.AmbientOcclusion(radius=0.5 * p.scale, strength=4.0)
    ),
    'Sky': lambda pl, p: pl.ibr.add(pvibr.Sky(up=tuple(p.turn @ UP))),
    'Ground': _ground,
    'DepthOfField': lambda pl, p: pl.ibr.add(
        pvibr.DepthOfField(radius=1.0 * p.scale, distance=4.0 * p.scale)
    ),
    'LiveTexture': _live,
    'Mirror': _mirror,
    'Instances': lambda pl, p: pl.ibr.add_instances(
        pv.Cone(resolution=24), p.matrices(RINGS), color='green'
    ),
    'Billboards': lambda pl, p: pl.ibr.add_billboards(p.points(RINGS), DISC, size=0.9 * p.scale),
    'Spheres': lambda pl, p: pl.ibr.add_spheres(p.points(RINGS), 0.5 * p.scale, color='navy'),
    'Cylinders': lambda pl, p: pl.ibr.add_cylinders(
        p.points(RINGS), p.points(RINGS + np.eye(3)[2]), 0.3 * p.scale, color='navy'
    ),
    'Ellipsoids': lambda pl, p: pl.ibr.add_ellipsoids(
        p.points(RINGS), 0.5 * p.scale, color='navy'
    ),
    'Impostor': lambda pl, p: pl.ibr.add_impostor(_cone(pl, p)),
    'ImageLayers': lambda pl, p: pl.ibr.add_image_layers([_cone(pl, p)]),
    'AnimatedActor': _figure,
    'Crowd': lambda pl, p: pl.ibr.add_animated(
        everything._figure(), p.matrices(RINGS), clip='rise', max_error=8
    ),
    'PhotoMesh': _photos,
    'LargeMesh': _large_mesh,
}


def base(pl, place, *, backwards=False):
    """Put in what there always is: a ball over a floor, a pane, a light."""
    pl.set_background('#405060', top='#8090a0')
    ball = pv.Sphere(center=(-1, -1, 1), radius=0.8)
    pane = pv.Plane(center=(1.5, -2, 1), direction=(0, 1, 0), i_size=1.5, j_size=1.5)
    adds = [
        lambda: pl.add_mesh(place.mesh(pv.Plane(i_size=8, j_size=8)), color='tan', name='floor'),
        lambda: pl.add_mesh(place.mesh(ball), color='orange', smooth_shading=True, name='ball'),
        lambda: pl.add_mesh(place.mesh(pane), color='cyan', opacity=0.4, name='pane'),
    ]
    for add in reversed(adds) if backwards else adds:
        add()
    light = pv.Light(light_type='scene light', intensity=0.7)
    light.position, light.focal_point = place.points([(4, -3, 8), (0, 0, 0)])
    pl.add_light(light, only_active=True)


def look(pl, place, *, parallel=False, depths=None):
    """Look at the scene, at the time that shows everything; near and far in its lengths."""
    pl.camera.position, pl.camera.focal_point = place.points([EYE, FOCUS])
    pl.camera.up = place.turn @ UP
    if parallel:
        pl.camera.parallel_projection, pl.camera.parallel_scale = True, 4 * place.scale
    pl.ibr.time = 0.4
    pl.renderer.ResetCameraClippingRange()
    if depths is not None:
        pl.camera.clipping_range = np.multiply(place.scale, depths)


def fill(pl, name, place, *, backwards=False, **view):
    """Put the scene with one of all into the active subplot."""
    base(pl, place, backwards=backwards)
    PLACED.get(name, lambda pl, _: EVERYTHING[name](pl))(pl, place)
    look(pl, place, **view)


#: About the origin.
HOME = Place()


def picture(name, place=HOME, *, samples=0, lighting='light kit', **how):
    """Return the picture of a scene, and why what of it was not drawn."""
    pl = plotter(SIZE, lighting=lighting)
    pl.render_window.SetMultiSamples(samples)
    fill(pl, name, place, **how)
    pl.show(auto_close=False)
    shot(pl)
    found = shot(pl)
    states = {
        row.name: f'{row.state}: {row.why}' for row in pl.ibr.report().rows if row.state != 'ran'
    }
    pl.close()
    return found, states
