"""Measure one large mesh by patches against the mesh itself, and against a plane."""

from __future__ import annotations

import contextlib
import itertools
import os
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped]
import pyvista as pv

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.timing import timed
from benchmarks.common.whole_frames import real_plotter, turning
from benchmarks.moving import Mouse
from pvibr.cli.timing import spent
from pvibr.large.build import build_hierarchy
from pvibr.large.draft import NEXT_POINTS, build_draft
from pvibr.large.sources import source_of
from pvibr.large.stored import load
from pvibr.large.workers import worker_count
from pvibr.maths.flip import flip

_LOOK = {'scalars': 'pattern', 'smooth_shading': True, 'show_scalar_bar': False}
#: Frames of a flight of which one is drawn in full as well.
_EVERY = 8
#: Detail and error of pictures at rest, and FLIP asked of each mesh.
_AT_REST: dict = {
    ('none', 1.0): {},
    ('normals', 1.0): {'terrain': 1.6, 'folded': 2.0},
    ('normals', 0.25): {'terrain': 1.15, 'folded': 1.15},
}
#: Frames of a flight in which patches change a few at a time.
_SLOW_FRAMES = 2000
#: Random points of the mesh whose distance from a cut is measured.
_PROBES = 20_000


def _noise(count, seed, falloff):
    """Return fractal heights, (count, count), by spectral synthesis."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal((count, count), np.float32))
    frequency = np.hypot(np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)[None])
    frequency[0, 0] = np.inf
    heights = np.fft.irfft2(spectrum * frequency**-falloff, s=(count, count))
    return heights / heights.std()


@cache
def terrain(triangles) -> pv.PolyData:
    """Return a fractal terrain on the unit square with a fine pattern."""
    count = round((triangles / 2) ** 0.5) + 1
    heights = _noise(count, 11, 1.9)
    grid = pv.ImageData(dimensions=(count, count, 1), spacing=(1 / (count - 1),) * 3)
    mesh = grid.extract_surface(algorithm='dataset_surface').triangulate()
    mesh.points[:, 2] = 0.035 * heights.ravel()
    mesh.clear_data()
    mesh['pattern'] = (heights + 0.3 * _noise(count, 12, 1.2)).ravel()
    return mesh


@cache
def folded(triangles) -> pv.PolyData:
    """Return an isosurface of a bent gyroid, sheets behind sheets."""
    count = round((triangles / 31) ** 0.5)
    axis = np.linspace(-1, 1, count, dtype=np.float32)
    x, y, z = np.meshgrid(axis, axis, axis, indexing='ij')
    bend = 0.25 * np.sin(3 * y + 2 * z) + 0.1 * np.sin(11 * z + 5 * x)
    a, b, c = 9 * (x + bend), 9 * (y + 0.2 * np.sin(4 * x + z)), 9 * (z + bend / 2)
    field = np.sin(a) * np.cos(b) + np.sin(b) * np.cos(c) + np.sin(c) * np.cos(a)
    field += 0.06 * np.sin(61 * x) * np.sin(67 * y) * np.sin(59 * z)
    spacing = (2 / (count - 1),) * 3
    grid = pv.ImageData(dimensions=(count,) * 3, spacing=spacing, origin=(-1, -1, -1))
    grid['field'] = field.ravel(order='F')
    mesh = grid.contour([0.0], scalars='field', method='flying_edges', compute_scalars=False)
    mesh.clear_data()
    mesh['pattern'] = mesh.points[:, 2] + 0.3 * np.sin(20 * mesh.points[:, 0])
    return mesh


MESHES = {'terrain': terrain, 'folded': folded}


def flight(name, frames) -> list:
    """Return cameras that fly over the terrain, or around the folded surface."""
    u = np.linspace(0, 1, frames)[:, None]
    if name == 'terrain':
        w = u**1.5
        eyes = (1 - w) * (0.3, 0.1, 0.16) + w * (0.5, -1.3, 1.25)
        focus = (1 - w) * (0.45, 0.6, 0) + w * (0.5, 0.5, 0)
    else:
        angle, radius = 1.4 * np.pi * u, 2 + 3 * u
        eyes = np.hstack([radius * np.cos(angle), radius * np.sin(angle), 0.8 + 0.8 * u])
        focus = 0.2 * np.hstack([np.sin(angle), np.cos(2 * angle), 0 * u])
    return [(tuple(e), tuple(f), (0, 0, 1)) for e, f in zip(eyes, focus, strict=True)]


def _builds(settings, results):
    """Yield the time of the hierarchy, and of the picture before it is there."""
    for name, make in MESHES.items():
        mesh: Any = source_of(make(settings.triangles)).mesh
        start = _processor_time()
        _, wall = timed(lambda mesh=mesh: build_hierarchy(mesh, workers=worker_count(None)))
        millions = len(mesh.faces) / 1e6
        processor = _processor_time() - start
        yield Row(f'{name}: hierarchy, per million triangles', wall / millions, 's', 12)
        yield Row(f'{name}: the same, processor time', processor / millions, 's')
        _, first = timed(lambda mesh=mesh: build_draft(mesh))
        yield Row(f'{name}: draft of {millions:.1f} million', first, 's', 1.5)
        _, following = timed(lambda mesh=mesh: build_draft(mesh, NEXT_POINTS))
        yield Row(f'{name}: the finer one that follows', following, 's')


def _processor_time() -> float:
    """Return the processor time of this process and of its children that have ended."""
    return sum(os.times()[:4])


def _files(settings, results):
    """Yield what a build out of core takes, and opening its file."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / 'a.ply', Path(folder) / 'a.pvl'
        mesh = terrain(settings.file_triangles)
        millions = mesh.n_cells / 1e6
        mesh.save(path)
        program = 'import sys; from pvibr.cli.app import main; sys.exit(main(sys.argv[1:]))'
        command = [sys.executable, '-c', program, 'build', str(path), '-o', str(out)]
        start = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
            most = _most_memory(process)
        title = f'{millions:.1f} million triangles of a file'
        yield Row(f'{title}: memory of a build, all processes', most / 1e9, 'GB', 3)
        wall = (time.perf_counter() - start) / millions
        yield Row(f'{title}: time of a build, per million', wall, 's', 12)
        yield Row(f'{title}: bytes per triangle', out.stat().st_size / mesh.n_cells, 'B')
        yield Row(f'{title}: opened', timed(lambda: load(out))[1], 's')
        yield from _flight_of_file(settings, title, out, mesh['pattern'])


