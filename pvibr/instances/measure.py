"""The error of each level of detail against the mesh, measured after baking."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, partial

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
from pvibr.maths.image_error import crossed, outline_distances
from pvibr.maths.sharpness import local_gradients, lowest_ratio
from pvibr.meshes.turntable import LEVEL

_CELL = 9 / 8  # side of a view's cell in diameters: the sizes fit the reference's pixels
_SAMPLES = 2  # samples of the reference along a side of a pixel at a layout's largest size


@dataclass(frozen=True)
class Layout:
    """Views in a square, and the diameters of the bounding sphere on the screen, px."""

    side: int  # views along a side of the square
    sizes: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of views."""
        return self.side**2


#: From four views of each patch of directions; from one what is larger.
LAYOUTS = Layout(2 * PATCH_SIDE, (8, 16, 32, 64, 128)), Layout(PATCH_SIDE, (256,))
_HOPELESS = 4.0  # px: a level that allows no `max_error` up to it is not tried at larger sizes
SLACK = 0.5  # px, of outlines whose distances are whole pixels apart
#: FLIP that is allowed of cards: the mesh's own, or a little beyond a smaller share of it:
#: where things touch or pierce one another theirs is more.
CARD_SHARE, CARD_SURE, CARD_LEAST = 1.0, 0.75, 0.005
_BEYOND = 0.6  # of what is allowed at 1 px, for each px beyond it
#: The same of lighter meshes, beside what one sample per pixel adds to theirs as to the mesh's.
MESH_SHARE, MESH_LEAST = 0.35, 0.005
#: The share of local gradients that a level may lose where it loses most: of fields of things of
#: all sizes at their limits less than half of that is lost.
BLUR = 0.25
_BLURRED_FROM = 32  # px from which blur is seen
#: px of `max_error` for each px by which coverage is lost or gained along outlines: both sides of
#: what is thin, and directions between the few views of a patch are several times worse.
_FADED = 8.0
_ROUNDED = 1.5 / 255  # what eight bits of a colour make of hardly any difference
_FLOOR = 1e-4  # FLIP below which nothing can be seen


def directions(side, half=False):
    """Return directions all around, one in each cell of an octahedral map: (side**2, 3)."""
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)
    within = np.random.default_rng(5).random((side**2, 2))
    return octahedral.decode((cells + within) / side * 2 - 1, half)


def level_directions(side, turns, half=False):
    """Return directions spread over a turntable's horizon: (side**2, 3)."""
    k = np.arange(side**2) + 0.5
    z = LEVEL * (1 - (1.0 if half else 2.0) * k / side**2)
    return _around(z) @ turns.sides()


def _around(z):
    k = np.arange(len(z)) + 0.5
    angle = np.pi * (1 + 5**0.5) * k + 0.7
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], 1)


def measure(model, progress=None, reference=None) -> dict[str, np.ndarray]:
    """Return the error table of a model's levels, (sizes, patches, 4) each."""
    # For each patch of directions, from its views: the displacement of outlines in pixels, the
    # means of FLIP of what is covered, and of that of the mesh drawn once per pixel, and the share
    # of local gradients that is lost. FLIP of lighter meshes is what many samples per pixel show:
    # one of them adds as much as to the mesh.
    atlas = model.atlas
    reference = reference or Reference(model)
    table = {'sizes': reference.sizes} | reference.meshes
    table |= reference.cards(model, CARD_SHADERS, progress or _unseen)
    if atlas.turntable is not None:
        level = Reference(
            model, partial(level_directions, turns=atlas.turntable.turns, half=atlas.half)
        )
        table |= level.cards(model, [p for p in ALL_CARD_SHADERS if p.sides])
    return table


