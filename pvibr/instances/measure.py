"""The error of each level of detail against the mesh, measured after a bake."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from pvibr.core import _vtk
from pvibr.core.errors import ShaderError
from pvibr.gl.binder import Binder
from pvibr.gl.hidden_window import hidden_window, read_pixels
from pvibr.instances.card_layers import PATCH_SIDE, PATCHES
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS
from pvibr.instances.group import InstanceGroup
from pvibr.instances.mesh_pool import MeshPool
from pvibr.instances.sharpness import local_gradients, lowest_ratio
from pvibr.maths import octahedral
from pvibr.maths.flip import Flip
from pvibr.maths.image_error import crossed, outline_distances
from pvibr.meshes.turntable import SIDE_ELEVATION
from pvibr.things.frame import Frame

_CELL = 9 / 8  # side of a view's cell in diameters: the sizes fit the reference's pixels
_SAMPLES = 2  # reference samples along a side of a pixel, at a layout's largest size


@dataclass(frozen=True)
class Layout:
    """Views in a square, and the on-screen diameters of the bounding sphere, px."""

    side: int  # views along a side of the square
    sizes: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of views."""
        return self.side**2


#: Four views per patch of directions, one at the largest size.
LAYOUTS = Layout(2 * PATCH_SIDE, (8, 16, 32, 64, 128)), Layout(PATCH_SIDE, (256,))
_HOPELESS = 4.0  # px: a level that needs a larger `max_error` is not measured at larger sizes
SLACK = 0.5  # px: outline distances are resolved to whole pixels
#: FLIP that cards may have: as the mesh at one sample, or slightly more than a share of it, since
#: it is larger where things touch or pierce one another.
CARD_SHARE, CARD_SURE, CARD_LEAST = 1.0, 0.75, 0.005
_EXCESS_PER_PX = 0.6  # FLIP per px of `max_error` beyond the first, relative to that allowed at 1
#: FLIP that lighter meshes may add to that of one sample per pixel.
MESH_SHARE, MESH_LEAST = 0.35, 0.005
#: Share of local gradients that a level may lose where it loses most. Fields of instances of all
#: sizes, at their limits, lose less than half of that.
BLUR = 0.25
_BLURRED_FROM = 32  # px from which blur is visible
#: px of `max_error` per px of coverage lost or gained along outlines: thin things have two sides,
#: and directions between the few views of a patch are several times worse.
_COVERAGE_WEIGHT = 8.0
_ROUNDED = 1.5 / 255  # what rounding to eight bits can make of an invisible difference
_FLOOR = 1e-4  # invisible FLIP


def directions(side, half=False):
    """Return directions all around, one in each cell of an octahedral map: (side**2, 3)."""
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)
    jitter = np.random.default_rng(5).random((side**2, 2))
    return octahedral.decode((cells + jitter) / side * 2 - 1, half)


def side_directions(side, turns, half=False):
    """Return directions along a turntable's horizon: (side**2, 3)."""
    k = np.arange(side**2) + 0.5
    z = SIDE_ELEVATION * (1 - (1.0 if half else 2.0) * k / side**2)
    angle = np.pi * (1 + 5**0.5) * k + 0.7
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], 1) @ turns.sides()


def measure(model, progress=None, reference=None) -> dict[str, np.ndarray]:
    """Return the error table of a model's levels, (sizes, patches, 4) each."""
    # Columns: displacement of outlines in pixels; mean FLIP over covered pixels, of the level and
    # of the mesh at one sample per pixel; share of local gradients lost. Lighter meshes are
    # supersampled: at one sample their FLIP would contain the mesh's own.
    atlas = model.atlas
    reference = reference or Reference(model)
    table = {'sizes': reference.sizes} | reference.meshes
    table |= reference.cards(model, CARD_SHADERS, progress)
    if atlas.turntable is not None:
        side_views = partial(side_directions, turns=atlas.turntable.turns, half=atlas.half)
        table |= Reference(model, side_views).cards(
            model, [s for s in ALL_CARD_SHADERS if s.sides]
        )
    return table


