"""An overlay of levels of detail, impostor images and timings of a frame."""

from __future__ import annotations

from collections import Counter
from weakref import WeakKeyDictionary

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.observers import weakly
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.impostors.impostor import Impostor
from pvibr.inspection.marks import Marks, edges, outlines, projected
from pvibr.inspection.tiles import FLASH, Sheet, as_bytes, has_images
from pvibr.instances.instances import Instances
from pvibr.maths.blocks import BLOCK

#: What draws, from hot to cold. Okabe and Ito, "Color Universal Design", 2008: told apart also by
#: those who do not see some colours.
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
_SMALLEST = 40.0  # pixels: smaller boxes are omitted
_TAKEN = ('rendered', 'taken')  # keys of the number of rendered images in reports
_NAME, _LINE = 19, 29  # maximum lengths of names and lines, characters


class Inspection(Effect):
    """Shows how a subplot is drawn; :meth:`pl.ibr.inspect <IBRComponent.inspect>` makes it."""

    web = 'lost', 'tells how frames are drawn here, and a browser draws its own'
    before = 'Tap'  # all inspected things have chosen their levels by then

    levels = Param(True, 'Whether instances have the colour of the level that draws them.')
    cells = Param(True, 'Whether boxes show what is drawn or left out together.')
    atlas = Param(True, 'Whether the images of one thing are shown, those in use outlined.')
    table = Param(True, 'Whether a table lists images taken now, and milliseconds.')

    def __init__(self, thing=None, **settings):
        super().__init__(**settings)
        if not isinstance(thing, Instances | Impostor | None):
            raise TypeError(f'atlas = {thing!r}: must be True, False, instances or an impostor')
        self.thing = thing
        self._marks = Marks()
        self._tinted: list = []
        self._boxes: WeakKeyDictionary = WeakKeyDictionary()
        self._last: list = []
        self._rows: list = []
        self._taken: dict[str, int] = {}
        self._told: dict = {}
        self._observer: int | None = None
        self._moves: tuple = ()
        self._pointed: tuple | None = None  # the set and the instance under the pointer

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
        """Release GPU resources; the OpenGL context is current."""
        self.deactivate()
        window = self.pipeline.window
        if window is not None:
            self._marks.release(window)

    def report(self) -> dict:
        """Return the statistics of the last frame."""
        return {'bytes': 0, **self._told}

    def _on_end(self, renderer, _event):
        if renderer.GetSelector() is None and self.pipeline is not None:
            self._last = _milliseconds(self.pipeline.report())

    def _on_move(self):
        interactor, _ = self._moves
        if self.point_at(*interactor.GetEventPosition()):
            interactor.Render()

    def point_at(self, x, y) -> bool:
        """Explain the instance under a pixel in the next frames; return whether it is another."""
        sets = [e for e in self.pipeline.effects if isinstance(e, Instances) and e.enabled]
        hits = [(hit.distance, k, hit.index) for k, e in enumerate(sets) if (hit := e.pick(x, y))]
        before, self._pointed = self._pointed, None
        if hits:
            _, k, index = min(hits)
            self._pointed = sets[k], index
        return self._pointed != before

    def _explained(self) -> list:
        """Return rows that say why the instance under the pointer is drawn as it is."""
        if self._pointed is None:
            return []
        thing, index = self._pointed
        if thing.pipeline is not self.pipeline or index >= len(thing):
            return []
        told = thing.explain(index)
        rows = [_row(f'instance {index}', f'{told.size:.0f} px'), _row('patch', told.patch)]
        rows += [_row(told.note[:_NAME], '')] if told.note else []
        used = [span for span in told.levels if span.high > span.low]
        rows += [_row(_until(span), span.rule) for span in used]
        colors = [None] * (len(rows) - len(used)) + [LEVELS.get(s.name, _LIGHTER) for s in used]
        return list(zip(rows, colors, strict=True))

    # -- a frame -----------------------------------------------------------------------------

    def prepare(self, frame):
        """Update the overlay with the levels and images chosen for a frame."""
        report = self.pipeline.report()
        pairs = list(zip(self.pipeline.effects, report.rows, strict=True))
        drawn = [effect for effect, row in pairs if row.state == 'ran']
        groups = [k for e in drawn if isinstance(e, Instances) for k in e.groups]
        impostors = [e for e in drawn if isinstance(e, Impostor)]
        self._tint(groups)
        self._show_cells(frame, groups, impostors)
        if not self._rows or frame.tile == (0.0, 0.0, 1.0, 1.0):
            # The tiles of a screenshot share the text of one frame.
            self._told = {
                'levels': level_counts(groups),
                'cells': self._cell_counts(groups),
                'images': sum(int(_shown(e, frame).sum()) for e in impostors),
                'new_images': self._newly_taken(frame, pairs),
            }
            self._rows = self._explained() + self._legend() + self._table(report)
        self._show_atlas(frame, self._chosen(drawn))

    def finish(self, frame):
        """Restore the colours of all things."""
        self._untint()

    def _tint(self, groups):
        # Only while the frame is drawn: what others draw before or after it, to be kept, and
        # what is drawn once this is gone, has never heard of it.
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
        rows = [(_row(n, f'{c:,}'), LEVELS[n]) for n, c in self._told['levels'].items() if c]
        if self._told['images']:
            rows.append((_row('image', f'{self._told["images"]:,}'), IMAGE))
        return rows

    def _table(self, report) -> list:
        if not self.table:
            return []
        rows: list = []
        shown, total = self._told['cells']
        if self.cells and total:
            rows.append((_row('cells', f'{shown:,} of {total:,}'), None))
        if self._taken:
            now, total = self._told['new_images'], sum(self._taken.values())
            rows.append((_row('images taken', f'{now:,} of {total:,}'), FLASH if now else None))
        rows.append((_row('effect', 'ms'), None))
        return rows + [(text, None) for text in self._last or _milliseconds(report)]

    def _cell_counts(self, groups) -> tuple[int, int]:
        shown = sum(len(_cells_seen(group)) for group in groups)
        return shown, sum(-(-len(group) // BLOCK) for group in groups)

    def _newly_taken(self, frame, pairs) -> int:
        """Return the number of images rendered since the last frame."""
        before, self._taken, new = self._taken, {}, 0
        for number, (effect, row) in enumerate(pairs):
            total = next((int(row.details[n]) for n in _TAKEN if n in row.details), None)
            if total is None:
                continue
            key = f'{number} {row.effect}'
            self._taken[key] = total
            if isinstance(effect, Impostor):
                new += _count_taken(effect, frame)
            else:
                new += max(total - before.get(key, total), 0)
        return new

    # -- boxes -------------------------------------------------------------------------------

    def _show_cells(self, frame, groups, impostors):
        low, high, colors = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 4))
        if self.cells:
            found = [self._cells(group, _ink(frame.renderer)) for group in groups]
            found += [_image_boxes(e, frame) for e in impostors]
            if found:
                low, high, colors = (np.concatenate(a) for a in zip(*found, strict=True))
        large = _diameters(frame, low, high) >= _SMALLEST
        lines = edges(low[large], high[large])
        places, kept = projected(frame, lines.reshape(-1, 2, 3))
        self._marks.boxes.show(places, colors[large][kept // 12])

    def _cells(self, group, ink):
        """Return corners and colours of a group's cells, stronger where instances are visible."""
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

    def _chosen(self, drawn):
        """Return the thing whose images are shown."""
        if not self.atlas:
            return None
        able = [e for e in drawn if isinstance(e, Instances | Impostor)]
        if self.thing is not None:
            return self.thing if self.thing in able else None
        return next((e for e in able if has_images(e)), None)

    def _show_atlas(self, frame, thing):
        size = np.divide(frame.whole, frame.scale)
        sheet = None if thing is None or not has_images(thing) else Sheet(thing, frame)
        title = None if sheet is None else (thing.name, sheet.ratio)
        box = self._marks.write(size, self._rows, title, frame.scale)
        if sheet is None:
            self._marks.picture.hide()
            self._marks.tiles.show(np.zeros((0, 2, 2)), np.zeros((0, 4)))
            return
        self._marks.picture.show(sheet.texture, sheet.part, box)
        lines = box[0] + outlines(sheet.low, sheet.high) * (box[1] - box[0])
        self._marks.tiles.show(lines, sheet.colors.repeat(4, 0))


def level_counts(groups) -> dict[str, int]:
    """Return how many instances each level draws in the last frame."""
    counts: Counter = Counter()
    for group in groups:
        levels = group.near.level_of
        counts.update({'mesh': int((levels == 0).sum()), 'lighter mesh': int((levels > 0).sum())})
        counts.update({name: group.counts.get(name, 0) for name in group.cards.layers})
    return {name: counts[name] for name in LEVELS}


def _shown(impostor, frame):
    """Return the images of an impostor that a frame shows."""
    images = impostor.images
    if images is None:
        return np.zeros(0, bool)
    return images.alive & (images.shown_frame == frame.index)


def _cells_seen(group):
    """Return the cells of a group with visible instances."""
    return np.unique(group.seen * group.unit // BLOCK)


def _count_taken(impostor, frame) -> int:
    """Return the number of impostor images rendered for a frame."""
    images = impostor.images
    return 0 if images is None else int((images.rendered_frame[images.alive] == frame.index).sum())


def _image_boxes(impostor, frame):
    """Return the corners and colours of the boxes that an impostor draws as images."""
    images, shown = impostor.images, np.flatnonzero(_shown(impostor, frame))
    if not len(shown):
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 4))
    nodes = shown // images.views
    colors = np.tile((*as_bytes(IMAGE), 255), (len(shown), 1))
    colors[images.rendered_frame[shown] == frame.index, :3] = as_bytes(FLASH)
    return impostor.nodes.low[nodes], impostor.nodes.high[nodes], colors


def _diameters(frame, low, high):
    """Return the approximate on-screen diameters of boxes, in pixels."""
    away = np.linalg.norm((low + high) / 2 - frame.eye, axis=1)
    away = 1.0 if frame.parallel else np.maximum(away, frame.near)
    return np.linalg.norm(high - low, axis=1) * frame.pixel_scale / away


def _ink(renderer):
    """Return a colour that contrasts with a renderer's background."""
    light = np.dot(renderer.GetBackground(), (0.3, 0.6, 0.1)) > 0.5
    return (0, 0, 0) if light else (255, 255, 255)


def _milliseconds(report) -> list[str]:
    """Return a line per effect: its time, or its status."""
    told = [f'{row.ms:.1f}' if row.state == 'ran' else row.state for row in report.rows]
    return [_row(row.effect, value) for row, value in zip(report.rows, told, strict=True)]


def _until(span) -> str:
    """Return the name of a level, and up to or from which size it is used."""
    ends = f'to {span.high:.0f}' if np.isfinite(span.high) else f'from {span.low:.0f}'
    return f'{span.name} {ends} px'


def _row(name, value) -> str:
    name = name[:_NAME]
    return name + f' {value}'.rjust(_LINE - len(name))


def toggle(pipeline, on, atlas, *, levels, cells, table) -> Inspection | None:
    """Enable or disable the inspection of a subplot; by default toggle it."""
    if on is not None and not isinstance(on, bool):
        raise TypeError(
            f'on = {on!r}: must be True, False or None; atlas says whose images are shown'
        )
    thing = None if isinstance(atlas, bool) else atlas
    made = Inspection(thing, levels=levels, cells=cells, atlas=atlas is not False, table=table)
    found = [e for e in pipeline.effects if isinstance(e, Inspection)]
    for old in found:
        pipeline.remove(old)
    return pipeline.add(made) if (not found if on is None else on) else None
