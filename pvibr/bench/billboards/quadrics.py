"""Cylinders and ellipsoids against VTK's own ways, and against rays."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.bench.billboards.spheres import EYES, picture_error
from pvibr.bench.common.harness import Row
from pvibr.bench.common.peers import glyph_mapper
from pvibr.bench.common.timing import least_ms
from pvibr.core import _vtk
from pvibr.maths.quadric_rays import meet_cylinders, meet_ellipsoids

_SIDES = 12  # of a tube, and of a sphere around
_SOME = 100  # of the pictures that are compared with rays


def measure(settings, results):
    """Yield times and errors."""
    kinds = {
        'cylinders': (_bars, _cylinders, {'tube filter': _tubes, 'glyph mapper': _glyphs}),
        'ellipsoids': (_eggs, _ellipsoids, {'vtkTensorGlyph': _tensors}),
    }
    for name, (make, put, peers) in kinds.items():
        things = make(settings.quadrics)
        ms = least_ms(settings.size, partial(put, things=things), EYES)
        yield Row(f'{settings.quadrics:,} {name}', ms, 'ms')
        for peer, theirs in peers.items():
            other = least_ms(settings.size, partial(theirs, things=things), EYES)
            yield Row(f'{settings.quadrics:,} {name}, {peer}', other, 'ms')
            text = f'{settings.quadrics:,} {name}, faster than {peer}'
            yield Row(text, other / ms, 'x', at_least=True)
        error = _ERRORS[name](settings.size)
        yield Row(f'{name}, largest difference from rays, no edges', error, '/255', 1.0)


def _bars(count, radius=0.01):
    """Return ends and radii."""
    rng = np.random.default_rng(0)
    middles, halves = rng.uniform(-1, 1, (count, 3)), rng.normal(0, 2.5 * radius, (count, 3))
    return middles - halves, middles + halves, np.full(count, radius)


def _eggs(count, largest=0.03):
    """Return centres, radii and axes."""
    rng = np.random.default_rng(0)
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    return rng.uniform(-1, 1, (count, 3)), rng.uniform(0.3, 1, (count, 3)) * largest, turns


def _cylinders(pl, things, **looks):
    pl.ibr.add_cylinders(*things, **looks)


def _lines(bars):
    points = np.stack(bars[:2], 1).reshape(-1, 3)
    cells = np.c_[np.full(len(bars[0]), 2), np.arange(len(points)).reshape(-1, 2)]
    return pv.PolyData(points, lines=cells)


def _tubes(pl, things):
    tubes = _lines(things).tube(radius=float(things[2][0]), n_sides=_SIDES, capping=True)
    pl.add_mesh(tubes, smooth_shading=False)


def _glyphs(pl, things):
    """Draw one cylinder by instancing: turned along a vector and scaled by another."""
    first, second, radii = things
    run = second - first
    length = np.linalg.norm(run, axis=1)
    cloud = pv.PolyData((first + second) / 2)
    cloud['run'], cloud['size'] = run, np.c_[length, radii, radii]
    mapper = glyph_mapper(
        cloud, pv.Cylinder(direction=(1, 0, 0), radius=1.0, resolution=_SIDES), 'run', 'size'
    )
    mapper.SetOrientationModeToDirection()
    actor = pv.Actor()
    actor.SetMapper(mapper)
    pl.renderer.AddActor(actor)


def _ellipsoids(pl, things, **looks):
    pl.ibr.add_ellipsoids(*things, **looks)


def _tensors(pl, things):
    centers, radii, turns = things
    cloud = pv.PolyData(centers)
    cloud['tensor'] = (turns * radii[:, None]).swapaxes(1, 2).reshape(-1, 9)
    cloud.GetPointData().SetActiveTensors('tensor')
    glyph = _vtk.vtkTensorGlyph()
    ball = pv.Sphere(radius=1.0, theta_resolution=_SIDES, phi_resolution=_SIDES)
    glyph.SetSourceData(ball)
    glyph.SetInputData(cloud)
    glyph.ExtractEigenvaluesOff()
    glyph.ColorGlyphsOff()
    glyph.Update()
    pl.add_mesh(pv.wrap(glyph.GetOutput()), smooth_shading=False)


def _cylinder_error(size):
    bars = _bars(_SOME, radius=0.06)
    halves = (bars[1] - bars[0]) / 2
    put = partial(_cylinders, things=bars)
    return picture_error(size, put, meet_cylinders, bars[0] + halves, halves, bars[2])


def _ellipsoid_error(size):
    eggs = _eggs(_SOME, largest=0.2)
    put = partial(_ellipsoids, things=eggs)
    return picture_error(size, put, meet_ellipsoids, eggs[0], eggs[2] * eggs[1][:, None])


_ERRORS = {'cylinders': _cylinder_error, 'ellipsoids': _ellipsoid_error}
