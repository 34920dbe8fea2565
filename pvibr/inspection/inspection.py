"""An overlay of levels of detail, impostor images and timings."""

from __future__ import annotations

from collections import Counter
from weakref import WeakKeyDictionary

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.observers import weakly
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.inspection.atlas_tiles import FLASH, ImageTree, Sheet, as_bytes, has_images
from pvibr.inspection.marks import Marks, edges, outlines, projected
from pvibr.instances.instances import Instances
from pvibr.maths.blocks import BLOCK

#: Colours of levels, hot for costly ones, distinct under colour blindness: Okabe and Ito, "Color
#: Universal Design", 2008.
LEVELS = {
    'mesh': (0.835, 0.369, 0.0),
    'lighter mesh': (0.902, 0.624, 0.0),
    'fine': (0.97, 0.95, 0.68),
    'blended': (0.941, 0.894, 0.259),
    'parallax': (0.0, 0.62, 0.451),
    'flat': (0.337, 0.706, 0.914),
    'turntable': (0.8, 0.475, 0.655),
    'billboard': (0.75, 0.75, 0.75),
    'splat': (0.0, 0.447, 0.698),
}
IMAGE = (0.5, 0.5, 0.5)
_LIGHTER = LEVELS['lighter mesh']
_SMALLEST = 40.0  # px: smaller boxes are omitted
_RENDERED = ('rendered', 'taken')  # report keys of the number of rendered images
_NAME, _LINE = 19, 29  # maximum lengths of names and lines, characters