class Reference:
    """Images of the mesh against which its levels are measured, by default from all around."""

    def __init__(self, model, views=None, progress=None):
        self._views = views or partial(directions, half=model.atlas.half)
        self.sizes = np.array([size for layout in LAYOUTS for size in layout.sizes], float)
        advance = progress or _no_progress
        levels = model.levels if views is None else model.levels[:1]
        with self._sheets(model) as sheets:
            self._references = [r for sheet in sheets.values() for r in _sized_references(sheet)]
            finest_samples = cache(lambda: sheets[LAYOUTS[-1]].draw_mesh(0))
            #: Errors of lighter meshes, as in the table.
            self.meshes: dict[str, np.ndarray] = {}
            for i, level in enumerate(levels[1:], 1):
                advance(i / len(levels))
                self.meshes |= self._of_mesh(i, level.error, sheets, finest_samples)
        advance(1.0)

    @contextmanager
    def _sheets(self, model):
        """Yield a sheet for each layout."""
        with ExitStack() as stack:
            yield {k: stack.enter_context(_Sheet(model, k, self._views(k.side))) for k in LAYOUTS}

    def _of_mesh(self, i, radii, sheets, finest_samples) -> dict:
        """Return the errors of a lighter mesh, and its surface's distance in radii."""
        samples = cache(lambda layout: sheets[layout].draw_mesh(i))
        pixels = cache(lambda layout: _pixels(samples(layout), layout))
        if radii is None:
            radii = _finest_displacement(samples(LAYOUTS[-1]), finest_samples())

        def errors(reference):
            picture = pixels(reference.layout)[reference.size]
            picture = _without_rounding(picture, reference.picture)
            return reference.errors(picture, radii * reference.size / 2 + SLACK)

        table = _error_table(self._references, errors)
        return {f'mesh{i}': table, f'mesh{i}.radii': np.array(radii)}

    def cards(self, model, shaders, progress=None) -> dict:
        """Return the errors of card shaders, as in the table."""
        table, advance = {}, progress or _no_progress
        with self._sheets(model) as sheets:
            for i, shader in enumerate(shaders):

                def errors(reference, name=shader.name):
                    picture = sheets[reference.layout].draw_cards(name, reference.size)
                    return reference.card_errors(picture)

                table[shader.name] = _error_table(self._references, errors, shader.largest)
                advance((i + 1) / len(shaders))
        return table


def _sized_references(sheet) -> list:
    """Return the reference at each size of a sheet."""
    samples = sheet.draw_mesh(0)
    pixels = _pixels(samples, sheet.layout).items()
    return [_SizedReference(samples, picture, sheet.layout, size) for size, picture in pixels]


def _no_progress(_fraction):
    pass


def _error_table(references, errors, largest=np.inf):
    """Return the errors of a level at all sizes, (sizes, patches, 4)."""
    table: list[np.ndarray] = []
    for i, reference in enumerate(references):
        is_oversized = i and references[i - 1].size >= largest
        if is_oversized or (table and np.median(worst(card_needs(table[-1]))) > _HOPELESS):
            table.append(table[-1] * [2.0, 1.5, 1.0, 1.5])  # it grows with the size
            continue
        table.append(errors(reference))
        # A layout of fewer views may miss the worst.
        if i and reference.layout != references[i - 1].layout:
            scaled = (table[-2][:, 0] - SLACK) * reference.size / references[i - 1].size
            table[-1][:, 0] = np.maximum(table[-1][:, 0], scaled + SLACK)
    return np.array(table)


def card_needs(errors) -> dict[str, np.ndarray]:
    """Return by cause the smallest `max_error`, px, that accepts errors of cards, (..., 4)."""
    displacement, flip, mesh_flip, blur = np.moveaxis(np.asarray(errors), -1, 0)
    allowed = np.maximum(CARD_SHARE * mesh_flip, CARD_SURE * mesh_flip + CARD_LEAST)
    color = flip / allowed
    return _needs(displacement, np.where(color > 1, 1 + (color - 1) / _EXCESS_PER_PX, color), blur)


def mesh_needs(errors) -> dict[str, np.ndarray]:
    """Return the same for errors of lighter meshes."""
    displacement, flip, mesh_flip, blur = np.moveaxis(np.asarray(errors), -1, 0)
    # The mesh's own FLIP is along outlines, what these add is elsewhere: it adds up.
    return _needs(displacement, flip / np.maximum(MESH_SHARE * mesh_flip, MESH_LEAST), blur)


def _needs(displacement, color, blur) -> dict[str, np.ndarray]:
    return {'outline': np.maximum(displacement - SLACK, 0.0), 'colour': color, 'blur': blur / BLUR}


def worst(needs) -> np.ndarray:
    """Return the smallest `max_error`, px, that every cause accepts."""
    return np.max([*needs.values()], axis=0)


