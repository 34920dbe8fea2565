"""Measure billboard clouds: against k-means, and fewer triangles of as many bytes."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv

from benchmarks.common import plots
from benchmarks.common.harness import Bench, Row
from benchmarks.common.meshes import DATA
from benchmarks.common.timing import mean_flip, pictures, timed
from benchmarks.common.whole_frames import real_plotter, turning
from pvibr.maths.image_error import psnr
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import SAMPLES, Stage, mesh_actors
from pvibr.scenes.trees import tree_parts
from pvibr.substitutes.billboard_cloud import billboard_cloud

#: Pixels that a mesh is high: where a cloud of 2 % is meant to be seen.
_SIZE = 160
_HOLES = 0.005  # of the pixels inside an outline
_HERE = np.eye(4)[None], np.zeros(1, int)


def _timed(settings, results):
    """Yield the time of a mesh of many triangles, and how far it was displaced."""
    file = DATA / 'meshes' / 'skull.obj'
    mesh = pv.read(file) if file.is_file() and settings.triangles >= 100_000 else _ball(settings)
    cloud, seconds = timed(lambda: billboard_cloud(mesh, epsilon=0.02, size=settings.size))
    name = f'{mesh.n_cells} triangles at 2 %'
    yield Row(f'{name}: time', seconds, 's', 20)
    yield Row(f'{name}: planes', len(cloud.planes))
    yield Row(f'{name}: displacement over the bound', _moved(cloud, mesh), '', 1)


def _ball(settings):
    side = int(np.sqrt(settings.triangles / 2)) + 1
    return pv.ParametricBohemianDome(u_res=side, v_res=side).triangulate()


def _moved(cloud, mesh):
    """Return the largest displacement of a vertex over what is allowed, computed anew."""
    points = np.asarray(mesh.points, float)
    away = cloud.planes.displacements(points, mesh.triangulate().regular_faces)
    return float(away.max() / (0.02 * np.linalg.norm(np.ptp(points, axis=0))))


def _errors(settings, results):
    """Yield the errors of clouds, of k-means and of quadric decimation by mesh."""
    curves = results.points['meshes'] = {}
    for name, make in list(MESHES.items())[: settings.meshes]:
        parts = make()
        if parts is not None:
            curves[name] = found = _Mesh(parts, settings).curves()
            yield from _rows(name, found)


def _rows(name, found):
    first = found['greedy'][0]
    label = f'{name}, {first["epsilon"]:.0%}'
    yield Row(f'{label}: planes', first['planes'])
    yield Row(f'{label}: FLIP', first['flip'])
    yield Row(f'{label}: PSNR', first['psnr'], 'dB')
    yield Row(f'{label}: holes of the inner pixels', first['holes'], '', _HOLES)
    yield Row(f'{label}: normals off by', first['normal_error'], 'degrees')
    yield Row(f'{label}: triangles in gaps over those of the mesh', first['patches'])
    yield Row(f'{label}: drawn share of the rectangles', first['fill'])
    yield Row(f'{label}: displacement over the bound', first['moved'], '', 1)
    yield Row(f'{label}: time', first['seconds'], 's')
    yield Row(f'{label}: bytes', first['bytes'])
    same = planes_at(found['k-means'], first['flip']) / first['planes']
    text = f'{label}: planes of k-means at the same FLIP over its own'
    yield Row(text, same, 'x', 1, at_least=True)
    for point in found['quadrics']:
        yield Row(f'{name}: FLIP of quadrics at {point["bytes"]} bytes', point['flip'])


def planes_at(curve, error) -> float:
    """Return how many planes a curve needs for an error, by lines between its points."""
    curve = sorted(curve, key=lambda point: point['planes'])
    planes = np.array([point['planes'] for point in curve], float)
    flips = np.minimum.accumulate([point['flip'] for point in curve])
    return float(np.interp(-error, -flips, planes))


class _Mesh:
    """One mesh, its pictures, and what stands in for it."""

    def __init__(self, parts, settings):
        self.parts, self.settings = parts, settings
        points = np.concatenate([part.mesh.points for part in parts])
        self.diagonal = float(np.linalg.norm(np.ptp(points.astype(float), axis=0)))
        middle = (points.min(0) + points.max(0)) / 2.0
        away = 0.5 * self.diagonal / np.sin(np.radians(15))
        self.cameras = [
            (middle + away * v, middle, (0, 1, 0) if abs(v[1]) < 0.9 else (1, 0, 0))
            for v in _around(settings.views)
        ]
        self.truth = self._pictures(lambda stage: stage.add(mesh_actors([parts], *_HERE)))

    def curves(self):
        greedy = [self._cloud(epsilon=epsilon) for epsilon in self.settings.epsilons]
        first = greedy[0]['planes']
        counts = sorted({max(1, round(first * share)) for share in self.settings.counts})
        return {
            'greedy': greedy,
            'k-means': [self._cloud(planes=count) for count in counts],
            'quadrics': [self._decimated(point['bytes']) for point in greedy],
        }

    def _cloud(self, **how):
        cloud = billboard_cloud(self.parts, size=self.settings.size, **how)
        with tempfile.TemporaryDirectory() as folder:
            (file,) = cloud.save(Path(folder) / 'cloud.glb')
            size = file.stat().st_size
        found = {'planes': len(cloud.planes), 'bytes': size, 'seconds': cloud.seconds}
        found['moved'] = cloud.displacement / (cloud.epsilon or self.diagonal)
        found |= {'fill': cloud.fill, 'holes': cloud.holes, 'normal_error': cloud.normal_error}
        found['patches'] = cloud.patches / len(cloud.planes.owner)
        return how | found | self._error(lambda stage: cloud.add_to(stage.plotter))

    def _decimated(self, size):
        """Return the error of the triangles that the same number of bytes holds."""
        whole = sum(_bytes(part) for part in self.parts)
        found = [_quadrics(part, min(size / whole, 1.0)) for part in self.parts]
        error = self._error(lambda stage: stage.add(mesh_actors([found], *_HERE)))
        return {'bytes': sum(_bytes(part) for part in found)} | error

    def _error(self, fill):
        drawn = self._pictures(fill)
        ratios = [min(psnr(a, b), 99.0) for a, b in zip(drawn, self.truth, strict=True)]
        return {'flip': mean_flip(drawn, self.truth), 'psnr': float(np.mean(ratios))}

    def _pictures(self, fill):
        with Stage((_SIZE, _SIZE), samples=SAMPLES) as stage:
            fill(stage)
            return pictures(stage, self.cameras)


def _around(count):
    """Return directions from all around, none of them along an axis."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = 0.3 + np.pi * (3 - np.sqrt(5)) * np.arange(count)
    across = np.sqrt(1 - z * z)
    return np.column_stack([across * np.cos(angle), z, across * np.sin(angle)])


