"""Measure projected pictures against rays and against the photographs."""

from __future__ import annotations

from functools import partial

import numpy as np

import pvibr
from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.light_scenes import SCENES, VIEW_ANGLE, WINDOWS, light_at, place
from benchmarks.common.rays import Rays, edge_band
from benchmarks.common.timing import least
from benchmarks.common.whole_frames import turning
from pvibr.maths.octahedral import frame
from pvibr.maths.pinhole import Pinhole
from pvibr.visibility.surface_samples import Samples

#: Pixels of the photograph, and a lens that bends its corners by a tenth.
SIZE = (1280, 720)
LENS = (-0.25, 0.08, 1e-3, -5e-4)
#: In percent and decibels.
BAR, PSNR_BAR = 0.3, 35.0
_GREEN = np.full((SIZE[1], SIZE[0], 3), (0.0, 1.0, 0.0))


def camera_of(scene, lens=()) -> Pinhole:
    """Return a camera where a scene's spot light is, which sees what it lights."""
    spot = scene.lights['spot']
    focus = 0.5 * SIZE[0] / np.tan(np.radians(spot.cone_angle))
    return _looking(spot.position, spot.focal_point, focus, lens)


def _looking(eye, at, focus, lens=()):
    eye, at = np.array(eye, float), np.array(at, float)
    ahead = (at - eye) / np.linalg.norm(at - eye)
    turn = frame(-ahead) * [[1], [-1], [-1]]  # y goes down
    K = [[focus, 0, (SIZE[0] - 1) / 2], [0, focus, (SIZE[1] - 1) / 2], [0, 0, 1]]
    return Pinhole(np.array(K), turn, -turn @ eye, SIZE, lens)


def _lamp(camera):
    return light_at(camera.position, cone=90)


def _inside(camera, points):
    uv, _ = camera.project(points)
    with np.errstate(invalid='ignore'):
        return ((uv >= 0) & (uv <= 1)).all(1)


class _Truth:
    """What a camera paints of a scene in a window, by rays."""

    def __init__(self, scene, window, camera):
        self.scene, self.window, self.camera = scene, window, camera
        rays = Rays(scene.meshes)
        with scene.stage('spot', window) as stage:
            surface = rays.surface(stage.frame())
        lit = rays.lit(surface.points, surface.normals, _lamp(camera))
        inside = _inside(camera, surface.points.reshape(-1, 3)).reshape(lit.shape)
        self.painted = lit * inside
        self.counts = surface.hit & ~edge_band(self.painted, surface)

    def errors(self, **settings):
        """Return leaks and holes in percent, and the ms that a frame takes longer."""
        with self.scene.stage('spot', self.window) as stage:
            photo = stage.plotter.ibr.add(pvibr.Projector(_GREEN, self.camera, **settings))
            found = stage.picture()
            ms = _extra(stage, photo)
        painted = found[..., 1] - found[..., 0] > 0.5
        off, on = (self.counts & (self.painted == k) for k in (0, 1))
        return 100 * painted[off].mean(), 100 * (~painted[on]).mean(), ms


def _extra(stage, photo, turns=5):
    """Return the ms that a frame takes longer, by turns in one run."""

    def shown(on):
        photo.enabled = on
        stage.draw()
        return stage.draw()

    times = least(turns, {on: partial(shown, on) for on in (True, False)})
    return 1e3 * (times[True] - times[False])


def _placed(settings):
    """Yield scenes at several offsets, and what they are called."""
    for name in settings.scenes:
        for offset in settings.offsets:
            yield place(SCENES[name](), offset=offset), name, f'at {offset:g} sizes', offset == 0


def _painted(settings, results):
    for scene, name, where, near in _placed(settings):
        for window in settings.windows if near else settings.windows[-1:]:
            leak, hole, ms = _Truth(scene, window, camera_of(scene, LENS)).errors()
            what = f'{name}, {window[0]}x{window[1]}, {where}'
            yield Row(f'leak: {what}', leak, '%', BAR)
            yield Row(f'hole: {what}', hole, '%', BAR)
            yield Row(f'extra time: {what}', ms, 'ms')