class _SizedReference:
    """The reference at one size."""

    def __init__(self, samples, picture, layout, size):
        self.size, self.layout, self.picture = size, layout, picture
        tiles = self._tiles(picture)
        self.covered = np.maximum(tiles[..., 3].sum((1, 2)), 1.0)
        # On its mean colour, as in a field of its like: on white, outlines would dominate.
        self.background = (tiles[..., :3].sum((0, 1, 2)) / self.covered.sum()).astype(np.float32)
        self.flip = Flip(self._on_background(tiles))
        outlines = self._tiles(crossed(picture[..., 3]).astype(np.float32)[..., None])
        self.outlines = np.maximum(outlines.sum((1, 2, 3)), 1.0)
        self.gradients = self._gradients(tiles)
        mesh = _one_sample(samples, layout.sizes[-1], size)
        self.mesh_flip = self._flip(mesh)
        self.mesh_displacement = _displacement(mesh, picture, layout.side)
        self.mesh_coverage_error = self._coverage_error(mesh)
        self.mesh_coverage_shift = self._coverage_shift(mesh)

    def errors(self, picture, displacement):
        """Return displacement, FLIP, that of the mesh and blur in each patch."""
        by_view = self._flip(picture), self.mesh_flip, self._blur(picture)
        return np.stack(np.broadcast_arrays(displacement, *map(_patches, by_view)), 1)

    def card_errors(self, picture):
        """Return the same of cards, whose soft outlines may be no worse than the mesh's."""
        # What is no worse than the mesh, as thin things are, does not count.
        displacement = _displacement(picture, self.picture, self.layout.side)
        displacement = np.where(displacement > self.mesh_displacement, displacement, 0.0)
        shift = self._coverage_shift(picture)
        shift = _by_patch(np.where(shift > self.mesh_coverage_shift, shift, 0.0)).max(1)
        errors = self.errors(picture, np.maximum(displacement, _COVERAGE_WEIGHT * shift + SLACK))
        # Relative to each view: what is seen edge-on covers little, and fades.
        coverage_ratio = self._coverage_error(picture) / self.mesh_coverage_error
        errors[:, 1] = np.maximum(errors[:, 1], _patches(self.mesh_flip * coverage_ratio))
        return errors

    def _coverage_shift(self, picture):
        """Return the coverage gained or lost in each view, px along outlines."""
        coverage = self._tiles(picture[..., 3:]).sum((1, 2, 3))
        return np.abs(coverage - self._tiles(self.picture[..., 3:]).sum((1, 2, 3))) / self.outlines

    def _coverage_error(self, picture):
        """Return the absolute error of coverage in each view, per covered pixel."""
        difference = np.abs(picture[..., 3] - self.picture[..., 3])[..., None]
        return np.maximum(self._tiles(difference).sum((1, 2, 3)) / self.covered, _FLOOR)

    def _blur(self, picture):
        """Return the share of gradients lost in each view, where most are lost."""
        if self.size < _BLURRED_FROM:
            return np.zeros(self.layout.count)
        pairs = zip(self._gradients(self._tiles(picture)), self.gradients, strict=True)
        return np.array([max(1 - lowest_ratio(*pair), 0.0) for pair in pairs])

    def _tiles(self, picture):
        return _tiles(picture, self.layout.side)

    def _gradients(self, tiles):
        return local_gradients(self._on_background(tiles))

    def _flip(self, picture):
        """Return the FLIP of each view per covered pixel, at least `_FLOOR`."""
        maps = self.flip.maps(self._on_background(self._tiles(picture)))
        return np.maximum(maps.sum((1, 2)) / self.covered, _FLOOR)

    def _on_background(self, picture):
        return np.clip(picture[..., :3] + (1 - picture[..., 3:]) * self.background, 0, 1)


def _patches(values):
    """Return the mean over the views of each patch."""
    return _by_patch(values).mean(1)


def _by_patch(values):
    """Return values by view as values by patch, (PATCHES, views)."""
    views = round(len(values) ** 0.5) // PATCH_SIDE
    cells = values.reshape(PATCH_SIDE, views, PATCH_SIDE, views).swapaxes(1, 2)
    return cells.reshape(PATCHES, views * views)


def _tiles(picture, side):
    """Return the views of a picture, (views, cell, cell, channels)."""
    cell = len(picture) // side
    tiles = picture.reshape(side, cell, side, cell, -1).swapaxes(1, 2)
    return tiles.reshape(side**2, cell, cell, -1)