def _flight_of_file(settings, title, path, values):
    """Yield frames of a flight over the terrain of a file, beside those of a plane, by turns."""
    look = _LOOK | {'scalars': values}  # which PLY files do not hold
    with (
        contextlib.closing(_plotter(settings, 0)) as pl,
        contextlib.closing(_plotter(settings, 0)) as plane,
    ):
        large = pl.ibr.add_large_mesh(path, detail='none', **look)  # as it moves
        _fill_with_plane(plane)
        times: dict = {pl: [], plane: []}
        counts = []
        for plotter in times:
            plotter.show(auto_close=False)
        for camera in flight('terrain', settings.frames):
            pl.camera_position = camera
            for plotter, spents in times.items():
                spents.append(spent(plotter.render_window))
            counts.append(large.report()['triangles'])
    patches, others = (np.array(spents)[2:] for spents in times.values())
    yield Row(f'{title}: a frame of a flight, median', 1e3 * np.median(patches[:, 1]), 'ms', 135)
    yield Row(f'{title}: a frame of a flight, worst', 1e3 * patches[:, 1].max(), 'ms', 230)
    ratios = np.median(patches, axis=0) / np.median(others, axis=0)
    yield Row(f'{title}: the same over a plane that fills the screen, CPU', ratios[0], 'x')
    yield Row(f'{title}: triangles of a frame, median', np.median(counts))


def _most_memory(process) -> int:
    """Return the most memory that a process and its children hold until it ends."""
    most, parent = 0, psutil.Process(process.pid)
    while process.poll() is None:
        held = 0
        with contextlib.suppress(psutil.Error):
            for each in (parent, *parent.children(recursive=True)):
                held += each.memory_info().rss
        most = max(most, held)
        time.sleep(0.1)
    return most


def _flights(settings, results):
    """Yield frames of flights by patches, of the whole mesh, and of a plane, by turns."""
    for samples in (0, 8):
        for name, make in MESHES.items():
            found = _flight(settings, name, make(settings.triangles), samples)
            results.points.setdefault(name, {})[samples] = found
            patches, plane, whole = (np.array(found[k]) for k in ('patches', 'plane', 'whole'))
            title = f'{name}, {samples} samples'
            yield Row(f'{title}: a frame, median', 1e3 * np.median(patches[:, 1]), 'ms')
            yield Row(f'{title}: a frame, worst', 1e3 * patches[:, 1].max(), 'ms')
            ratios = np.median(patches, axis=0) / np.median(plane, axis=0)
            bar = 1.6 if samples else None
            yield Row(f'{title}: over a plane that fills the screen, CPU', ratios[0], 'x', bar)
            faster = np.median(whole, axis=0) / np.median(patches, axis=0)
            yield Row(f'{title}: faster than the whole mesh, CPU', faster[0], 'x')
            yield Row(f'{title}: triangles, median', np.median(found['triangles']))