class Reference:
    """The mesh in some views, by which its levels are measured; by default all around."""

    def __init__(self, model, views=None, progress=None):
        self._views = views or partial(directions, half=model.atlas.half)
        self.sizes = np.array([size for layout in LAYOUTS for size in layout.sizes], float)
        advance = progress or _unseen
        levels = model.levels if views is None else model.levels[:1]
        with self._sheets(model) as sheets:
            self._truths = [truth for sheet in sheets.values() for truth in _truths(sheet)]
            finest = cache(lambda: sheets[LAYOUTS[-1]].draw_mesh(0))
            #: The rows of lighter meshes.
            self.meshes: dict[str, np.ndarray] = {}
            for i, level in enumerate(levels[1:], 1):
                advance(i / len(levels))
                self.meshes |= self._of_mesh(i, level.error, sheets, finest)
        advance(1.0)

    @contextmanager
    def _sheets(self, model):
        """Yield a sheet for each layout."""
        with ExitStack() as stack:
            yield {k: stack.enter_context(_Sheet(model, k, self._views(k.side))) for k in LAYOUTS}

    def _of_mesh(self, i, radii, sheets, finest) -> dict:
        """Return the errors of a lighter mesh, and how far its surface is from the mesh's."""
        samples = cache(lambda layout: sheets[layout].draw_mesh(i))
        pixels = cache(lambda layout: _pixels(samples(layout), layout))
        if radii is None:
            radii = _finest_displacement(samples(LAYOUTS[-1]), finest())

        def errors(truth):
            picture = _without_rounding(pixels(truth.layout)[truth.size], truth.picture)
            return truth.errors(picture, radii * truth.size / 2 + SLACK)

        return {f'mesh{i}': _rows(self._truths, errors), f'mesh{i}.radii': np.array(radii)}

    def cards(self, model, shaders, progress=None) -> dict:
        """Return the rows of card shaders."""
        table, advance = {}, progress or _unseen
        with self._sheets(model) as sheets:
            for i, shader in enumerate(shaders):

                def errors(truth, name=shader.name):
                    return truth.card_errors(sheets[truth.layout].draw_cards(name, truth.size))

                table[shader.name] = _rows(self._truths, errors, shader.largest)
                advance((i + 1) / len(shaders))
        return table


def _truths(sheet) -> list:
    """Return the reference at each size of a sheet."""
    samples = sheet.draw_mesh(0)
    pixels = _pixels(samples, sheet.layout)
    return [_Truth(samples, picture, sheet.layout, size) for size, picture in pixels.items()]


def _unseen(_done):
    pass


def _rows(truths, errors, largest=np.inf):
    """Return the errors of a level at all sizes, (sizes, patches, 4)."""
    rows: list[np.ndarray] = []
    for i, truth in enumerate(truths):
        beyond = i and truths[i - 1].size >= largest
        if beyond or (rows and np.median(worst(card_needs(rows[-1]))) > _HOPELESS):
            rows.append(rows[-1] * [2.0, 1.5, 1.0, 1.5])  # it grows with the size
            continue
        rows.append(errors(truth))
        if i and truth.layout != truths[i - 1].layout:  # whose fewer views may miss the worst
            grown = (rows[-2][:, 0] - SLACK) * truth.size / truths[i - 1].size
            rows[-1][:, 0] = np.maximum(rows[-1][:, 0], grown + SLACK)
    return np.array(rows)


def card_needs(rows) -> dict[str, np.ndarray]:
    """Return by cause the least `max_error`, px, that allows errors of cards, (..., 4)."""
    displaced, flip, own, blur = np.moveaxis(np.asarray(rows), -1, 0)
    allowed = np.maximum(CARD_SHARE * own, CARD_SURE * own + CARD_LEAST)
    color = flip / allowed
    return _needs(displaced, np.where(color > 1, 1 + (color - 1) / _BEYOND, color), blur)


def mesh_needs(rows) -> dict[str, np.ndarray]:
    """Return the same of lighter meshes, which are sampled as the mesh is."""
    displaced, flip, own, blur = np.moveaxis(np.asarray(rows), -1, 0)
    # The mesh's own is along outlines, what these have beyond it is elsewhere: it adds up.
    return _needs(displaced, flip / np.maximum(MESH_SHARE * own, MESH_LEAST), blur)


def _needs(displaced, color, blur) -> dict[str, np.ndarray]:
    return {'outline': np.maximum(displaced - SLACK, 0.0), 'colour': color, 'blur': blur / BLUR}


def worst(needs) -> np.ndarray:
    """Return the least `max_error` in pixels that all causes allow."""
    return np.max([*needs.values()], axis=0)