def _reduced(picture):
    """Return pixels of the largest size, averaging samples with half weight on borders."""
    sums = picture.astype(np.uint16)
    for axis in (0, 1):
        sums = np.moveaxis(sums, axis, 0)
        sums = sums.reshape(len(sums) // _SAMPLES, _SAMPLES, *sums.shape[1:])
        borders = sums[:, 0]
        sums = borders + 2 * sums[:, 1:].sum(1, dtype=sums.dtype) + np.roll(borders, -1, 0)
        sums = np.moveaxis(sums, 0, axis)
    return sums / np.float32(255 * (2 * _SAMPLES) ** 2)


def _pixels(samples, layout) -> dict:
    """Return the pixels of each size of a layout from the samples of its largest."""
    pixels = {layout.sizes[-1]: _reduced(samples)}
    for size in layout.sizes[-2::-1]:
        larger = pixels[2 * size]
        sums = larger[::2] + larger[1::2]
        pixels[size] = (sums[:, ::2] + sums[:, 1::2]) * np.float32(0.25)
    return dict(sorted(pixels.items()))


def _one_sample(samples, largest, size):
    """Return one sample per pixel, at its centre."""
    step = largest * _SAMPLES // size
    return samples[step // 2 :: step, step // 2 :: step] / np.float32(255)


def _displacement(picture, truth, side):
    """Return a bound of most outline displacements in each patch, px."""
    # The 99th percentile over all views of a patch, and the 95th in each of them.
    coverages = picture[..., 3], truth[..., 3]
    both_ways = outline_distances(*coverages), outline_distances(*coverages[::-1])
    pixel_ids, distances = (np.concatenate(sides) for sides in zip(*both_ways, strict=True))
    view_ids, view_count = pixel_ids // (len(picture) // side) @ [side, 1], side**2
    patch_ids = np.empty(view_count, int)
    patch_ids[_by_patch(np.arange(view_count))] = np.arange(PATCHES)[:, None]
    all_views = _quantiles(distances, patch_ids[view_ids], PATCHES, 0.99)
    each_view = _quantiles(distances, view_ids, view_count, 0.95)
    return np.maximum(all_views, _by_patch(each_view).max(1))


def _quantiles(values, groups, count, share):
    """Return the quantile of a share of the values of each group, 0 for empty ones."""
    counts = np.bincount(groups, minlength=count)
    # Ranks in the values of all groups, sorted within each.
    ranks = np.cumsum(counts) - 1 - (1 - share) * (counts - 1)
    ordered = np.append(values[np.lexsort((values, groups))], 0.0)
    return np.where(counts, np.interp(ranks, np.arange(len(ordered)), ordered), 0.0)


def _finest_displacement(samples, reference):
    """Return the displacement of outlines in the worst patch, in radii."""
    layout, scale = LAYOUTS[-1], np.float32(1 / 255)
    displacement = _displacement(samples * scale, reference * scale, layout.side)
    return 2 * float(displacement.max()) / (layout.sizes[-1] * _SAMPLES)


def _without_rounding(picture, truth):
    """Return a picture without differences within rounding."""
    # FLIP weighs one step of 255 all over a smooth surface like all its outlines.
    return np.where(np.abs(picture - truth).max(-1, keepdims=True) > _ROUNDED, picture, truth)


class _Sheet:
    """Views of a model side by side in a small hidden window."""

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
        # The light kit of PyVista's plotters: harder on averaged normals than VTK's headlight.
        self.renderer.RemoveAllLights()
        self.lights = _vtk.vtkLightKit()
        self.lights.AddLightsToRenderer(self.renderer)
        camera = self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetViewUp(0, 1, 0)
        camera.SetParallelScale(self.spacing * layout.side / 2)
        camera.SetClippingRange(2 * atlas.radius, 6 * atlas.radius)

    def _resize(self, size, shift=0.0):
        """Set the size in pixels, and shift the camera by a fraction of one to the lower left."""
        cell = round(size * _CELL)
        self.window.SetSize(cell * self.layout.side, cell * self.layout.side)
        shift *= self.spacing / cell
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(-shift, -shift, 4 * self.model.atlas.radius)
        camera.SetFocalPoint(-shift, -shift, 0)

    def draw_mesh(self, level):
        """Return the samples of a mesh level, premultiplied RGBA uint8."""
        self._resize(self.layout.sizes[-1] * _SAMPLES, 0.5)
        pool = MeshPool(self.model.levels[level])
        slots = range(len(self.group))
        actors = pool.show(slots, self.group.matrix, lambda _: (0.0, 0.0, 0.0, 0.5))
        for actor in actors:
            self.renderer.AddViewProp(actor)
        picture = self._picture()
        for actor in actors:
            self.renderer.RemoveViewProp(actor)
            actor.ReleaseGraphicsResources(self.window)
        return picture

    def draw_cards(self, shader, size):
        """Return the image of a shader's cards, premultiplied RGBA, 0 to 1."""
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
            raise ShaderError(f'this driver does not draw the cards of shader {shader!r}')
        return picture

    def _picture(self):
        self.window.Render()
        self.group.cards.binder.unbind()
        return read_pixels(self.window, alpha=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.group.release()
        self.context.__exit__(None, None, None)


def _poses(center, spacing, views):
    """Return a pose per view that turns its direction to +z in its cell, jittered."""
    views_per_side = round(len(views) ** 0.5)
    rng = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (len(views), 1, 1))
    poses[:, :3, :3] = octahedral.frame(views)
    column, row = np.meshgrid(np.arange(views_per_side), np.arange(views_per_side))
    cell_positions = np.stack([column.ravel(), row.ravel()], 1) - (views_per_side - 1) / 2
    jitter = rng.uniform(-0.02, 0.02, cell_positions.shape)
    poses[:, :2, 3] = (cell_positions + jitter) * spacing
    poses[:, :3, 3] -= np.einsum('nij,j->ni', poses[:, :3, :3], center)
    return poses
