"""Spheres, cylinders and ellipsoids against VTK's own ways, and against rays."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.billboards.sprites import times_by_count
from benchmarks.common.harness import Row
from benchmarks.common.timing import least_ms
from pvibr.cli.peers import glyph_mapper
from pvibr.core import _vtk
from pvibr.points.quadric_rays import cast, inner, meet_cylinders, meet_ellipsoids, meet_spheres
from pvibr.scenes.stage import Stage

#: The camera's positions around a cube of side 2.
CAMERAS = [((0.1 * k, -7.5, 1), (0, 0, 0), (0, 0, 1)) for k in range(3)]
_RADIUS = 0.01  # of a sphere, where they fill a cube of side 2
_SIDES = 12  # of a tube, and of a sphere around
_SPHERES, _SOME = 300, 100  # things in the pictures that are compared with rays


def measure_spheres(settings, results):
    """Yield times by count."""
    bars = {'vtkOpenGLSphereMapper': 1, 'points_gaussian as spheres': 10}
    ways = {'spheres': spheres, 'vtkOpenGLSphereMapper': sphere_mapper}
    ways['points_gaussian as spheres'] = _gaussian
    yield from times_by_count(settings, results, 'spheres', lambda count: ways, CAMERAS, bars)


def measure(settings, results):
    """Yield the times of cylinders and ellipsoids, and the errors of all quadrics."""
    peers = {
        'cylinders': (_bars, {'tube filter': _tubes, 'glyph mapper': _glyphs}),
        'ellipsoids': (_eggs, {'vtkTensorGlyph': _tensors}),
    }
    for name, (make, theirs) in peers.items():
        things, what = make(settings.quadrics), f'{settings.quadrics:,} {name}'
        own = least_ms(settings.size, partial(_add, name=name, things=things), CAMERAS)
        yield Row(what, own, 'ms')
        for peer, put in theirs.items():
            other = least_ms(settings.size, partial(put, things=things), CAMERAS)
            yield Row(f'{what}, {peer}', other, 'ms')
            yield Row(f'{what}, faster than {peer}', other / own, 'x', at_least=True)
    yield from _errors(settings.size)


def spheres(pl, points):
    """Add spheres of pvibr."""
    pl.ibr.add_spheres(points, _RADIUS)


def sphere_mapper(pl, points):
    """Add spheres of VTK's mapper."""
    mapper = _vtk.vtkOpenGLSphereMapper()
    mapper.SetInputData(pv.PolyData(points))
    mapper.SetRadius(_RADIUS)
    _add_mapper(pl, mapper)


def _gaussian(pl, points):
    # In units of the diagonal of the bounds over 1300: as large as the others.
    size = _RADIUS * 1300 / np.linalg.norm(np.ptp(points, 0))
    looks = {'style': 'points_gaussian', 'render_points_as_spheres': True, 'emissive': False}
    pl.add_mesh(pv.PolyData(points), point_size=size, **looks)


def _add(pl, name, things, **looks):
    getattr(pl.ibr, f'add_{name}')(*things, **looks)


def _add_mapper(pl, mapper):
    actor = pv.Actor()
    actor.SetMapper(mapper)
    pl.renderer.AddActor(actor)


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


def _tubes(pl, things):
    first, second, radii = things
    points = np.stack([first, second], 1).reshape(-1, 3)
    cells = np.c_[np.full(len(first), 2), np.arange(len(points)).reshape(-1, 2)]
    lines = pv.PolyData(points, lines=cells)
    tubes = lines.tube(radius=float(radii[0]), n_sides=_SIDES, capping=True)
    pl.add_mesh(tubes, smooth_shading=False)


def _glyphs(pl, things):
    """Draw one cylinder by instancing: turned along a vector and scaled by another."""
    first, second, radii = things
    run = second - first
    length = np.linalg.norm(run, axis=1)
    cloud = pv.PolyData((first + second) / 2)
    cloud['run'], cloud['size'] = run, np.c_[length, radii, radii]
    rod = pv.Cylinder(direction=(1, 0, 0), radius=1.0, resolution=_SIDES)
    mapper = glyph_mapper(cloud, rod, 'run', 'size')
    mapper.SetOrientationModeToDirection()
    _add_mapper(pl, mapper)


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


def _errors(size):
    """Yield the errors of pictures of a few large quadrics."""
    rng = np.random.default_rng(0)
    balls = rng.uniform(-1, 1, (_SPHERES, 3)), rng.uniform(0.03, 0.2, _SPHERES)
    bars, eggs = _bars(_SOME, radius=0.06), _eggs(_SOME, largest=0.2)
    halves = (bars[1] - bars[0]) / 2
    for name, things, meet, met in (
        ('spheres', balls, meet_spheres, balls),
        ('cylinders', bars, meet_cylinders, (bars[0] + halves, halves, bars[2])),
        ('ellipsoids', eggs, meet_ellipsoids, (eggs[0], eggs[2] * eggs[1][:, None])),
    ):
        error = _picture_error(size, partial(_add, name=name, things=things), meet, met)
        yield Row(f'{name}, largest difference from rays, no edges', error, '/255', 1.0)


def _picture_error(size, put, meet, things) -> float:
    """Return the largest difference of a picture from rays in double precision, of 255."""
    headlight = pv.Light(light_type='headlight')
    with Stage(size, background='black', lights=[headlight], multi_samples=0) as stage:
        put(stage.plotter, color='white', diffuse=1.0)
        stage.look([(0, -6, 1), (0, 0, 0), (0, 0, 1)])
        picture = 255 * stage.picture()[..., 0]
        ids, _, normals = cast(stage.frame(), meet, *things)
    expected = 255 * np.where(ids >= 0, np.maximum(normals[..., 2], 0), 0)
    # Creases within one thing are edges too.
    turns = [np.abs(np.roll(normals, k, a) - normals).max(-1) for a in (0, 1) for k in (-1, 1)]
    good = inner(ids) & (np.max(turns, 0) < 0.5)
    return float(np.abs(picture - expected)[good].max())