class _Truth:
    """The reference at one size."""

    def __init__(self, samples, picture, layout, size):
        self.size, self.layout, self.picture = size, layout, picture
        tiles = self._tiles(picture)
        self.covered = np.maximum(tiles[..., 3].sum((1, 2)), 1.0)
        # Beside its like, as in a field: on white its outlines would count for all the rest.
        self.ground = (tiles[..., :3].sum((0, 1, 2)) / self.covered.sum()).astype(np.float32)
        self.flip = Flip(self._grounded(tiles))
        once = _once(samples, layout.sizes[-1], size)
        self.base, self.moved = self._flip(once), _moved(once, picture, layout.side)
        self.strayed = self._strayed(once)
        outlines = self._tiles(crossed(picture[..., 3]).astype(np.float32)[..., None])
        self.outlines = np.maximum(outlines.sum((1, 2, 3)), 1.0)
        self.faded = self._faded(once)
        self.gradients = self._gradients(tiles)

    def errors(self, picture, moved):
        """Return displacement, FLIP, that of the mesh and blur in each patch."""
        by_view = self._flip(picture), self.base, self._blur(picture)
        return np.stack(np.broadcast_arrays(moved, *map(_patches, by_view)), 1)

    def card_errors(self, picture):
        """Return the same of cards, whose soft outlines may be no worse than the mesh's."""
        moved = _moved(picture, self.picture, self.layout.side)
        moved = np.where(moved > self.moved, moved, 0.0)  # thin things: no worse than the mesh
        faded = self._faded(picture)
        faded = _by_patch(np.where(faded > self.faded, faded, 0.0)).max(1)
        moved = np.maximum(moved, _FADED * faded + SLACK)
        rows = self.errors(picture, moved)
        # Of each view by itself: what is seen edge-on covers little, and fades.
        strayed = _patches(self.base * self._strayed(picture) / self.strayed)
        rows[:, 1] = np.maximum(rows[:, 1], strayed)
        return rows

    def _faded(self, picture):
        """Return how much more or less is covered than in the reference, px along outlines."""
        covered = self._tiles(picture[..., 3:]).sum((1, 2, 3))
        return np.abs(covered - self._tiles(self.picture[..., 3:]).sum((1, 2, 3))) / self.outlines

    def _strayed(self, picture):
        """Return how far coverage is from the reference's, of a pixel that is covered."""
        away = np.abs(picture[..., 3] - self.picture[..., 3])[..., None]
        sums = self._tiles(away).sum((1, 2, 3))
        return np.maximum(sums / self.covered, _FLOOR)

    def _blur(self, picture):
        """Return the share of the truth's gradients that is lost where most is, in some views."""
        if self.size < _BLURRED_FROM:
            return np.zeros(self.layout.count)
        gradients = self._gradients(self._tiles(picture))
        pairs = zip(gradients, self.gradients, strict=True)
        return np.array([max(1 - lowest_ratio(*pair), 0.0) for pair in pairs])

    def _tiles(self, picture):
        return _tiles(picture, self.layout.side)

    def _gradients(self, tiles):
        return local_gradients(self._grounded(tiles))

    def _flip(self, picture):
        """Return the FLIP of a pixel that is covered, in some views, clamped to what is seen."""
        maps = self.flip.maps(self._grounded(self._tiles(picture)))
        return np.maximum(maps.sum((1, 2)) / self.covered, _FLOOR)

    def _grounded(self, picture):
        return np.clip(picture[..., :3] + (1 - picture[..., 3:]) * self.ground, 0, 1)


def _patches(values):
    """Return the means of the views of each patch."""
    return _by_patch(values).mean(1)


def _by_patch(values):
    """Return the values of the views of each patch."""
    some = round(len(values) ** 0.5) // PATCH_SIDE
    cells = values.reshape(PATCH_SIDE, some, PATCH_SIDE, some).swapaxes(1, 2)
    return cells.reshape(PATCHES, some * some)


def _tiles(picture, side):
    """Return the views of a picture one by one."""
    cell = len(picture) // side
    tiles = picture.reshape(side, cell, side, cell, -1).swapaxes(1, 2)
    return tiles.reshape(side**2, cell, cell, -1)


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


def _pixels(samples, layout) -> dict:
    """Return the pixels of each size of a layout, from samples of its largest."""
    halved = [_reduced(samples)]
    for _ in layout.sizes[1:]:
        halved.append(_halved(halved[-1]))
    return dict(zip(layout.sizes, halved[::-1], strict=True))


def _halved(pixels):
    """Return the means of squares of four pixels."""
    rows = pixels[::2] + pixels[1::2]
    return (rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25)


