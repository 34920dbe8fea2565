"""The error of each level of detail against the mesh, measured after baking."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.core.frame import Frame
from pvibr.gl.binder import Binder
from pvibr.gl.offscreen import hidden_window, read_pixels
from pvibr.instances.card_layers import PATCH_SIDE, PATCHES
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS
from pvibr.instances.group import InstanceGroup
from pvibr.instances.mesh_pool import MeshPool
from pvibr.maths import octahedral
from pvibr.maths.flip import Flip
from pvibr.maths.image_error import outline_distances
from pvibr.meshes.turntable import LEVEL

SIZES = (8, 16, 32, 64, 128)  # diameters of the bounding sphere on the screen, px
_CELL = 9 / 8  # side of a view's cell in diameters: the sizes fit the reference's pixels
_SAMPLES = 2  # samples of the reference along a side of a pixel at the largest size; 4 at half
_SIDE = 2 * PATCH_SIDE  # of the square of views: two along a side of a patch of directions
_VIEWS = _SIDE * _SIDE
_FEW_SIZE = 128  # px from which colours are compared in one view of each patch
_HOPELESS = 4.0  # px: a level that allows no `max_error` up to it is not tried at larger sizes
SLACK = 0.5  # px, of outlines whose distances are whole pixels apart
#: The share of the mesh's own FLIP that is always allowed: of cards less, since where things touch
#: or pierce one another theirs is more. Beyond it a share is allowed, or the least.
CARD_SHARE = 0.8
BEYOND, LEAST = 0.25, 0.005
#: The same of lighter meshes, beside what few samples per pixel add to theirs as to the mesh's.
MESH_BEYOND, MESH_LEAST = 0.5, 0.01
#: The power of the samples per pixel by which less is allowed of these.
MESH_SEEN = 1 / 3
_ROUNDED = 1.5 / 255  # what eight bits of a colour make of hardly any difference
_MULTI = 4  # samples per pixel of the driver's, at which the mesh itself is measured as well
_FLOOR = 1e-4  # FLIP below which nothing can be seen


def directions(half=False):
    """Return directions all around, one in each cell of an octahedral map: (64, 3)."""
    cells = np.stack(np.meshgrid(np.arange(_SIDE), np.arange(_SIDE)), -1).reshape(-1, 2)
    within = np.random.default_rng(5).random((_VIEWS, 2))
    return octahedral.decode((cells + within) / _SIDE * 2 - 1, half)


def level_directions(turns, half=False):
    """Return directions spread over a turntable's horizon."""
    k = np.arange(_VIEWS) + 0.5
    z = LEVEL * (1 - (1.0 if half else 2.0) * k / _VIEWS)
    return _around(z) @ turns.sides()


def _around(z):
    k = np.arange(len(z)) + 0.5
    angle = np.pi * (1 + 5**0.5) * k + 0.7
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], 1)


def measure(model, progress=None, reference=None) -> dict[str, np.ndarray]:
    """Return the error table of a model's levels, (sizes, patches, 4) each."""
    # For each patch of directions, from four views: the displacement of outlines in pixels, and
    # the means of FLIP of what is covered, and of that of the mesh drawn once per pixel. That of
    # lighter meshes is what many samples per pixel show: few of them add as much as to the
    # mesh. Last the power of the samples per pixel by which the mesh's own falls: drivers shade
    # a triangle once a pixel, so that outlines gain from samples, and patterns inside do not.
    atlas = model.atlas
    reference = reference or Reference(model)
    table = {'sizes': reference.sizes} | reference.meshes
    table |= reference.cards(model, CARD_SHADERS, progress or _unseen)
    if atlas.turntable is not None:
        level = Reference(model, level_directions(atlas.turntable.turns, atlas.half))
        table |= level.cards(model, [p for p in ALL_CARD_SHADERS if p.sides])
    return table


