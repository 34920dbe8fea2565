"""The error of each level of detail against the mesh, measured after a bake."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial

import numpy as np

from pvibr.gl.hidden_window import hidden_window
from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS
from pvibr.instances.view_pictures import (
    SAMPLES,
    SLACK,
    Layout,
    SizedReference,
    displacement_of,
    pixels_of,
    without_rounding,
)
from pvibr.instances.view_sheet import Sheet
from pvibr.maths import octahedral
from pvibr.maths.image_error import Silhouette
from pvibr.meshes.turntable import SIDE_ELEVATION

#: Four views per patch of directions, one at the largest size.
LAYOUTS = Layout(2 * PATCH_SIDE, (8, 16, 32, 64, 128)), Layout(PATCH_SIDE, (256,))
_HOPELESS = 4.0  # px: a level that needs a larger `max_error` is not measured at larger sizes
#: FLIP that cards may have: as the mesh at one sample, or slightly more than a share of it, since
#: it is larger where things touch or pierce one another.
CARD_SHARE, CARD_SURE, CARD_LEAST = 1.0, 0.75, 0.005
_EXCESS_PER_PX = 0.6  # FLIP per px of `max_error` beyond the first, relative to that allowed at 1
#: FLIP that lighter meshes may add to that of one sample per pixel.
MESH_SHARE, MESH_LEAST = 0.35, 0.005
#: Share of local gradients that a level may lose where it loses most. Fields of instances of all
#: sizes, at their limits, lose less than half of that.
BLUR = 0.25
#: Pictures are compared in threads while the next ones are drawn.
_THREADS = 2


def workers() -> ThreadPoolExecutor:
    """Return threads that compare pictures; a failure cancels what waits for one."""
    return _Workers(_THREADS)


class _Workers(ThreadPoolExecutor):
    def __exit__(self, *error):
        self.shutdown(cancel_futures=error[0] is not None)


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
    if reference is None:
        with workers() as pool:
            with Reference(model, pool) as reference:
                reference.add_levels(model)
            return measure(model, progress, reference)
    table = {'sizes': reference.sizes} | reference.meshes
    table |= reference.cards(model, CARD_SHADERS, progress)
    if atlas.turntable is not None:
        side_views = partial(side_directions, turns=atlas.turntable.turns, half=atlas.half)
        sides = Reference(model, reference.pool, side_views)
        sides.close()
        table |= sides.cards(model, [s for s in ALL_CARD_SHADERS if s.sides])
    return table


class Reference:
    """Images of the mesh against which its levels are measured, by default from all around.

    Pictures are drawn within its context, and compared meanwhile in the threads of `pool`.
    """

    def __init__(self, model, pool, views=None):
        self._views = views or partial(directions, half=model.atlas.half)
        self.sizes = np.array([size for layout in LAYOUTS for size in layout.sizes], float)
        self.pool = pool
        self._mesh_tables: list[_MeshErrors] = []
        with ExitStack() as stack:
            self._sheets = stack.enter_context(self._open_sheets(model))
            self._samples = {k: sheet.draw_mesh(0) for k, sheet in self._sheets.items()}
            self._by_layout = {
                layout: pool.submit(_sized_references, samples, layout)
                for layout, samples in self._samples.items()
            }
            self._context = stack.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def close(self):
        """Close the window in which meshes are drawn."""
        self._context.close()
        self._sheets, self._samples = {}, {}

    @contextmanager
    def _open_sheets(self, model):
        """Yield a sheet for each layout, all in one window, which holds the images once."""
        with hidden_window() as shared, ExitStack() as stack:
            yield {
                k: stack.enter_context(Sheet(model, k, self._views(k.side), shared))
                for k in LAYOUTS
            }

    def of(self, layout) -> list[SizedReference]:
        """Return the reference at each size of a layout."""
        return self._by_layout[layout].result()

    @property
    def meshes(self) -> dict[str, np.ndarray]:
        """Errors of lighter meshes, as in the table."""
        return {k: v for table in self._mesh_tables for k, v in table.arrays().items()}

    def add_levels(self, model, progress=None):
        """Draw the lighter meshes of a model, and compare them."""
        levels = [*enumerate(model.levels)][1:]
        # Outlines of foliage at the finest decide on its errors at all sizes.
        is_surface = all(level.error is not None for _, level in levels)
        finest = None
        if not is_surface:
            finest = self.pool.submit(_finest_silhouette, self._samples[LAYOUTS[-1]])
        tables = [_MeshErrors(self, i, level.error, finest) for i, level in levels]
        phases = [[layout] for layout in LAYOUTS] if is_surface else [LAYOUTS]
        steps = [(layouts, table) for layouts in phases for table in tables]
        for k, (layouts, table) in enumerate(steps):
            if k >= _THREADS:
                steps[k - _THREADS][1].settle()  # so that few pictures wait
            table.draw(layouts, self._sheets)
            (progress or _no_progress)((k + 1) / len(steps))
        self._mesh_tables = tables

    def cards(self, model, shaders, progress=None) -> dict:
        """Return the errors of card shaders, as in the table."""
        tables = {shader.name: _ErrorTable(self.pool, shader.largest) for shader in shaders}
        steps = [(layout, reference) for layout in LAYOUTS for reference in self.of(layout)]
        with self._open_sheets(model) as sheets:
            for i, (layout, reference) in enumerate(steps):
                for name, table in tables.items():
                    picture = None
                    if table.is_next_needed():
                        picture = sheets[layout].draw_cards(name, reference.size)
                    table.add_later([reference], partial(_card_errors, picture))
                (progress or _no_progress)((i + 1) / len(steps))
        return {name: table.rows() for name, table in tables.items()}


def _sized_references(samples, layout) -> list[SizedReference]:
    """Return the reference at each size of a layout."""
    pixels = pixels_of(samples, layout).items()
    return [SizedReference(samples, picture, layout, size) for size, picture in pixels]


def _card_errors(picture, reference):
    return reference.card_errors(picture)


def _finest_silhouette(samples):
    return Silhouette(samples[..., 3] / np.float32(255))


def _no_progress(_fraction):
    pass


class _ErrorTable:
    """The errors of a level at all sizes, measured in threads."""

    def __init__(self, pool, largest=np.inf):
        self._pool, self._largest = pool, largest
        self._rows: list[np.ndarray] = []
        self._last: SizedReference | None = None
        self._pending: Future | None = None

    def settle(self):
        """Wait until what was added is measured."""
        if self._pending is not None:
            self._pending.result()

    def rows(self) -> np.ndarray:
        """Return the errors, (sizes, patches, 4)."""
        self.settle()
        return np.array(self._rows)

    def is_next_needed(self) -> bool:
        """Return False if the next size is too large for the level, or its errors hopeless."""
        self.settle()
        return self._is_next_needed()

    def _is_next_needed(self):
        if self._last is None:
            return True
        is_hopeless = np.median(worst(card_needs(self._rows[-1]))) > _HOPELESS
        return self._last.size < self._largest and not is_hopeless

    def add_later(self, references, errors):
        """Measure the next sizes by a function of their references."""
        self._pending = self._pool.submit(self._add, references, errors)

    def _add(self, references, errors):
        for reference in references:
            if self._is_next_needed():
                self._rows.append(errors(reference))
                self._carry(reference)
            else:
                self._rows.append(self._rows[-1] * [2.0, 1.5, 1.0, 1.5])  # it grows with the size
            self._last = reference

    def _carry(self, reference):
        """Keep the errors of outlines above those of a layout of more views."""
        # Fewer views may miss the worst.
        if self._last is not None and self._last.layout != reference.layout:
            scaled = (self._rows[-2][:, 0] - SLACK) * reference.size / self._last.size
            self._rows[-1][:, 0] = np.maximum(self._rows[-1][:, 0], scaled + SLACK)


class _MeshErrors(_ErrorTable):
    """The errors of a lighter mesh, and its surface's distance from the mesh's in radii."""

    def __init__(self, reference, index, radii, finest):
        super().__init__(reference.pool)
        self._reference, self._index = reference, index
        self._radii, self._finest = radii, finest

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what it adds to the table."""
        name = f'mesh{self._index}'
        return {name: self.rows(), f'{name}.radii': np.array(self._radii)}

    def draw(self, layouts, sheets):
        """Draw the mesh in layouts, unless its errors are hopeless, and compare it later."""
        samples = {}
        for layout in layouts:
            is_needed = len(layouts) > 1 or self.is_next_needed()
            samples[layout] = sheets[layout].draw_mesh(self._index) if is_needed else None
        self._pending = self._pool.submit(self._measure, samples)

    def _measure(self, samples):
        if self._radii is None:
            self._radii = _displacement(samples[LAYOUTS[-1]], self._finest.result())
        for layout, drawn in samples.items():
            pixels = {} if drawn is None else pixels_of(drawn, layout)
            self._add(self._reference.of(layout), partial(self._errors, pixels))

    def _errors(self, pixels, reference):
        picture = without_rounding(pixels[reference.size], reference.picture)
        return reference.errors(picture, self._radii * reference.size / 2 + SLACK)


def _displacement(samples, finest) -> float:
    """Return the displacement of outlines in the worst patch, in radii."""
    layout = LAYOUTS[-1]
    displacement = displacement_of(_finest_silhouette(samples), finest, layout.side)
    return 2 * float(displacement.max()) / (layout.sizes[-1] * SAMPLES)


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
