"""Single meshes, small on the screen: whichever level is drawn must not be worse than the mesh."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.meshes import MESHES
from benchmarks.common.timing import mean_flip
from pvibr.instances.atlas import bounding_sphere
from pvibr.maths.image_error import displacements
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import MULTI_SAMPLES, SAMPLES, Stage, covered, mesh_actors

#: Vertical angle in degrees and height in pixels of the window that the views are cut from.
VIEW_ANGLE, HEIGHT = 30.0, 720
#: Pixels around the object.
ROOM = 16
#: Displacement that the bar allows beyond max_error: outlines are known to whole pixels.
SLACK = 0.5
#: The name of the full mesh drawn once per pixel: even that is not where many samples put it.
ONCE = 'mesh at one sample'
#: Mean FLIP below which a ratio says nothing: nothing can be seen.
FLOOR = 1e-4
#: Offsets in sizes of the scene, and scales.
OFFSETS, SCALES = (1e6, 1e9), (1e-9, 1e9)
_FAR_SIZE = (320, 180)


def measure(settings, results):
    """Yield FLIP over that of the mesh at one sample, and the displacement of outlines."""
    results.points['single'] = {}
    for name, make in list(MESHES.items())[: settings.meshes]:
        mesh = _Mesh(name, make(), settings)
        found = {size: mesh.at(size) for size in settings.sizes}
        results.points['single'][name] = found
        yield from _flip_rows(name, found)
    yield from moved_rows(results.points['single'])


def moved_rows(meshes):
    """Yield for each max_error, and for the mesh itself, the outline farthest beyond its bar."""
    worst: dict[str, tuple[float, float, float, str]] = {}
    for name, found in meshes.items():
        for size, by_error in found.items():
            own = by_error[ONCE]['moved']
            for key, point in by_error.items():
                moved = point['moved']
                bar = 0.0 if key == ONCE else max(float(key) + SLACK, own)
                here = (moved - bar, bar, moved, f'{name} at {size} px')
                worst[key] = max(worst.get(key, here), here)
    for key, (_, bar, moved, where) in worst.items():
        drawn = key if key == ONCE else f'max_error {key}'
        name = f'single: worst p99 of displacement, {drawn} ({where})'
        yield Row(name, moved, 'px', None if key == ONCE else bar)


def _flip_rows(name, found):
    for size, by_error in found.items():
        if '1.0' in by_error:
            for samples in MULTI_SAMPLES:
                title = f'single: {name} at {size} px, {samples} samples, FLIP ratio'
                yield Row(title, by_error['1.0'][flip_key(samples)], 'x', 1.0)


def flip_key(samples) -> str:
    """Return the key of FLIP at so many multisamples, over that of the mesh at one sample."""
    return f'flip, {samples}'


class _Mesh:
    """One mesh, drawn by pvibr, by VTK, and by VTK with many samples."""

    def __init__(self, name, mesh, settings):
        self.parts, self.settings = as_parts(mesh), settings
        points = np.concatenate([part.mesh.points for part in self.parts])
        self.center, self.radius = bounding_sphere(points)
        self.rng = np.random.default_rng(sum(name.encode()))

    def at(self, size):
        """Return by max_error the FLIP ratios and the displacement's 99th percentile."""
        cameras = [self._camera(size) for _ in range(self.settings.directions)]
        truth = self._full(size, cameras, samples=SAMPLES)
        once = self._full(size, cameras, multi_samples=0)
        base = max(_mean_flip(once, truth), FLOOR)
        points = {ONCE: {'moved': _moved(once, truth)}}
        with Stage(_window(size), view_angle=_angle(size), background='white') as stage:
            stage.bounds = self._bounds()
            add = stage.plotter.ibr.add_instances
            drawn = add([self.parts], [[0.0, 0.0, 0.0]], bake=True, show_scalar_bar=False)
            for samples in MULTI_SAMPLES:
                stage.window.SetMultiSamples(samples)
                for max_error in self.settings.errors:
                    drawn.max_error = max_error
                    pictures = []
                    for camera in cameras:
                        stage.look(camera)
                        coverage = None if samples else stage.coverage()
                        pictures.append((stage.picture(), coverage))
                    point = points.setdefault(str(max_error), {})
                    point[flip_key(samples)] = max(_mean_flip(pictures, truth), FLOOR) / base
                    if not samples:  # what is covered is told by one sample per pixel
                        point['moved'] = _moved(pictures, truth)
        return points

    def _camera(self, size):
        away, up, aside = self.rng.normal(size=(3, 3))
        away /= np.linalg.norm(away)
        # As high in the window as the sphere has pixels, and not always on the same part of one.
        tangent = np.tan(np.radians(VIEW_ANGLE / 2)) * size / HEIGHT
        eye = self.center + away * self.radius * np.sqrt(1 + 1 / tangent**2)
        shift = aside * self.radius / size
        return tuple(map(tuple, (eye + shift, self.center + shift, up)))

    def _bounds(self):
        low, high = self.center - self.radius, self.center + self.radius
        return tuple(np.stack([low, high], 1).ravel())

    def _full(self, size, cameras, **samples):
        look = {'view_angle': _angle(size), 'background': 'white'}
        with Stage(_window(size), **look, **samples) as stage:
            stage.bounds = self._bounds()
            stage.look(cameras[0])
            stage.draw()
            empty = stage.depth()
            stage.add(mesh_actors([self.parts], np.eye(4)[None], [0]))
            found = []
            for camera in cameras:
                stage.look(camera)
                picture = stage.picture()
                found.append((picture, covered(stage.depth(), empty, stage.samples)))
        return found