class Reference:
    """The mesh in some views, by which its levels are measured; without any, all around."""

    def __init__(self, model, views=None, progress=None):
        self._views, advance = views, progress or _unseen
        self.sizes = np.array(SIZES, float)
        count = len(model.levels) if views is None else 1
        with _Sheet(model, views) as sheet:
            drawn = sheet.draw_mesh(0)
            full = _pixels(drawn)
            self._truths = [_Truth(drawn, full[size], size) for size in SIZES]
            _set_falls(self._truths, sheet)
            #: The rows of lighter meshes.
            self.meshes: dict[str, np.ndarray] = {}
            for i in range(1, count):
                advance(i / count)
                picture, radii = sheet.draw_mesh(i), model.levels[i].error
                if radii is None:
                    radii = _fine(picture, drawn)
                self.meshes |= self._of_mesh(f'mesh{i}', _pixels(picture), radii)
        advance(1.0)

    def _of_mesh(self, name, pixels, radii) -> dict:
        """Return the errors of a lighter mesh, and how far its surface is from the mesh's."""

        def errors(truth):
            told = _told(pixels[truth.size], truth.picture)
            return truth.errors(told, radii * truth.size / 2 + SLACK)

        return {name: _rows(self._truths, errors), f'{name}.radii': np.array(radii)}

    def cards(self, model, shaders, progress=None) -> dict:
        """Return the rows of card shaders."""
        table, advance = {}, progress or _unseen
        with _Sheet(model, self._views) as sheet:
            for i, shader in enumerate(shaders):

                def errors(truth, name=shader.name):
                    return truth.card_errors(sheet.draw_cards(name, truth.size))

                table[shader.name] = _rows(self._truths, errors, shader.largest)
                advance((i + 1) / len(shaders))
        return table


def _unseen(_done):
    pass


def _set_falls(truths, sheet):
    """Set the power of the samples by which the mesh's own FLIP falls at each size."""
    some = truths[1::2]  # between which it hardly changes
    drawn = sheet.draw_multisampled([truth.size for truth in some])
    falls = [truth.fall(picture) for truth, picture in zip(some, drawn, strict=True)]
    octaves = np.log2([truth.size for truth in truths])
    for truth, fall in zip(truths, np.interp(octaves, octaves[1::2], falls), strict=True):
        truth.falls = fall


def _rows(truths, errors, largest=np.inf):
    """Return the errors of a level at all sizes, (sizes, patches, 4)."""
    rows: list[np.ndarray] = []
    for i, truth in enumerate(truths):
        beyond = i and truths[i - 1].size >= largest
        if beyond or (rows and np.median(of_cards(rows[-1])) > _HOPELESS):
            rows.append(rows[-1] * [2.0, 1.5, 1.0, 1.0])  # it grows with the size
        else:
            rows.append(errors(truth))
    return np.array(rows)


def of_cards(rows, samples=1):
    """Return the least `max_error` in pixels that allows errors of cards: (..., 4) to (...)."""
    moved, flip, own = _sampled(rows, samples)
    always = CARD_SHARE * own
    color = np.minimum((flip - always) / np.maximum(BEYOND * own, LEAST), flip / always)
    return np.maximum(np.maximum(moved - SLACK, 0.0), np.where(flip > always, color, 0.0))


def of_meshes(rows, samples=1):
    """Return the same of lighter meshes, which are sampled as the mesh is."""
    moved, flip, own = _sampled(rows, samples)
    # The mesh's own is along outlines, what these have beyond it is elsewhere: it adds up, and is
    # seen the more, the less many samples leave of the mesh's.
    color = flip / np.maximum(MESH_BEYOND * own, MESH_LEAST) * max(samples, 1) ** MESH_SEEN
    return np.maximum(np.maximum(moved - SLACK, 0.0), color)


def _sampled(rows, samples):
    """Return displacement, FLIP and that of the mesh drawn with some samples per pixel."""
    moved, flip, own, falls = np.moveaxis(np.asarray(rows), -1, 0)
    return moved, flip, own / max(samples, 1) ** falls


