"""Outlines: where they are against the silhouette, and what they cost."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import least
from benchmarks.effects.copies import Copy
from pvibr.core.effect import Effect
from pvibr.effects.outline import Outline
from pvibr.maths.cameras import as_camera
from pvibr.scenes.stage import Stage
from pvibr.visibility.silhouette_lines import silhouette_lines

# As fine as a silhouette that is known to a part of a pixel asks for.
MESHES = {
    'ball': pv.Sphere(theta_resolution=120, phi_resolution=120),
    'box': pv.Cube().rotate_z(20),
    'cone': pv.Cone(resolution=120).rotate_y(30),
    'torus': pv.ParametricTorus(ringradius=0.5, crosssectionradius=0.2).triangulate(),
    'knot': pv.ParametricFigure8Klein().scale(0.15).triangulate(),
}
VIEW = [(1.4, -2.2, 1.5), (0, 0, 0), (0, 0, 1)]
_FINE = 8  # places along a side of a pixel


def contour(mesh, camera, size) -> np.ndarray:
    """Return places on the silhouette of a mesh, by its triangles projected in float64."""
    from PIL import Image, ImageDraw

    uv, _ = as_camera(camera, size).project(np.asarray(mesh.points, float))
    image = Image.new('1', (size[0] * _FINE, size[1] * _FINE))
    draw = ImageDraw.Draw(image)
    for face in (uv * size * _FINE)[mesh.triangulate().regular_faces]:
        draw.polygon([tuple(p) for p in face.tolist()], fill=1)
    mask = np.asarray(image)[::-1]
    y, x = np.nonzero(mask[:, 1:] != mask[:, :-1])
    beside = np.stack([x + 1.0, y + 0.5], 1)
    y, x = np.nonzero(mask[1:] != mask[:-1])
    return np.concatenate([beside, np.stack([x + 0.5, y + 1.0], 1)]) / _FINE


def inner(mesh, camera, size) -> np.ndarray:
    """Return places along the polylines of :func:`pvibr.silhouette_lines`, inner ones included."""
    found, places = silhouette_lines(mesh, camera, size=size), []
    uv, _ = as_camera(camera, size).project(np.asarray(found.points, float))
    xy = np.array([0, size[1]]) + uv * size * [1, -1]
    lines, i = found.lines, 0
    while i < len(lines):
        ids = lines[i + 1 : i + 1 + lines[i]]
        i += 1 + lines[i]
        for a, b in pairwise(xy[ids]):
            n = int(np.linalg.norm(b - a) / 0.3) + 2
            places.append(a + np.linspace(0, 1, n)[:, None] * (b - a))
    return np.concatenate(places)


def agreement(drawn, places, within=1.0) -> tuple[float, float]:
    """Return precision and recall of pixels."""
    from scipy.spatial import cKDTree

    pixels = np.argwhere(drawn)[:, ::-1] + 0.5
    precision = (cKDTree(places).query(pixels)[0] <= within).mean()
    return float(precision), float((cKDTree(pixels).query(places)[0] <= within).mean())


def _stage(size, mesh, **look):
    stage = Stage(size, background='white')
    stage.plotter.add_mesh(mesh, color='white', **look)
    stage.look(VIEW)
    return stage


def measure(settings, results):
    """Yield precision and recall of lines, and what kinds of lines cost."""
    yield from _silhouettes(settings.screen)
    yield from _kinds(settings.screen, settings.rounds, results)


def _silhouettes(size):
    """Yield precision and recall of lines of the default width, half covered pixels and more."""
    for name, mesh in MESHES.items():
        with _stage(size, mesh, lighting=False) as stage:
            stage.plotter.ibr.add(Outline(depth=False, normal=False))
            lines = stage.picture()[..., 0] < 0.5
            found = agreement(lines, contour(mesh, stage.plotter.camera, size))
        for what, value in zip(('precision', 'recall'), found, strict=True):
            yield Row(f'outline: {what}, {name}', value, '', 0.95, at_least=True)


class _Nothing(Effect):
    """Has the picture taken off the window, and leaves it."""

    def render(self, frame, picture):
        pass


# By name: what draws which lines. Nothing of luminance is known where a mesh is lit.
_ONLY = {'ids': False, 'depth': False, 'normal': False, 'luminance': False}
KINDS: dict[str, dict] = {
    'ids': _ONLY | {'ids': True},
    'depth': _ONLY | {'depth': True},
    'creases': _ONLY | {'normal': True},
    'luminance': _ONLY | {'luminance': True},
    'as it comes': {},
    'with luminance': {'luminance': True},
    'jump 1': {'jump': 1.0},
    'jump 16': {'jump': 16.0},
    'crease 10': {'crease': 10.0},
    '4 px': {'width': 4.0},
    '8 px': {'width': 8.0},
}


def _kinds(size, rounds, results):
    """Yield what kinds of lines cost of a frame, and how far they are from the silhouettes."""
    effects: dict[str, Effect] = {'copy': Copy()}
    effects |= {name: Outline(**kind) for name, kind in KINDS.items()}
    drawn: dict = {}

    def shown(name):
        for other, effect in effects.items():
            effect.enabled = other == name
        stage.draw()  # what was put on is prepared
        found = stage.draw()
        drawn[name] = stage.pixels()
        return found

    look = {'smooth_shading': True, 'ambient': 1.0, 'diffuse': 0.0}
    with _stage(size, MESHES['torus'], **look) as stage:
        for effect in (_Nothing(), *effects.values()):
            stage.plotter.ibr.add(effect)
        places = inner(MESHES['torus'], stage.plotter.camera, size)
        best = least(rounds, {name: partial(shown, name) for name in ('base', *effects)})
    base = best.pop('base')
    copy = best.pop('copy') - base
    found = results.points['outline'] = []
    for name, spent in best.items():
        lines = drawn[name].max(2) < 100
        wide = 0.5 + KINDS[name].get('width', 2.0) / 2  # half a line, and half a pixel's corner
        precision, recall = agreement(lines, places, wide) if lines.any() else (0.0, 0.0)
        error = 1 - 2 * precision * recall / max(precision + recall, 1e-9)
        ms, copies = 1e3 * (spent - base), (spent - base) / copy
        found.append({'name': name, 'ms': ms, 'copies': copies, 'error': error})
        yield Row(f'outline, {name}, over a copy', copies, 'x')