def _flight(settings, name, mesh, samples) -> dict:
    plotters = {key: _plotter(settings, samples) for key in ('patches', 'plane', 'whole')}
    large = plotters['patches'].ibr.add_large_mesh(mesh, detail='none', **_LOOK)  # as it moves
    plotters['whole'].add_mesh(mesh, **_LOOK)
    _fill_with_plane(plotters['plane'])
    found: dict = {key: [] for key in (*plotters, 'triangles')}
    for plotter in plotters.values():
        plotter.show(auto_close=False)
    for k, camera in enumerate(flight(name, settings.frames)):
        for key, plotter in plotters.items():
            if key != 'plane':
                plotter.camera_position = camera
            if key == 'whole' and k % _EVERY:
                continue
            found[key].append(spent(plotter.render_window))
        found['triangles'].append(large.report()['triangles'])
    for plotter in plotters.values():
        plotter.close()
    return {
        key: values[2:] if key != 'whole' else values[1:] or values
        for key, values in found.items()
    }


def _fill_with_plane(plotter):
    plane = pv.Plane(i_size=50, j_size=50, i_resolution=4, j_resolution=2)
    plane['pattern'] = plane.points[:, 0]
    plotter.add_mesh(plane, **_LOOK)
    plotter.camera_position = 'xy'
    plotter.camera.zoom(20)


def _drags(settings, results):
    """Yield times and errors of drags within a budget of one and a half such planes."""
    with contextlib.closing(_plotter(settings, 8)) as plotter:
        _fill_with_plane(plotter)
        plotter.show(auto_close=False)
        spent(plotter.render_window)
        plane_ms = 1e3 * np.median([spent(plotter.render_window)[1] for _ in range(5)])
    for name, make in MESHES.items():
        with contextlib.closing(_plotter(settings, 8)) as plotter:
            large = plotter.ibr.add_large_mesh(make(settings.triangles), **_LOOK)
            plotter.show(auto_close=False)
            plotter.enable_trackball_style()
            plotter.ibr.interactive_frame_ms = budget_ms = 1.5 * plane_ms
            mouse, times = Mouse(plotter), []
            errors: list[float] = []
            plotter.renderer.AddObserver(
                'EndEvent', lambda *_, of=large, to=errors: to.append(of.report()['error'])
            )
            for camera in flight(name, settings.views):
                times += mouse.drag(camera, settings.drag_frames)['ms']
            late = np.mean(np.array(times) > 1.5 * budget_ms)
        title = f'{name}, dragged within {budget_ms:.0f} ms'
        yield Row(f'{title}: a frame, median', np.median(times), 'ms')
        yield Row(
            f'{title}: frames of more than 1.5 times that', 100 * late, '%', 2, follows_times=True
        )
        yield Row(f'{title}: largest error', max(errors), 'px', 2, follows_times=True)
        yield Row(f'{title}: error, median', np.median(errors), 'px')


def _pops(settings, results):
    """Yield how much frames of slow flights differ from the ones before, beside the mesh's own."""
    for name, make in MESHES.items():
        for samples in (0, 8):
            changes = _changes(settings, name, make(settings.triangles), samples)
            of_mesh, truth = changes.pop('mesh'), changes.pop('supersampled')
            for detail, change in changes.items():
                title = f'{name}, {samples} samples, detail {detail}: change a frame over that of'
                yield Row(f'{title} the mesh', change / of_mesh, 'x', 1.2)
                yield Row(f'{title} the supersampled mesh', change / truth, 'x')


def _changes(settings, name, mesh, samples) -> dict[str, float]:
    """Return the mean FLIP from each frame of slow flights to the next, by what draws them."""
    plotters = {key: _plotter(settings, samples) for key in ('none', 'normals', 'mesh')}
    plotters['supersampled'] = _plotter(settings, 0)
    plotters['supersampled'].enable_anti_aliasing('ssaa')
    for key, plotter in plotters.items():
        if key in ('none', 'normals'):
            plotter.ibr.add_large_mesh(mesh, detail=key, **_LOOK)
        else:
            plotter.add_mesh(mesh, **_LOOK)
    cameras = flight(name, _SLOW_FRAMES)
    changes: dict[str, list[float]] = {key: [] for key in plotters}
    for first in np.linspace(0.1, 0.9, settings.views):
        start = round(first * _SLOW_FRAMES)
        for key, plotter in plotters.items():
            frames = [_picture(plotter, c) for c in cameras[start : start + settings.slow_frames]]
            changes[key] += [flip(a, b).mean() for a, b in itertools.pairwise(frames)]
    for plotter in plotters.values():
        plotter.close()
    return {key: float(np.mean(found)) for key, found in changes.items()}


