"""The error of each level of detail against the mesh, measured after baking."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.core.frame import Frame
from pvibr.gl.binder import Binder
from pvibr.gl.offscreen import hidden_window, read_rgba
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS
from pvibr.instances.group import InstanceGroup
from pvibr.instances.mesh_pool import MeshPool
from pvibr.maths.image_error import box_reduce, flip, outline_distances
from pvibr.meshes.turntable import LEVEL

SIZES = (8, 16, 32, 64, 128)  # diameters of the bounding sphere on the screen, px
_CELL = 9 / 8  # side of a view's cell in diameters: the sizes fit the reference's pixels
_SAMPLES = 2  # samples of the reference along a side of a pixel at the largest size; 4 at half
_COLUMNS, _ROWS = 8, 2  # of views; those of the first row are spread over the sphere as well
_FEW_SIZE = 64  # px from which colours are compared in a part of the first row: FLIP takes long
_FEW_WIDTH = 600  # px, the most of that row
_WORST = 3.0  # the outline of no view may be off by more than so many times what all may
_MESH_SIZE = 64  # px; below, cards are in use mostly
_COARSE = {'splat': 8, 'flat': 64}  # the largest sizes at which these are worth measuring
_FAR_OFF = (1e9, 1e9)
_FLOOR = 1e-4  # mean FLIP below which a ratio says nothing: nothing can be seen


def directions(count, half=False):
    """Return directions spread over the sphere, off the grid of views: (count, 3) unit vectors.

    Spherical Fibonacci points of Keinert et al., "Spherical Fibonacci Mapping", SIGGRAPH Asia
    2015, turned by an irrational angle.
    """
    k = np.arange(count) + 0.5
    z = 1 - (1.0 if half else 2.0) * k / count
    return _around(z)


def level_directions(count, turns, half=False):
    """Return directions spread over a turntable's horizon."""
    k = np.arange(count) + 0.5
    z = LEVEL * (1 - (1.0 if half else 2.0) * k / count)
    return _around(z) @ turns.sides()


def _around(z):
    k = np.arange(len(z)) + 0.5
    angle = np.pi * (1 + 5**0.5) * k + 0.7
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], 1)


def measure(model, progress=None) -> dict[str, np.ndarray]:
    """Return the error table of a model's levels."""
    atlas = model.atlas
    table = {'sizes': np.array(SIZES, float)} | _measured(
        model, None, CARD_SHADERS, meshes=True, progress=progress
    )
    if atlas.turntable is not None:
        views = level_directions(_COLUMNS * _ROWS, atlas.turntable.turns, atlas.half)
        sides = [p for p in ALL_CARD_SHADERS if p.sides]
        table |= _measured(model, views, sides, meshes=False)
    return table


