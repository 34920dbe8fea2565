"""Measure the scenes by which a GPU is judged: frames, Python's share, and what is counted."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

import pvibr
from benchmarks.common import whole_frames
from benchmarks.common.frame_counts import calls_in
from benchmarks.common.harness import Bench, Row
from pvibr.cli.timing import medians_ms, spent
from pvibr.core import _vtk
from pvibr.scenes.walker import walker

#: Settings of each effect, as users add it.
_EFFECTS: dict[str, dict] = {
    'Bloom': {'threshold': 0.8},
    'ToneMapping': {'curve': 'aces', 'auto': True},
    'Outline': {},
    'AmbientOcclusion': {},
    'DepthOfField': {},
    'Shadows': {'method': 'pcf'},
}


def _places(count, spread=1.0):
    rng = np.random.default_rng(0)
    return rng.uniform(-1, 1, (count, 3)) * (1, 1, 0.05) * spread * count**0.5


def _ball(triangles):
    side = max(int((triangles / 2) ** 0.5), 6)
    return pv.Sphere(theta_resolution=side, phi_resolution=side)


def _looking(plotter, reach):
    """Return a plotter that looks over a field."""
    plotter.camera_position = [(1.1 * reach, -1.2 * reach, 0.5 * reach), (0, 0, 0), (0, 0, 1)]
    return plotter, whole_frames.turning(plotter)


def _copies(count, triangles, settings, size, on):
    """Draw copies of a mesh as instances, or by VTK's glyphs."""
    places, mesh = _places(count), _ball(triangles)
    plotter = whole_frames.real_plotter(size)
    if on:
        plotter.ibr.add_instances(mesh, places)
    else:
        plotter.add_actor(_glyphs(places, mesh), reset_camera=False)
    return _looking(plotter, count**0.5)


def _parts(settings, size, on):
    """Draw unlike parts, a quarter of them with edges, as impostors or as meshes."""
    plotter, rng = whole_frames.real_plotter(size), np.random.default_rng(1)
    actors = []
    for k, at in enumerate(_places(settings.parts)):
        mesh = _ball(settings.part_triangles).scale(rng.uniform(0.3, 0.6, 3)).translate(at)
        actors.append(plotter.add_mesh(mesh, color=rng.uniform(0, 1, 3), show_edges=k % 4 == 0))
    if on:
        plotter.ibr.add_impostor(actors)
    return _looking(plotter, settings.parts**0.5)


def _spheres(name, settings, size, on):
    """Draw lit spheres with an effect, or without."""
    plotter = whole_frames.real_plotter(size)
    for at in _places(30):
        plotter.add_mesh(_ball(3_000).translate(at), color='white', specular=1.0)
    if on:
        plotter.ibr.add(getattr(pvibr, name)(**_EFFECTS[name]))
    return _looking(plotter, 30**0.5)


def _crowd(settings, results):
    """Yield frames of a crowd in which time moves, or the camera, with shadows and without."""
    count = settings.crowd
    for shadows in (False, True):
        plotter = whole_frames.real_plotter(settings.size)
        figures = plotter.ibr.add_animated(walker(3_000), _places(count, 0.6), cache=True)
        figures.times = np.random.default_rng(2).uniform(0, 1, count)
        if shadows:
            plotter.add_mesh(pv.Plane(i_size=3 * count**0.5, j_size=3 * count**0.5))
            plotter.ibr.add(pvibr.Shadows())
        _, turn = _looking(plotter, 0.6 * count**0.5)
        plotter.show(auto_close=False)

        def play(k, plotter=plotter):
            plotter.ibr.time = 0.04 * k
            plotter.render_window.Render()

        title = f'crowd of {count:,}' + (' with shadows' if shadows else '')
        for what, draw in (('time moves', play), ('camera moves', turn)):
            yield from _frames(f'{title}, {what}', plotter, draw, settings, results)
        plotter.close()


def _counted(settings, results):
    """Yield the times and counts of pvibr's scenes beside VTK's own."""
    for name, make in _makers(settings).items():
        both = {}
        for on in (False, True):
            plotter, draw = make(settings, settings.size, on)
            plotter.show(auto_close=False)
            who = 'pvibr' if on else 'without'
            rows = list(_frames(f'{name}, {who}', plotter, draw, settings, results))
            both[who] = rows[0].value
            yield from rows
            plotter.close()
        yield Row(f'{name}: without over pvibr', both['without'] / both['pvibr'], 'x')


def _frames(title, plotter, draw, settings, results):
    """Yield the milliseconds and the counts of frames; keep them for the plot."""
    for k in range(3):  # uploads, compiles and settles
        draw(k)
    times = [spent(plotter.render_window, partial(draw, 3 + k)) for k in range(settings.frames)]
    wall = medians_ms(times)['wall']
    results.points[title] = wall
    yield Row(f'{title}: a frame', wall, 'ms')
    if plotter.ibr.effects:
        report = plotter.ibr.report()
        yield Row(f'{title}: in Python and its calls', sum(r.ms for r in report.rows), 'ms')
        for what, value in vars(report.counts).items():
            yield Row(f'{title}: {what}', value)
        yield Row(f'{title}: Python calls', calls_in(partial(draw, 3 + settings.frames)))


def _glyphs(places, mesh):
    """Return an actor of VTK's glyphs."""
    mapper = _vtk.vtkGlyph3DMapper()
    mapper.SetInputDataObject(pv.PolyData(places))
    mapper.SetSourceData(mesh)
    mapper.ScalingOff()
    mapper.ScalarVisibilityOff()
    actor = pv.Actor()
    actor.SetMapper(mapper)
    return actor


def _makers(settings) -> dict[str, whole_frames.Maker]:
    """Return what draws each scene, with pvibr or without, by name."""
    makers: dict[str, whole_frames.Maker] = {
        f'{count:,} copies of {triangles:,} triangles': partial(_copies, count, triangles)
        for count, triangles in settings.copies
    }
    makers[f'{settings.parts} unlike parts'] = _parts
    return makers | {f'30 spheres, {name}': partial(_spheres, name) for name in settings.effects}


def _plot(points, figure):
    axes = figure.subplots()
    axes.barh(list(points), list(points.values()))
    axes.set_xlabel('ms a frame, wall')
    axes.grid(axis='x')


BENCH = Bench(
    parts={'scenes': _counted, 'crowd': _crowd},
    plot=_plot,
    outside={'bloom of 30 spheres': partial(_spheres, 'Bloom')},
    settings={
        'size': ((1280, 720), (160, 90)),
        'frames': (25, 2),
        'copies': (((10_000, 20_000), (10_000, 48_000), (1_000_000, 20_000)), ((200, 200),)),
        'parts': (800, 12),
        'part_triangles': (11_750, 500),
        'crowd': (4_000, 20),
        'effects': (tuple(_EFFECTS), ('Bloom', 'ToneMapping')),
    },
)