class _Truth:
    """The reference at one size."""

    def __init__(self, reference, picture, size):
        self.size = size
        self.picture = picture
        self.few = np.arange(_VIEWS)
        if size >= _FEW_SIZE:
            self.few = _quarter()
        tiles = _tiles(self.picture, size)[self.few]
        self.covered = np.maximum(tiles[..., 3].sum((1, 2)), 1.0)
        # Beside its like, as in a field: on white its outlines would count for all the rest.
        self.ground = (tiles[..., :3].sum((0, 1, 2)) / self.covered.sum()).astype(np.float32)
        self.flip = Flip(self._grounded(tiles))
        once = _once(reference, size)
        self.base, self.moved = self._flip(once), _moved(once, self.picture, size)
        self.strayed = self._strayed(once)
        self.falls = 0.0

    def fall(self, picture):
        """Return the power of the samples by which the mesh's FLIP falls in a picture of some."""
        some = np.isin(self.few, _quarter())
        found = self._flip(picture)[some].mean()
        return float(np.log(self.base[some].mean() / found) / np.log(_MULTI))

    def errors(self, picture, moved):
        """Return displacement, FLIP, that of the mesh and its power in each patch."""
        flips = _patches(self._flip(picture)), _patches(self.base)
        rows = np.broadcast_arrays(moved, *flips, self.falls)
        return np.stack(rows, 1)

    def card_errors(self, picture):
        """Return the same of cards, whose soft outlines may be no worse than the mesh's."""
        moved = _moved(picture, self.picture, self.size)
        moved = np.where(moved > self.moved, moved, 0.0)  # thin things: no worse than the mesh
        found = self.errors(picture, moved)
        strayed = _patches(self._strayed(picture)) / _patches(self.strayed)
        found[:, 1] = np.maximum(found[:, 1], found[:, 2] * strayed)
        return found

    def _strayed(self, picture):
        """Return how far coverage is from the reference's, of a pixel that is covered."""
        away = np.abs(picture[..., 3] - self.picture[..., 3])[..., None]
        sums = _tiles(away, self.size)[self.few].sum((1, 2, 3))
        return np.maximum(sums / self.covered, _FLOOR)

    def _flip(self, picture):
        """Return the FLIP of a pixel that is covered, in some views, clamped to what is seen."""
        maps = self.flip.maps(self._grounded(_tiles(picture, self.size)[self.few]))
        return np.maximum(maps.sum((1, 2)) / self.covered, _FLOOR)

    def _grounded(self, picture):
        return np.clip(picture[..., :3] + (1 - picture[..., 3:]) * self.ground, 0, 1)


def _quarter():
    """Return every other view of every other row."""
    return np.arange(_VIEWS).reshape(_SIDE, _SIDE)[::2, ::2].ravel()


def _patches(values):
    """Return the means of the views of each patch."""
    return _by_patch(values).mean(1)


def _by_patch(values):
    """Return the values of the views of each patch."""
    some = round(len(values) ** 0.5) // PATCH_SIDE
    cells = values.reshape(PATCH_SIDE, some, PATCH_SIDE, some).swapaxes(1, 2)
    return cells.reshape(PATCHES, some * some)


def _tiles(picture, size):
    """Return the views of a picture one by one."""
    cell = round(size * _CELL)
    tiles = picture.reshape(_SIDE, cell, _SIDE, cell, -1).swapaxes(1, 2)
    return tiles.reshape(_VIEWS, cell, cell, -1)


