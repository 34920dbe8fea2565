"""Spheres against VTK's own ways, and against rays."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.bench.rows import Row
from pvibr.bench.sprites import frame_ms
from pvibr.core import _vtk
from pvibr.core.frame import Frame
from pvibr.maths.quadric_rays import cast, inner, meet_spheres

_RADIUS = 0.01  # where they fill a cube of side 2
_VIEWS = 3
_SPHERES = 300  # of the picture that is compared with rays


def measure(settings, results):
    """Measure times and the error."""
    curves: dict = {}
    for count in settings.counts:
        points = np.random.default_rng(0).uniform(-1, 1, (count, 3)).astype(np.float32)
        found = {name: least_ms(put, points, settings.size) for name, put in _WAYS.items()}
        for name, ms in found.items():
            curves.setdefault(name, []).append((count, ms))
            results.rows.append(Row(f'{count:,} {name}', ms, 'ms'))
        million = count == 1_000_000
        for name, bar in (('vtkOpenGLSphereMapper', 1), ('points_gaussian as spheres', 10)):
            ratio = found[name] / found['spheres']
            text = f'{count:,} spheres, faster than {name}'
            results.rows.append(Row(text, ratio, 'x', bar if million else None, at_least=True))
    results.points['spheres'] = curves
    error = ray_error(settings.size)
    results.rows.append(Row('spheres, largest difference from rays, no edges', error, '/255', 1.0))


def _spheres(pl, points):
    pl.ibr.add_spheres(points, _RADIUS)


def _mapper(pl, points):
    actor = pv.Actor()
    mapper = _vtk.vtkOpenGLSphereMapper()
    mapper.SetInputData(pv.PolyData(points))
    mapper.SetRadius(_RADIUS)
    actor.SetMapper(mapper)
    pl.renderer.AddActor(actor)


def _gaussian(pl, points):
    # In units of the diagonal of the bounds over 1300: as large as the others.
    size = _RADIUS * 1300 / np.linalg.norm(np.ptp(points, 0))
    pl.add_mesh(
        pv.PolyData(points),
        style='points_gaussian',
        render_points_as_spheres=True,
        emissive=False,
        point_size=size,
    )


_WAYS = {
    'spheres': _spheres,
    'vtkOpenGLSphereMapper': _mapper,
    'points_gaussian as spheres': _gaussian,
}


def least_ms(put, things, size) -> float:
    """Return the least milliseconds of a frame while the camera moves."""
    pl = plotter(size)
    put(pl, things)
    found = []
    for k in range(_VIEWS):
        look(pl, (0.1 * k, -7.5, 1))
        found.append(frame_ms(pl))
    pl.close()
    return min(found[1:])


def plotter(size, **kwargs):
    """Return an empty plotter that smooths nothing."""
    pl = pv.Plotter(off_screen=True, window_size=list(size), **kwargs)
    pl.disable_anti_aliasing()
    return pl


def look(pl, eye):
    """Look at the origin."""
    pl.camera.position, pl.camera.focal_point, pl.camera.up = eye, (0, 0, 0), (0, 0, 1)
    pl.renderer.ResetCameraClippingRange()


def ray_error(size) -> float:
    """Return the largest difference of a picture of spheres from rays, of 255."""
    rng = np.random.default_rng(0)
    centers, radii = rng.uniform(-1, 1, (_SPHERES, 3)), rng.uniform(0.03, 0.2, _SPHERES)

    def put(pl, **looks):
        pl.ibr.add_spheres(centers, radii, **looks)

    return picture_error(size, put, meet_spheres, centers, radii)


def picture_error(size, put, meet, *things) -> float:
    """Return the largest difference of a picture from rays in double precision, of 255."""
    pl = plotter(size, lighting='none')
    pl.set_background('black')
    pl.add_light(pv.Light(light_type='headlight'))
    put(pl, color='white', diffuse=1.0)
    look(pl, (0, -6, 1))
    picture = pl.screenshot(None, return_img=True)[..., 0].astype(float)
    ids, _, normals = cast(Frame.of(pl.renderer), meet, *things)
    pl.close()
    expected = 255 * np.where(ids >= 0, np.maximum(normals[..., 2], 0), 0)
    # Creases within one thing are edges too.
    turns = [np.abs(np.roll(normals, k, a) - normals).max(-1) for a in (0, 1) for k in (-1, 1)]
    good = inner(ids) & (np.max(turns, 0) < 0.5)
    return float(np.abs(picture - expected)[good].max())