class Inspection(Effect):
    """Shows how a subplot is drawn, see :meth:`pl.ibr.inspect <IBRComponent.inspect>`."""

    web = 'lost', 'it shows how frames are drawn here; a browser draws its own'
    before = 'Tap'  # after all things have chosen their levels

    levels = Param(True, 'Tint instances by the level that draws them.')
    cells = Param(True, 'Outline the blocks that are culled together.')
    atlas = Param(True, 'Show the images of one thing, with those in use outlined.')
    table = Param(True, 'List images rendered now, and milliseconds per effect.')

    def __init__(self, thing=None, **settings):
        super().__init__(**settings)
        if not isinstance(thing, Instances | ImageTree | None):
            raise TypeError(f'atlas must be True, False, instances or an impostor, got {thing!r}')
        self.thing = thing
        self._marks = Marks()
        self._tinted: list = []
        self._boxes: WeakKeyDictionary = WeakKeyDictionary()
        self._time_rows: list = []
        self._text_rows: list = []
        self._image_totals: dict[str, int] = {}
        self._counts: dict = {}
        self._observer: int | None = None
        self._moves: tuple = ()
        self._pointed: tuple | None = None  # instances, and the index under the pointer

    @property
    def props(self) -> tuple:
        """The 2D actors of the overlay."""
        return tuple(self._marks.actors)

    def attach(self, pipeline):
        """Add the overlay to the subplot."""
        super().attach(pipeline)
        for actor in self.props:
            put_inner(pipeline.renderer, actor)
        self._observer = pipeline.renderer.AddObserver('EndEvent', self._on_end, 0.0)
        interactor = pipeline.window.GetInteractor()
        if interactor is not None:
            tag = interactor.AddObserver('MouseMoveEvent', weakly(self._on_move))
            self._moves = interactor, tag

    def detach(self):
        """Remove the overlay from the subplot."""
        for actor in self.props:
            self.pipeline.renderer.RemoveViewProp(actor)
        self.pipeline.renderer.RemoveObserver(self._observer)
        if self._moves:
            interactor, tag = self._moves
            interactor.RemoveObserver(tag)
        self._moves, self._pointed = (), None
        super().detach()

    def deactivate(self):
        """Hide the overlay."""
        self._untint()
        self._marks.hide()

    def release(self):
        """Free GPU memory; the context is current."""
        self.deactivate()
        window = self.pipeline.window
        if window is not None:
            self._marks.release(window)

    def report(self) -> dict:
        """Return the statistics of the last frame."""
        return {'bytes': 0, **self._counts}

    def _on_end(self, renderer, _event):
        if renderer.GetSelector() is None and self.pipeline is not None:
            self._time_rows = _milliseconds(self.pipeline.report())

    def _on_move(self):
        interactor, _ = self._moves
        if self.point_at(*interactor.GetEventPosition()):
            interactor.Render()

    def point_at(self, x, y) -> bool:
        """Explain the instance under a pixel in the next frames; return True if it changed."""
        sets = [e for e in self.pipeline.effects if isinstance(e, Instances) and e.enabled]
        hits = [(hit.distance, k, hit.index) for k, e in enumerate(sets) if (hit := e.pick(x, y))]
        previous, self._pointed = self._pointed, None
        if hits:
            _, k, index = min(hits)
            self._pointed = sets[k], index
        return self._pointed != previous

    def _explained(self) -> list:
        """Return rows that explain how the instance under the pointer is drawn."""
        if self._pointed is None:
            return []
        instances, index = self._pointed
        if instances.pipeline is not self.pipeline or index >= len(instances):
            return []
        explained = instances.explain(index)
        spans = [span for span in explained.levels if span.high > span.low]
        rows = [
            (_row(f'instance {index}', f'{explained.size:.0f} px'), None),
            (_row('patch', explained.patch), None),
        ]
        if explained.note:
            rows.append((_row(explained.note[:_NAME], ''), None))
        return rows + [(_row(_until(s), s.rule), LEVELS.get(s.name, _LIGHTER)) for s in spans]

    # -- a frame -----------------------------------------------------------------------------

    def prepare(self, frame):
        """Update the overlay with the levels and images chosen for a frame."""
        report = self.pipeline.report()
        effect_rows = list(zip(self.pipeline.effects, report.rows, strict=True))
        drawn_effects = [effect for effect, row in effect_rows if row.state == 'ran']
        groups = [k for e in drawn_effects if isinstance(e, Instances) for k in e.groups]
        impostors = [e for e in drawn_effects if isinstance(e, ImageTree)]
        self._tint(groups)
        self._show_cells(frame, groups, impostors)
        if not self._text_rows or frame.tile == (0.0, 0.0, 1.0, 1.0):
            # The tiles of a large screenshot share one frame's text.
            self._counts = {
                'levels': level_counts(groups),
                'cells': self._cell_counts(groups),
                'images': sum(int(_shown_images(e, frame).sum()) for e in impostors),
                'new_images': self._count_new_images(frame, effect_rows),
            }
            self._text_rows = self._explained() + self._legend() + self._table(report)
        self._show_atlas(frame, self._chosen(drawn_effects))

    def finish(self, frame):
        """Restore the colours of all things."""
        self._untint()

    def _tint(self, groups):
        # Only while this frame is drawn: live textures and later frames stay untinted.
        if self.levels:
            self._tinted = groups
            for group in groups:
                group.tint(LEVELS)

    def _untint(self):
        while self._tinted:
            self._tinted.pop().tint({})

    # -- text --------------------------------------------------------------------------------

    def _legend(self) -> list:
        if not self.levels:
            return []
        rows = [(_row(n, f'{c:,}'), LEVELS[n]) for n, c in self._counts['levels'].items() if c]
        if self._counts['images']:
            rows.append((_row('image', f'{self._counts["images"]:,}'), IMAGE))
        return rows

    def _table(self, report) -> list:
        if not self.table:
            return []
        rows: list = []
        visible, total = self._counts['cells']
        if self.cells and total:
            rows.append((_row('cells', f'{visible:,} of {total:,}'), None))
        if self._image_totals:
            count, total = self._counts['new_images'], sum(self._image_totals.values())
            rows.append((_row('new images', f'{count:,} of {total:,}'), FLASH if count else None))
        rows.append((_row('effect', 'ms'), None))
        return rows + [(text, None) for text in self._time_rows or _milliseconds(report)]

    def _cell_counts(self, groups) -> tuple[int, int]:
        visible_cells = sum(len(_cells_seen(group)) for group in groups)
        return visible_cells, sum(-(-len(group) // BLOCK) for group in groups)

    def _count_new_images(self, frame, pairs) -> int:
        """Return the number of images rendered since the last frame."""
        previous_totals, self._image_totals, new_count = self._image_totals, {}, 0
        for number, (effect, row) in enumerate(pairs):
            image_total = next((int(row.details[n]) for n in _RENDERED if n in row.details), None)
            if image_total is None:
                continue
            key = f'{number} {row.effect}'
            self._image_totals[key] = image_total
            if isinstance(effect, ImageTree):
                new_count += _rendered_now(effect, frame)
            else:
                new_count += max(image_total - previous_totals.get(key, image_total), 0)
        return new_count

    # -- boxes -------------------------------------------------------------------------------

    def _show_cells(self, frame, groups, impostors):
        low, high, colors = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 4))
        if self.cells:
            box_sets = [self._cells(group, _ink(frame.renderer)) for group in groups]
            box_sets += [_image_boxes(e, frame) for e in impostors]
            if box_sets:
                low, high, colors = (np.concatenate(a) for a in zip(*box_sets, strict=True))
        is_large = _diameters(frame, low, high) >= _SMALLEST
        lines = edges(low[is_large], high[is_large])
        places, line_ids = projected(frame, lines.reshape(-1, 2, 3))
        self._marks.boxes.show(places, colors[is_large][line_ids // 12])

    def _cells(self, group, ink):
        """Return corners and colours of a group's cells, stronger for visible ones."""
        if group not in self._boxes:
            centers, radii = group.centers(np.arange(len(group))), group.radii[:, None]
            starts = np.arange(0, len(group), BLOCK)
            self._boxes[group] = (
                np.minimum.reduceat(centers - radii, starts),
                np.maximum.reduceat(centers + radii, starts),
            )
        low, high = self._boxes[group]
        colors = np.tile((*ink, 50), (len(low), 1))
        colors[_cells_seen(group), 3] = 120
        return low, high, colors

    # -- images ------------------------------------------------------------------------------

    def _chosen(self, drawn_effects):
        """Return the thing whose images are shown."""
        if not self.atlas:
            return None
        candidates = [e for e in drawn_effects if isinstance(e, Instances | ImageTree)]
        if self.thing is not None:
            return self.thing if self.thing in candidates else None
        return next((e for e in candidates if has_images(e)), None)

    def _show_atlas(self, frame, source):
        size = np.divide(frame.whole, frame.scale)
        sheet = None if source is None or not has_images(source) else Sheet(source, frame)
        picture_title = None if sheet is None else (source.name, sheet.ratio)
        picture_box = self._marks.write(size, self._text_rows, picture_title, frame.scale)
        if sheet is None:
            self._marks.picture.hide()
            self._marks.tiles.show(np.zeros((0, 2, 2)), np.zeros((0, 4)))
            return
        self._marks.picture.show(sheet.texture, sheet.part, picture_box)
        low, high = picture_box
        lines = low + outlines(sheet.low, sheet.high) * (high - low)
        self._marks.tiles.show(lines, sheet.colors.repeat(4, 0))


def level_counts(groups) -> dict[str, int]:
    """Return the number of instances that each level draws."""
    counts: Counter = Counter()
    for group in groups:
        levels = group.near.level_of
        counts.update({'mesh': int((levels == 0).sum()), 'lighter mesh': int((levels > 0).sum())})
        counts.update({name: group.counts.get(name, 0) for name in group.cards.layers})
    return {name: counts[name] for name in LEVELS}


def _shown_images(impostor, frame):
    """Return a mask of an impostor's images shown in a frame."""
    images = impostor.images
    if images is None:
        return np.zeros(0, bool)
    return images.alive & (images.shown_frame == frame.index)


def _cells_seen(group):
    """Return the cells of a group with visible instances."""
    return np.unique(group.visible_blocks * group.unit // BLOCK)


def _rendered_now(impostor, frame) -> int:
    """Return the number of an impostor's images rendered for a frame."""
    images = impostor.images
    return 0 if images is None else int((images.rendered_frame[images.alive] == frame.index).sum())


def _image_boxes(impostor, frame):
    """Return corners and colours of the boxes that an impostor draws as images."""
    images, shown_images = impostor.images, np.flatnonzero(_shown_images(impostor, frame))
    if not len(shown_images):
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 4))
    nodes = shown_images // images.views
    colors = np.tile((*as_bytes(IMAGE), 255), (len(shown_images), 1))
    colors[images.rendered_frame[shown_images] == frame.index, :3] = as_bytes(FLASH)
    return impostor.nodes.low[nodes], impostor.nodes.high[nodes], colors


def _diameters(frame, low, high):
    """Return the approximate diameters of boxes in pixels."""
    eye_distance = np.linalg.norm((low + high) / 2 - frame.eye, axis=1)
    eye_distance = 1.0 if frame.parallel else np.maximum(eye_distance, frame.near)
    return np.linalg.norm(high - low, axis=1) * frame.pixel_scale / eye_distance


def _ink(renderer):
    """Return a colour that contrasts with a renderer's background."""
    light = np.dot(renderer.GetBackground(), (0.3, 0.6, 0.1)) > 0.5
    return (0, 0, 0) if light else (255, 255, 255)


def _milliseconds(report) -> list[str]:
    """Return a line per effect: its time or status."""
    time_texts = [f'{row.ms:.1f}' if row.state == 'ran' else row.state for row in report.rows]
    return [_row(row.effect, value) for row, value in zip(report.rows, time_texts, strict=True)]


def _until(span) -> str:
    """Return the name of a level and the size at which it ends or begins."""
    ends = f'to {span.high:.0f}' if np.isfinite(span.high) else f'from {span.low:.0f}'
    return f'{span.name} {ends} px'


def _row(name, value) -> str:
    name = name[:_NAME]
    return name + f' {value}'.rjust(_LINE - len(name))


def toggle(pipeline, on, atlas, *, levels, cells, table) -> Inspection | None:
    """Enable or disable the inspection of a subplot; by default toggle it."""
    if on is not None and not isinstance(on, bool):
        raise TypeError(
            f'on must be True, False or None, got {on!r}: use atlas to choose whose images to show'
        )
    source = None if isinstance(atlas, bool) else atlas
    overlay = Inspection(source, levels=levels, cells=cells, atlas=atlas is not False, table=table)
    old_overlays = [e for e in pipeline.effects if isinstance(e, Inspection)]
    for old in old_overlays:
        pipeline.remove(old)
    return pipeline.add(overlay) if (not old_overlays if on is None else on) else None