def _own(settings, results):
    """Compare the picture seen from its own camera with the photograph, where it is seen."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    waves = [np.sin(x * a + y * b) for a, b in ((0.31, 0.05), (-0.11, 0.23), (0.02, -0.41))]
    photo = np.rint(127 + 100 * np.stack(waves, -1)).astype(np.uint8)
    focus = 0.5 * SIZE[1] / np.tan(np.radians(VIEW_ANGLE / 2))
    for scene, name, where, _ in _placed(settings):
        eye, at, _ = scene.camera
        with scene.stage('spot', SIZE) as stage:
            surface = Rays(scene.meshes).surface(stage.frame())
            stage.plotter.ibr.add(pvibr.Projector(photo, _looking(eye, at, focus)))
            sure = surface.hit & ~edge_band(surface.hit.astype(float), surface)
            error = (255 * stage.picture() - photo)[sure]
        found = 10 * np.log10(255**2 / max(np.mean(error**2), 1e-4))
        yield Row(f'own camera: {name}, {where}', found, 'dB', PSNR_BAR, at_least=True)


def _data(settings, results):
    """Compare what visible, shadow_mask and bake say with rays, cell by cell."""
    for name in settings.scenes:
        scene = SCENES[name]()
        camera = camera_of(scene)
        mesh = max(scene.meshes, key=lambda m: m.n_cells)
        others = [m for m in scene.meshes if m is not mesh]
        samples = Samples.of(mesh, 'cells')
        # One side, whose normals they are: a face seen from behind is dark.
        lit = Rays(scene.meshes).lit(samples.points, samples.normals, _lamp(camera)) == 1
        true = lit & _inside(camera, samples.points)
        how = {'to': 'cells', 'two_sided': False, 'method': 'map'}
        seen = pvibr.visible(mesh, camera, casters=others, **how)
        mask = pvibr.shadow_mask(mesh, _lamp(camera), others, **how) > 0.5
        for what, found, truth in (('visible', seen, true), ('shadow_mask', mask, lit)):
            counts = _alike(mesh, truth)
            for kind, rows in (('leak', counts & ~truth), ('hole', counts & truth)):
                if rows.any():
                    wrong = 100 * (found != truth)[rows].mean()
                    yield Row(f'{what}: {name}, {kind}', wrong, '% of cells', BAR)


def _alike(mesh, truth):
    """Return the cells that have the same truth as all that share a corner with them."""
    low, high = np.full(mesh.n_points, 2), np.full(mesh.n_points, -1)
    for corner in mesh.regular_faces.T:
        np.minimum.at(low, corner, truth.astype(int))
        np.maximum.at(high, corner, truth.astype(int))
    return (low == high)[mesh.regular_faces].all(1)


def _resolution(settings, results):
    for name in settings.scenes:
        scene = SCENES[name]()
        truth = _Truth(scene, settings.windows[-1], camera_of(scene, LENS))
        found = results.points[name] = []
        for texels in settings.resolutions:
            leak, hole, ms = truth.errors(resolution=texels)
            found.append({'texels': texels, 'leak': leak, 'hole': hole, 'ms': ms})


def plot(points, figure):
    """Draw leaks and holes against the texels of the depth view."""
    both = plots.subplots(figure, 1, 2, sharey=True)
    for axes, kind in zip(both, ('leak', 'hole'), strict=True):
        for name, found in points.items():
            plots.curve(axes, found, 'texels', kind, label=name)
        plots.bar(axes, BAR)
        axes.set_xscale('log', base=2)
        axes.set_yscale('symlog', linthresh=0.01)
        axes.set(xlabel='texels along a side of the depth view', ylabel=f'{kind}s, % of pixels')


def _projected(settings, size, on):
    """Return a scene with a photograph on it, or without."""
    scene = SCENES[settings.scenes[0]]()
    plotter = scene.plotter('spot', size)
    if on:
        plotter.ibr.add(pvibr.Projector(_GREEN, camera_of(scene, LENS)))
    return plotter, turning(plotter)


BENCH = Bench(
    parts={
        'leaks and holes': _painted,
        'own camera': _own,
        'data': _data,
        'resolution': _resolution,
    },
    plot=plot,
    outside={'a projected picture': _projected},
    settings={
        'scenes': (('spheres', 'terrain', 'tree', 'airplane', 'statue'), ('spheres',)),
        'windows': (WINDOWS, ((400, 225),)),
        'offsets': ((0.0, 1e6, 1e9), (0.0,)),
        'resolutions': ((512, 1024, 2048, 4096), (512, 1024)),
    },
)
