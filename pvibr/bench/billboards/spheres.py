"""Spheres against VTK's own ways, and against rays."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.bench.common.harness import Row
from pvibr.bench.common.timing import least_ms, look, plotter
from pvibr.bench.common.whole_frames import real_plotter, turning
from pvibr.core import _vtk
from pvibr.core.frame import Frame
from pvibr.maths.quadric_rays import cast, inner, meet_spheres

#: Where the camera goes, around a cube of side 2.
EYES = [(0.1 * k, -7.5, 1) for k in range(3)]
_RADIUS = 0.01  # where they fill a cube of side 2
_SPHERES = 300  # of the picture that is compared with rays


def measure(settings, results):
    """Yield times and the error."""
    curves: dict = {}
    for count in settings.counts:
        points = _points(count)
        found = {
            name: least_ms(settings.size, partial(put, points=points), EYES)
            for name, put in _WAYS.items()
        }
        for name, ms in found.items():
            curves.setdefault(name, []).append((count, ms))
            yield Row(f'{count:,} {name}', ms, 'ms')
        million = count == 1_000_000
        for name, bar in (('vtkOpenGLSphereMapper', 1), ('points_gaussian as spheres', 10)):
            ratio = found[name] / found['spheres']
            text = f'{count:,} spheres, faster than {name}'
            yield Row(text, ratio, 'x', bar if million else None, at_least=True)
    results.points['spheres'] = curves
    error = _ray_error(settings.size)
    yield Row('spheres, largest difference from rays, no edges', error, '/255', 1.0)


def balls(settings, size, on):
    """Return spheres, of pvibr or of VTK's mapper."""
    pl = real_plotter(size)
    (_spheres if on else _mapper)(pl, _points(settings.slow))
    look(pl, EYES[0])
    return pl, turning(pl)


def _points(count):
    return np.random.default_rng(0).uniform(-1, 1, (count, 3)).astype(np.float32)


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


def _ray_error(size) -> float:
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