def _measured(model, views, shaders, *, meshes, progress=None):
    """Return the rows of card shaders and lighter meshes, in some views or all."""
    sheet = _Sheet(model, views)
    try:
        reference = sheet.draw_mesh(0)
        # Lighter meshes err much the same from everywhere.
        lighter = range(1, len(model.levels) if meshes else 1)
        pictures = [sheet.draw_mesh(i, _COLUMNS) for i in lighter]
        rows: dict[str, list] = {}
        truth, last = _filtered(reference), SIZES[-1]
        for k, size in enumerate(reversed(SIZES)):
            if progress is not None:
                progress(k / len(SIZES))
            truth, last = box_reduce(truth, last // size), size
            once = _once(reference, size)
            base = _flip(once, truth, size)
            for i, picture in enumerate(pictures, 1):
                if size >= min(_MESH_SIZE, SIZES[-1]):
                    row = _row(_first(_once(picture, size), size), _first(truth, size), base, size)
                    rows.setdefault(f'mesh{i}', []).insert(0, row)
            for shader in shaders:
                row = _FAR_OFF
                if size <= _COARSE.get(shader.name, size):
                    row = _row(sheet.draw_cards(shader.name, size), truth, base, size)
                rows.setdefault(shader.name, []).insert(0, row)
        table: dict[str, np.ndarray] = {}
        for i, picture in enumerate(pictures, 1):
            # At smaller sizes lighter meshes are no worse than at the first that was measured.
            same = [rows[f'mesh{i}'][0]] * (len(SIZES) - len(rows[f'mesh{i}']))
            rows[f'mesh{i}'] = same + rows[f'mesh{i}']
            table[f'mesh{i}.radii'] = np.array(_fine(picture, reference))
    finally:
        sheet.release()
    return table | {name: np.array(r) for name, r in rows.items()}


def _filtered(picture):
    """Return pixels of the largest size, averaged from samples with half weight on borders."""
    for axis in (0, 1):
        picture = np.moveaxis(picture, axis, 0)
        ends = picture[::_SAMPLES]
        picture = (ends / 2 + picture[1::_SAMPLES] + np.roll(ends, -1, 0) / 2) / _SAMPLES
        picture = np.moveaxis(picture, 0, axis)
    return picture


def _once(picture, size):
    """Return one sample per pixel, at its centre."""
    step = SIZES[-1] * _SAMPLES // size
    return picture[step // 2 :: step, step // 2 :: step]


def _first(picture, size):
    """Return the first row of views."""
    return picture[: round(size * _CELL)]


def _row(picture, truth, base, size):
    return _moved(picture, truth, size), _flip(picture, truth, size) / base


def _moved(picture, truth, size):
    """Return the 99th percentile of the outline's displacement, or that of the worst view."""
    pair = picture[..., 3], truth[..., 3]
    found = outline_distances(*pair), outline_distances(*pair[::-1])
    pixels, away = (np.concatenate(both) for both in zip(*found, strict=True))
    if not len(away):
        return 0.0
    views = pixels // round(size * _CELL) @ [_COLUMNS, 1]
    worst = max(np.percentile(away[views == view], 99) for view in np.unique(views))
    return float(max(np.percentile(away, 99), worst / _WORST))


def _fine(picture, reference):
    """Return the 99th percentile of the outline's displacement in radii."""
    size = SIZES[-1] * _SAMPLES
    return 2 * _moved(_first(picture, size), _first(reference, size), size) / size


def _flip(picture, truth, size):
    """Return the mean FLIP, clamped to what can be seen."""
    if size >= _FEW_SIZE:
        width = min(_COLUMNS, int(_FEW_WIDTH / (size * _CELL))) * round(size * _CELL)
        picture, truth = (_first(p, size)[:, :width] for p in (picture, truth))
    return max(float(flip(_on_white(picture), _on_white(truth)).mean()), _FLOOR)


def _on_white(picture):
    return np.clip(picture[..., :3] + 1 - picture[..., 3:], 0, 1)


class _Sheet:
    """Views of a model side by side in a small window of its own."""

    def __init__(self, model, views=None):
        self.model = model
        self.context = hidden_window()
        self.window, self.renderer = self.context.__enter__()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.SetBackgroundAlpha(0.0)
        atlas = model.atlas
        self.spacing = 2 * atlas.radius * _CELL
        poses = _poses(atlas, self.spacing, views)
        self.group = InstanceGroup(model, Binder(), 1, len(poses))
        self.group.put(poses, np.arange(len(poses), dtype=np.int32))
        self.group.upload(self.window)
        for actor in self.group.cards.actors():
            self.renderer.AddViewProp(actor)
        # The lights of PyVista's plotters: harder on averaged normals than a headlight, which VTK
        # has put there by itself.
        self.renderer.RemoveAllLights()
        self.lights = _vtk.vtkLightKit()
        self.lights.AddLightsToRenderer(self.renderer)
        camera = self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetViewUp(0, 1, 0)
        camera.SetParallelScale(self.spacing * _ROWS / 2)
        camera.SetClippingRange(2 * atlas.radius, 6 * atlas.radius)

    def _resize(self, size, shift=0.0):
        """Set the size in pixels, and shift by a part of one to the lower left."""
        cell = round(size * _CELL)
        self.window.SetSize(cell * _COLUMNS, cell * _ROWS)
        shift *= self.spacing / cell
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(-shift, -shift, 4 * self.model.atlas.radius)
        camera.SetFocalPoint(-shift, -shift, 0)

    def draw_mesh(self, level, views=None):
        """Return the samples of a mesh level, premultiplied RGBA from 0 to 1."""
        self._resize(SIZES[-1] * _SAMPLES, 0.5)
        pool = MeshPool(self.model.levels[level])
        slots = np.flatnonzero(self.group.ids < (views or len(self.group))).tolist()
        actors = pool.show(slots, self.group.matrix, lambda _: (0.0, 0.0, 0.0, 0.5))
        for actor in actors:
            self.renderer.AddViewProp(actor)
        picture = self._picture()
        for actor in actors:
            self.renderer.RemoveViewProp(actor)
            actor.ReleaseGraphicsResources(self.window)
        return picture

    def draw_cards(self, shader, size):
        """Return the image of a shader's cards, premultiplied RGBA from 0 to 1."""
        self._resize(size)
        cards = self.group.cards
        cards.hide()
        frame = Frame.of(self.renderer)
        cards.view(frame)
        index, origins, _, _ = self.group.blocks.seen(frame)
        blocks = np.column_stack([origins, index]).astype(np.float32)
        cards.show(shader, blocks, (0.0, 0.0, 1e9, 1e9), np.array([0, len(blocks)]))
        picture = self._picture()
        if not cards.layers[shader].landed:
            msg = f'the cards of shader {shader!r} are not drawn by this driver'
            raise ShaderError(msg)
        return picture

    def _picture(self):
        self.window.Render()
        self.group.cards.binder.unbind()
        return read_rgba(self.window).astype(np.float32) / 255

    def release(self):
        self.group.release()
        self.context.__exit__(None, None, None)


def _poses(atlas, spacing, views=None):
    """Return a pose per view: its direction turned to +z, in its cell."""
    from pvibr.maths.octahedral import frame

    count = _COLUMNS * _ROWS
    views = directions(count, atlas.half) if views is None else views
    views = views[np.arange(count) * 7 % count]  # the first few all around
    rng = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (len(views), 1, 1))
    poses[:, :3, :3] = frame(views)
    column, row = np.meshgrid(np.arange(_COLUMNS), np.arange(_ROWS))
    cells = np.stack([column.ravel() - (_COLUMNS - 1) / 2, row.ravel() - (_ROWS - 1) / 2], 1)
    jitter = rng.uniform(-0.02, 0.02, cells.shape)
    poses[:, :2, 3] = (cells + jitter) * spacing
    poses[:, :3, 3] -= np.einsum('nij,j->ni', poses[:, :3, :3], atlas.center)
    return poses