def _once(samples, largest, size):
    """Return one sample per pixel, at its centre."""
    step = largest * _SAMPLES // size
    return samples[step // 2 :: step, step // 2 :: step] / np.float32(255)


def _moved(picture, truth, side):
    """Return the displacement that bounds most of the outlines in each patch of directions."""
    # 99 of 100 pixels of all its views together, and 95 of 100 in each of these.
    pair = picture[..., 3], truth[..., 3]
    found = outline_distances(*pair), outline_distances(*pair[::-1])
    pixels, away = (np.concatenate(both) for both in zip(*found, strict=True))
    views, count = pixels // (len(picture) // side) @ [side, 1], side**2
    patches = np.empty(count, int)
    patches[_by_patch(np.arange(count))] = np.arange(PATCHES)[:, None]
    all_views = _bounds(away, patches[views], PATCHES, 0.99)
    return np.maximum(all_views, _by_patch(_bounds(away, views, count, 0.95)).max(1))


def _bounds(values, groups, count, share):
    """Return what bounds a share of the values of each group."""
    counts = np.bincount(groups, minlength=count)
    rank = np.cumsum(counts) - 1 - (1 - share) * (counts - 1)  # within each group's own, in order
    ordered = np.append(values[np.lexsort((values, groups))], 0.0)
    return np.where(counts, np.interp(rank, np.arange(len(ordered)), ordered), 0.0)


def _finest_displacement(samples, reference):
    """Return the outline's displacement in the worst patch, in radii."""
    layout, scale = LAYOUTS[-1], np.float32(1 / 255)
    moved = _moved(samples * scale, reference * scale, layout.side)
    return 2 * float(moved.max()) / (layout.sizes[-1] * _SAMPLES)


def _without_rounding(picture, truth):
    """Return a picture without differences that are no more than rounding."""
    # FLIP makes as much of one step of 255 all over a smooth surface as of all its outlines.
    return np.where(np.abs(picture - truth).max(-1, keepdims=True) > _ROUNDED, picture, truth)


class _Sheet:
    """Views of a model side by side in a small window of its own."""

    def __init__(self, model, layout, views):
        self.model, self.layout = model, layout
        self.context = hidden_window()
        self.window, self.renderer = self.context.__enter__()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.SetBackgroundAlpha(0.0)
        atlas = model.atlas
        self.spacing = 2 * atlas.radius * _CELL
        poses = _poses(atlas.center, self.spacing, views)
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
        camera.SetParallelScale(self.spacing * layout.side / 2)
        camera.SetClippingRange(2 * atlas.radius, 6 * atlas.radius)

    def _resize(self, size, shift=0.0):
        """Set the size in pixels, and shift by a part of one to the lower left."""
        cell = round(size * _CELL)
        self.window.SetSize(cell * self.layout.side, cell * self.layout.side)
        shift *= self.spacing / cell
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(-shift, -shift, 4 * self.model.atlas.radius)
        camera.SetFocalPoint(-shift, -shift, 0)

    def draw_mesh(self, level):
        """Return the samples of a mesh level, premultiplied RGBA of 8 bits."""
        self._resize(self.layout.sizes[-1] * _SAMPLES, 0.5)
        with self._mesh(level, list(range(len(self.group)))):
            return self._picture()

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
            raise ShaderError(f'the cards of shader {shader!r} are not drawn by this driver')
        return picture

    def _picture(self):
        self.window.Render()
        self.group.cards.binder.unbind()
        return read_pixels(self.window, alpha=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.release()

    def release(self):
        self.group.release()
        self.context.__exit__(None, None, None)


def _poses(center, spacing, views):
    """Return a pose per view: its direction turned to +z, in its cell."""
    side = round(len(views) ** 0.5)
    rng = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (len(views), 1, 1))
    poses[:, :3, :3] = octahedral.frame(views)
    column, row = np.meshgrid(np.arange(side), np.arange(side))
    cells = np.stack([column.ravel(), row.ravel()], 1) - (side - 1) / 2
    jitter = rng.uniform(-0.02, 0.02, cells.shape)
    poses[:, :2, 3] = (cells + jitter) * spacing
    poses[:, :3, 3] -= np.einsum('nij,j->ni', poses[:, :3, :3], center)
    return poses