def _window(size):
    """Return width and height of the cut around an object of a size, px."""
    return size + 2 * ROOM, size + 2 * ROOM


def _angle(size):
    """Return the vertical angle of the cut, degrees."""
    part = _window(size)[1] / HEIGHT
    return float(np.degrees(2 * np.arctan(np.tan(np.radians(VIEW_ANGLE / 2)) * part)))


def _mean_flip(pictures, truth):
    return mean_flip([picture for picture, _ in pictures], [picture for picture, _ in truth])


def _moved(pictures, truth):
    pairs = zip(pictures, truth, strict=True)
    away = np.concatenate([displacements(a, b) for (_, a), (_, b) in pairs])
    return float(np.percentile(away, 99)) if len(away) else 0.0


# -- far from the origin, very small and very large ----------------------------------------------


def measure_precision(settings, results):
    """Yield mean differences from the picture at the origin."""
    truth, n = _far_picture(0.0, 1.0), settings.extremes
    cases = [(f'at {offset:g} of its size', offset, 1.0) for offset in OFFSETS[:n]]
    cases += [(f'{scale:g} as large', 0.0, scale) for scale in SCALES[:n]]
    for name, offset, scale in cases:
        away = 255 * np.abs(_far_picture(offset, scale) - truth).mean()
        yield Row(f'precision: {name}, mean difference', away, '/255', 1)


def _far_picture(offset, scale):
    rng = np.random.default_rng(5)
    size = 12.0 * scale
    shift = np.array([1.0, -0.7, 0.3]) * offset * size
    places = np.stack(np.meshgrid(*[np.arange(-4.0, 5.0)] * 2, [0.0]), -1).reshape(-1, 3)
    places = (places + rng.uniform(-0.2, 0.2, places.shape)) * scale + shift
    mesh = pv.ParametricTorus(0.3, 0.12, u_res=100, v_res=60)
    mesh.points = mesh.points.astype(float) * scale
    with Stage(_FAR_SIZE, view_angle=30.0) as stage:
        stage.plotter.ibr.add_instances(mesh, places, max_error=1.0, progress=False)
        eye = shift + np.array([3.0, -14.0, 9.0]) * scale
        stage.look([tuple(eye), tuple(shift), (0, 0, 1)])
        return stage.picture()