def _plotter(settings, samples):
    plotter = pv.Plotter(off_screen=True, window_size=settings.size)
    if samples:
        plotter.enable_anti_aliasing('msaa', multi_samples=samples)
    else:
        plotter.disable_anti_aliasing()
    return plotter


def _errors(settings, results):
    """Yield how far the drawn surface is from the mesh, and FLIP of the pictures."""
    for name, make in MESHES.items():
        mesh = make(settings.triangles)
        large, whole, fine = (_plotter(settings, 0) for _ in range(3))
        fine.enable_anti_aliasing('ssaa')
        thing = large.ibr.add_large_mesh(mesh, **_LOOK)
        for plotter in (whole, fine):
            plotter.add_mesh(mesh, **_LOOK)
        over: list[float] = []
        ratios: dict = {case: [] for case in _AT_REST}
        costs: dict = {case: [] for case in (*_AT_REST, 'whole')}
        for camera in flight(name, settings.views):
            truth, own = (_picture(plotter, camera) for plotter in (fine, whole))
            costs['whole'].append(spent(whole.render_window))
            own_error = flip(truth, own).mean()
            for case in _AT_REST:
                thing.detail, thing.max_error = case
                picture = _picture(large, camera)
                costs[case].append(spent(large.render_window))
                ratios[case].append(flip(truth, picture).mean() / own_error)
                if case == ('none', 1.0):
                    over.append((_pixels_off(mesh, thing, large) > thing.max_error).mean())
        yield Row(f'{name}: points over the tolerance', 100 * np.max(over), '%', 0.05)
        for case, bars in _AT_REST.items():
            title = f'{name}, detail {case[0]}, {case[1]} px'
            ratio = np.median(ratios[case])
            yield Row(f'{title}: FLIP over that of the mesh', ratio, 'x', bars.get(name))
            cost, whole_cost = (np.median(costs[k], axis=0)[0] for k in (case, 'whole'))
            yield Row(f'{title}: a frame over one of the mesh, CPU', cost / whole_cost, 'x')
        for plotter in (large, whole, fine):
            plotter.close()


def _picture(plotter, camera):
    plotter.camera_position = camera
    plotter.show(auto_close=False)
    return plotter.screenshot() / np.float32(255)


def _pixels_off(mesh, thing, plotter) -> np.ndarray:
    """Return how many pixels random points of the mesh in view are off what is drawn."""
    rng = np.random.default_rng(5)
    faces = np.asarray(mesh.regular_faces)[rng.integers(0, mesh.n_cells, _PROBES)]
    weights = rng.dirichlet((1, 1, 1), _PROBES)
    points = (np.asarray(mesh.points, float)[faces] * weights[..., None]).sum(1)
    frame = plotter.ibr.pipeline.view()
    clip = np.c_[points, np.ones(len(points))] @ (frame.clip_from_view @ frame.view_from_world).T
    points = points[(np.abs(clip[:, :2]) < 0.98 * clip[:, 3:]).all(1)]
    nearest = thing.cut().find_closest_cell(points, return_closest_point=True)[1]
    distances = np.linalg.norm(points - frame.eye, axis=1)
    return np.linalg.norm(nearest - points, axis=1) * frame.pixel_scale / distances


def plot(points, figure):
    """Draw the time of frames against their triangles."""
    both = plots.subplots(figure, 1, len(points))
    for axes, (name, by_samples) in zip(np.atleast_1d(both), points.items(), strict=True):
        for samples, found in by_samples.items():
            times = 1e3 * np.array(found['patches'])[:, 0]
            axes.plot(found['triangles'], times, '.', label=f'{samples} samples')
            plane = 1e3 * np.median(np.array(found['plane'])[:, 0])
            axes.axhline(plane, ls=':', color='0.5')
        axes.set(title=name, xlabel='triangles', ylim=(0, None))
        axes.set_ylabel('CPU ms a frame; dotted: a plane')


def _over_terrain(settings, size, on):
    """Return a terrain as patches or as it is."""
    pl = real_plotter(size)
    add = pl.ibr.add_large_mesh if on else pl.add_mesh
    add(terrain(settings.triangles), **_LOOK)
    pl.camera_position = flight('terrain', 2)[1]
    return pl, turning(pl)


BENCH = Bench(
    parts={
        'build': _builds,
        'file': _files,
        'flight': _flights,
        'drag': _drags,
        'pops': _pops,
        'error': _errors,
    },
    plot=plot,
    outside={'large mesh': _over_terrain},
    settings={
        'size': ((1280, 720), (160, 90)),
        'triangles': (4_000_000, 40_000),
        'file_triangles': (20_000_000, 40_000),
        'frames': (60, 6),
        'views': (8, 2),
        'drag_frames': (25, 4),
        'slow_frames': (6, 2),
    },
)