def _bytes(part):
    """Return the bytes of a mesh in a GLB file: points, normals, colours or places, triangles."""
    mesh = part.mesh
    vertex = 12 + 12 * (mesh.point_data.active_normals is not None)
    vertex += 8 * (mesh.active_texture_coordinates is not None)
    vertex += 4 * (mesh.active_scalars is not None)
    texture = part.actor.GetTexture()
    image = 0 if texture is None else _png_bytes(texture)
    return mesh.n_points * vertex + mesh.n_cells * 12 + image


def _png_bytes(texture):
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(pv.Texture(texture.GetInput()).to_array())).save(stream, 'PNG')
    return stream.tell()


def _quadrics(part, share):
    """Return a part simplified by VTK's quadrics, its arrays taken along."""
    mesh = part.mesh
    if share < 1:
        with pv.vtk_verbosity('off'):  # it says of each edge that has no best point
            mesh = mesh.decimate(1 - share, enable_all_attribute_error=True)
    return part.with_mesh(mesh)


def _file(name, **looks):
    file = DATA / 'meshes' / name
    return as_parts(file, **looks) if file.is_file() else None


MESHES: dict[str, Callable] = {
    'airplane': lambda: as_parts(pv.examples.load_airplane(), color='tan'),
    'torus': lambda: as_parts(pv.ParametricTorus().triangulate(), color='tan'),
    'tree': lambda: tree_parts('broadleaf', triangles=50_000),
    'building': lambda: _file('city/building_H.gltf'),
    'statue': lambda: _file('nefertiti-lowres.obj', color='tan', smooth_shading=True),
}


def plot(points, figure):
    """Draw the error of billboard clouds by planes, and by bytes beside quadric decimation."""
    meshes = points['meshes']
    rows = plots.subplots(figure, 2, len(meshes), squeeze=False)
    for name, planes, size in zip(meshes, *rows, strict=True):
        for way, found in meshes[name].items():
            by_bytes = [p | {'kB': p['bytes'] / 1e3} for p in found]
            by_bytes.sort(key=lambda p: p['bytes'])
            if way != 'quadrics':
                plots.curve(planes, by_bytes, 'planes', 'flip', label=way)
            if way != 'k-means':
                plots.curve(size, by_bytes, 'kB', 'flip', label=way)
        planes.set(xscale='log', xlabel='planes', title=name, ylim=(0, None))
        size.set(xscale='log', xlabel='kB', ylim=(0, None))
        for one in (planes, size):
            one.set_ylabel('mean FLIP against the mesh')


def _airplane(settings, size, on):
    """Return an airplane, as a billboard cloud or as its mesh."""
    parts = MESHES['airplane']()
    pl = real_plotter(size, () if on else mesh_actors([parts], *_HERE))
    if on:
        billboard_cloud(parts, epsilon=settings.epsilons[0], size=settings.size).add_to(pl)
    pl.camera_position = 'iso'
    return pl, turning(pl)


BENCH = Bench(
    parts={'time': _timed, 'error': _errors},
    plot=plot,
    outside={'a billboard cloud': _airplane},
    settings={
        'meshes': (None, 1),
        'epsilons': ((0.02, 0.01, 0.04, 0.08), (0.04,)),
        'counts': ((0.6, 1.0, 1.5, 2.5), (1.0,)),
        'views': (8, 2),
        'triangles': (100_000, 5_000),
        'size': (1024, 256),
    },
)