def _reduced(picture):
    """Return pixels of the largest size, averaged from samples with half weight on borders."""
    sums = picture.astype(np.uint16)
    for axis in (0, 1):
        sums = np.moveaxis(sums, axis, 0)
        sums = sums.reshape(len(sums) // _SAMPLES, _SAMPLES, *sums.shape[1:])
        ends = sums[:, 0]
        sums = ends + 2 * sums[:, 1:].sum(1, dtype=sums.dtype) + np.roll(ends, -1, 0)
        sums = np.moveaxis(sums, 0, axis)
    return sums / np.float32(255 * (2 * _SAMPLES) ** 2)


def _pixels(picture):
    """Return the pixels of each size, from samples of the largest."""
    pixels, size, found = _reduced(picture), SIZES[-1], {}
    for wanted in SIZES[::-1]:
        while size > wanted:
            pixels, size = _halved(pixels), size // 2
        found[wanted] = pixels
    return found


def _halved(pixels):
    """Return the means of squares of four pixels."""
    rows = pixels[::2] + pixels[1::2]
    return (rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25)


def _once(picture, size):
    """Return one sample per pixel, at its centre."""
    step = SIZES[-1] * _SAMPLES // size
    return picture[step // 2 :: step, step // 2 :: step] / np.float32(255)


def _moved(picture, truth, size):
    """Return the displacement that bounds most of the outlines in each patch of directions."""
    # 99 of 100 pixels of all its views together, and 95 of 100 in each of these.
    pair = picture[..., 3], truth[..., 3]
    found = outline_distances(*pair), outline_distances(*pair[::-1])
    pixels, away = (np.concatenate(both) for both in zip(*found, strict=True))
    views = pixels // round(size * _CELL) @ [_SIDE, 1]
    patches = np.empty(_VIEWS, int)
    patches[_by_patch(np.arange(_VIEWS))] = np.arange(PATCHES)[:, None]
    all_views = _bounds(away, patches[views], PATCHES, 0.99)
    return np.maximum(all_views, _by_patch(_bounds(away, views, _VIEWS, 0.95)).max(1))


def _bounds(values, groups, count, share):
    """Return what bounds a share of the values of each group."""
    counts = np.bincount(groups, minlength=count)
    rank = np.cumsum(counts) - 1 - (1 - share) * (counts - 1)  # within each group's own, in order
    ordered = np.append(values[np.lexsort((values, groups))], 0.0)
    return np.where(counts, np.interp(rank, np.arange(len(ordered)), ordered), 0.0)


def _fine(picture, reference):
    """Return the outline's displacement in the worst patch, in radii."""
    size = SIZES[-1] * _SAMPLES
    few = np.float32(1 / 255)
    return 2 * float(_moved(picture * few, reference * few, size).max()) / size


def _told(picture, truth):
    """Return a picture without differences that are no more than rounding."""
    # FLIP makes as much of one step of 255 all over a smooth surface as of all its outlines.
    return np.where(np.abs(picture - truth).max(-1, keepdims=True) > _ROUNDED, picture, truth)


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
        camera.SetParallelScale(self.spacing * _SIDE / 2)
        camera.SetClippingRange(2 * atlas.radius, 6 * atlas.radius)

    def _resize(self, size, shift=0.0):
        """Set the size in pixels, and shift by a part of one to the lower left."""
        cell = round(size * _CELL)
        self.window.SetSize(cell * _SIDE, cell * _SIDE)
        shift *= self.spacing / cell
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(-shift, -shift, 4 * self.model.atlas.radius)
        camera.SetFocalPoint(-shift, -shift, 0)

    def draw_mesh(self, level):
        """Return the samples of a mesh level, premultiplied RGBA of 8 bits."""
        self._resize(SIZES[-1] * _SAMPLES, 0.5)
        with self._mesh(level, list(range(len(self.group)))):
            return self._picture()

    def draw_multisampled(self, sizes):
        """Return images of a quarter of the views as the driver samples the mesh, 0 to 1."""
        found = []
        self.window.SetMultiSamples(_MULTI)
        with self._mesh(0, _quarter().tolist()):  # samples of small triangles take long
            for size in sizes:
                self._resize(size)
                found.append(self._picture(shown=False) / np.float32(255))
        self.window.SetMultiSamples(0)
        return found

    @contextmanager
    def _mesh(self, level, slots):
        """Show a mesh level in some views."""
        pool = MeshPool(self.model.levels[level])
        actors = pool.show(slots, self.group.matrix, lambda _: (0.0, 0.0, 0.0, 0.5))
        for actor in actors:
            self.renderer.AddViewProp(actor)
        yield
        for actor in actors:
            self.renderer.RemoveViewProp(actor)
            actor.ReleaseGraphicsResources(self.window)

    def draw_cards(self, shader, size):
        """Return the image of a shader's cards, premultiplied RGBA from 0 to 1."""
        self._resize(size)
        cards = self.group.cards
        cards.hide()
        frame = Frame.of(self.renderer)
        cards.view(frame)
        index, origins, _, _ = self.group.blocks.seen(frame)
        blocks = np.column_stack([origins, index]).astype(np.float32)
        cards.show(shader, blocks, np.array([0, len(blocks)]))
        picture = self._picture() / np.float32(255)
        if not cards.layers[shader].landed:
            msg = f'the cards of shader {shader!r} are not drawn by this driver'
            raise ShaderError(msg)
        return picture

    def _picture(self, *, shown=True):
        self.window.Render()
        self.group.cards.binder.unbind()
        return read_pixels(self.window, alpha=True, shown=shown)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.release()

    def release(self):
        self.group.release()
        self.context.__exit__(None, None, None)


def _poses(atlas, spacing, views=None):
    """Return a pose per view: its direction turned to +z, in its cell."""
    views = directions(atlas.half) if views is None else views
    rng = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (_VIEWS, 1, 1))
    poses[:, :3, :3] = octahedral.frame(views)
    column, row = np.meshgrid(np.arange(_SIDE), np.arange(_SIDE))
    cells = np.stack([column.ravel(), row.ravel()], 1) - (_SIDE - 1) / 2
    jitter = rng.uniform(-0.02, 0.02, cells.shape)
    poses[:, :2, 3] = (cells + jitter) * spacing
    poses[:, :3, 3] -= np.einsum('nij,j->ni', poses[:, :3, :3], atlas.center)
    return poses
