"""On-screen sizes at which levels of detail change, from their measured errors."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, reduce
from typing import NamedTuple

import numpy as np

from pvibr.gl.driver import driver_of
from pvibr.instances.card_layers import PATCHES
from pvibr.instances.card_spans import NOWHERE, CardSpan
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS, FADE, SPLAT
from pvibr.instances.cost_model import negligible_from, saved_by_meshes
from pvibr.instances.measure import card_needs, mesh_needs, worst

#: Names of the shaders that show a turntable's side views.
SIDE_SHADERS = {shader.name for shader in ALL_CARD_SHADERS if shader.sides}
_LARGEST = 1e9  # px: no instance is larger
_COST_STEPS = 100  # sizes at which costs are compared
_OCTAVES = 2  # beyond the largest measured size, to which mesh errors are extrapolated


@dataclass(frozen=True, eq=False)
class Limits:
    """On-screen diameters, in pixels, at which levels change, per patch of view directions."""

    #: From and to by shader, cheapest first, shape (2, PATCHES).
    cards: dict[str, np.ndarray]
    #: Size from which the mesh is drawn, shape (PATCHES,).
    mesh_from: np.ndarray
    #: Largest size of each mesh level, shape (levels, PATCHES).
    mesh_to: np.ndarray
    #: As `cards`, where the eye is near the horizon of a turntable; empty without one.
    side_cards: dict[str, np.ndarray] = field(default_factory=dict)

    def coarser(self, quality) -> Limits:
        """Return limits for an image drawn at a fraction `quality`, 0 to 1, of its size."""
        if quality == 1:
            return self
        cards, side_cards = (_scaled(c, quality) for c in (self.cards, self.side_cards))
        return Limits(cards, self.mesh_from / quality, self.mesh_to / quality, side_cards)

    @cached_property
    def spans(self) -> dict[str, tuple[CardSpan, CardSpan]]:
        """Each shader's spans of sizes, from above or below and from the side."""
        above, side = (
            {name: CardSpan.of(span, self.mesh_from) for name, span in cards.items()}
            for cards in (self.cards, self.side_cards)
        )
        side = side or above
        return {n: (above.get(n, NOWHERE), side.get(n, NOWHERE)) for n in {**above, **side}}

    @cached_property
    def drawn_cards(self) -> list[tuple]:
        """Name, spans, and least and largest size of each shader that draws at some size."""
        return [
            (name, spans, min(s.low[-1] for s in spans), FADE * max(s.high[-1] for s in spans))
            for name, spans in self.spans.items()
            if not all(s.is_empty for s in spans)
        ]

    def drawn_between(self, smallest, largest) -> list[tuple]:
        """Return name and spans of each shader that draws at some size of a range."""
        cards = self.drawn_cards
        return [(n, s) for n, s, low, high in cards if largest >= low and smallest < high]

    @cached_property
    def mesh_from_at(self) -> np.ndarray:
        """`mesh_from`, with the least of all last, for an unknown patch; shape (PATCHES + 1,)."""
        return _with_least(self.mesh_from)

    @cached_property
    def lighter_to_at(self) -> np.ndarray:
        """`mesh_to` of the lighter levels, with the least of all last."""
        return _with_least(self.mesh_to[1:])

    @cached_property
    def varying(self) -> tuple[float, float]:
        """The sizes between which the level depends on the view direction."""
        spans = [*self.cards.values(), *self.side_cards.values()]
        ends = np.stack([self.mesh_from, *self.mesh_to, *(high for _, high in spans)])
        ends = ends[ends.min(1) < ends.max(1)]
        return (float(ends.min()), float(ends.max())) if ends.size else (np.inf, 0.0)


def _with_least(values) -> np.ndarray:
    """Return values of patches with the least of all appended."""
    return np.append(values, values.min(-1, keepdims=True), -1)


def _contiguous(highs) -> dict[str, np.ndarray]:
    """Return the span of each shader, (2, PATCHES), from where the cheaper one ends."""
    low, spans = np.zeros(PATCHES), {}
    for name, high in highs.items():
        spans[name] = np.stack([low, high])
        low = high
    return spans


def _scaled(spans, quality) -> dict:
    # A splat replaces what covers a few pixels, at any quality.
    splat_end = spans[SPLAT.name][1] if SPLAT.name in spans else 0.0
    return {
        name: np.where(sizes <= splat_end, sizes, sizes / quality) for name, sizes in spans.items()
    }


def _cut_off(spans, ends, without='') -> dict:
    """Return spans that end at some sizes at the latest, one shader left out."""
    highs = {name: np.minimum(high, ends) for name, (_, high) in spans.items()}
    return _contiguous(highs | ({without: np.zeros(PATCHES)} if without in highs else {}))


def _everywhere(sizes) -> np.ndarray:
    """Return sizes of levels that are the same in each patch."""
    return np.tile(np.reshape(sizes, (-1, 1)), PATCHES)


def _spans(ends) -> dict:
    """Return the sizes at which each shader is the cheapest of those that are accurate."""
    highs = np.maximum.accumulate([sizes for sizes, _ in ends.values()])
    return _contiguous(dict(zip(ends, highs, strict=True)))


def limits_of(errors, mesh_levels, max_error) -> Limits:
    """Return the largest sizes at which each level meets `max_error`."""
    if not errors:
        return _only_meshes(mesh_levels)
    cards, side_cards = (_spans(ends(errors, max_error)) for ends in (card_ends, side_ends))
    mesh_to = np.array([sizes for sizes, _ in mesh_ends(errors, mesh_levels, max_error)])
    return Limits(cards, list(cards.values())[-1][1], mesh_to, side_cards)


@lru_cache
def _only_meshes(mesh_levels) -> Limits:
    """Return limits at which all is the mesh itself."""
    unused = {shader.name: np.zeros((2, PATCHES)) for shader in CARD_SHADERS}
    mesh_to = _everywhere([np.inf, *[0.0] * (mesh_levels - 1)])
    return Limits(unused, np.zeros(PATCHES), mesh_to)


def by_cost(limits, triangles, driver) -> Limits:
    """Return limits at which meshes take over from cards where that saves most."""
    if limits.side_cards or not limits.mesh_from.any():
        return limits
    # A lighter mesh that would save little is not worth its error.
    lighter_to = negligible_from(driver, triangles[:-1])
    mesh_to = np.minimum(limits.mesh_to, _everywhere([np.inf, *lighter_to]))
    sizes = np.geomspace(limits.mesh_from.max(), 1.0, _COST_STEPS)
    lightest = (mesh_to >= sizes[:, None, None]).cumsum(1).argmax(1)
    savings = np.zeros((_COST_STEPS, PATCHES))
    for name, (low, high) in limits.cards.items():
        in_span = (sizes[:, None] >= low) & (sizes[:, None] < high)
        saved_ns = saved_by_meshes(driver, np.array(triangles)[lightest], name, sizes[:, None])
        savings += in_span * saved_ns
    # From the largest size down, weighted by how many instances a view has at each.
    total = (savings / sizes[:, None] ** 2).cumsum(0)
    ends = np.where(total.max(0) > 0, sizes[total.argmax(0)], limits.mesh_from)
    return replace(limits, cards=_cut_off(limits.cards, ends), mesh_from=ends, mesh_to=mesh_to)


def depth_limits(limits, errors, triangles, max_error, aspect) -> Limits:
    """Return limits in depth maps, for sizes in the short side of their texels."""
    # A depth map shows only the surface, no better than the long side of a texel.
    radii = [float(errors[f'mesh{k}.radii']) for k in range(1, len(triangles))]
    accurate_to = [2 * max_error * aspect / max(r, 1e-9) for r in radii]
    mesh_to = np.minimum.accumulate([np.inf, *accurate_to])
    # A mesh with fewer triangles than pixels costs less than a card.
    card_end = 0.0
    for count, low, high in zip(triangles, (*mesh_to[1:], 0.0), mesh_to, strict=True):
        pays_from = (count * aspect) ** 0.5
        card_end = max(card_end, min(pays_from, high)) if pays_from > low else card_end
    mesh_from = np.minimum(limits.mesh_from, card_end)
    # Splats would be square in oblong texels.
    cards, side_cards = (
        _cut_off(spans, mesh_from, without=SPLAT.name)
        for spans in (limits.cards, limits.side_cards)
    )
    return Limits(cards, mesh_from, _everywhere(mesh_to), side_cards)


def checked_force(level) -> dict[str, tuple]:
    """Return the on-screen sizes, in pixels, of each forced level."""
    if level is None:
        return {}
    if not isinstance(level, (str, dict)) or not level:
        raise TypeError(
            f'force_level must be None, the name of a level, or sizes by name, got {level!r:.80}'
        )
    ranges = level if isinstance(level, dict) else {level: (0.0, _LARGEST)}
    level_names = [*(shader.name for shader in ALL_CARD_SHADERS), 'mesh']
    for name, sizes in ranges.items():
        if name not in level_names and not re.fullmatch('mesh[1-9]', name):
            choices = ', '.join([*level_names, 'mesh1 to mesh9'])
            raise ValueError(f'force_level must be None or one of {choices}, got {name!r}')
        if np.shape(sizes) != (2,) or not 0 <= sizes[0] <= sizes[1]:
            raise ValueError(
                f'force_level[{name!r}] must be two rising sizes in pixels, got {sizes!r}'
            )
    return {name: tuple(map(float, sizes)) for name, sizes in ranges.items()}


def needs_images(ranges) -> bool:
    """Return True if levels other than the mesh itself are forced."""
    return bool(set(ranges) - {'mesh'})


def forced_limits(ranges, mesh_levels) -> Limits:
    """Return limits at which each level is drawn between its forced sizes."""
    spans = {name: _everywhere(sizes) for name, sizes in ranges.items()}
    cards = {s.name: spans.get(s.name, np.zeros((2, PATCHES))) for s in CARD_SHADERS}
    side_cards = {name: span for name, span in spans.items() if name in SIDE_SHADERS}
    lighter = [ranges.get(f'mesh{k}', (0.0, 0.0))[1] for k in range(1, mesh_levels)]
    # The lightest that serves is drawn: heavier ones must serve at least as far.
    mesh_to = np.maximum.accumulate([0.0, *lighter[::-1], np.inf])[:0:-1]
    mesh_from = min(
        (low for name, (low, _) in ranges.items() if name.startswith('mesh')), default=_LARGEST
    )
    return Limits(cards, np.full(PATCHES, mesh_from), _everywhere(mesh_to), side_cards)


class Ends(NamedTuple):
    """Largest size at which a level is accurate, and the rule that ends it, in each patch."""

    sizes: np.ndarray  # px, shape (PATCHES,)
    rules: np.ndarray  # 'outline', 'colour', 'blur' or 'size', shape (PATCHES,)


def card_ends(errors, max_error) -> dict[str, Ends]:
    """Return the largest sizes at which cards meet `max_error` by shader, cheapest first."""
    return {shader.name: _card_ends(errors, shader, max_error) for shader in CARD_SHADERS}


def side_ends(errors, max_error) -> dict[str, Ends]:
    """Return the same near the horizon of a turntable; empty without one."""
    if not set(errors) >= SIDE_SHADERS:
        return {}
    # Side views were measured in patches of their own.
    last = reduce(_wider, card_ends(errors, max_error).values())
    return {
        shader.name: _narrower(_card_ends(errors, shader, max_error), last)
        for shader in ALL_CARD_SHADERS
    }


def mesh_ends(errors, mesh_levels, max_error) -> list[Ends]:
    """Return the same for each mesh level, heaviest first."""
    ends = [Ends(np.full(PATCHES, np.inf), np.full(PATCHES, ''))]
    for i in range(1, mesh_levels):
        ends.append(_narrower(_mesh_ends(errors, f'mesh{i}', max_error), ends[-1]))
    return ends


def _narrower(first, second) -> Ends:
    """Return the end at the smaller size in each patch."""
    return _chosen(first.sizes <= second.sizes, first, second)


def _wider(first, second) -> Ends:
    """Return the end at the larger size in each patch."""
    return _chosen(first.sizes >= second.sizes, first, second)


def _chosen(is_first, first, second) -> Ends:
    return Ends(*(np.where(is_first, *pair) for pair in zip(first, second, strict=True)))


def _card_ends(errors, shader, max_error) -> Ends:
    sizes, rules = _accurate_to(errors['sizes'], card_needs(errors[shader.name]), max_error)
    if shader.sides:  # it serves all sides or none
        narrowest = np.full(PATCHES, sizes.argmin())
        sizes, rules = sizes[narrowest], rules[narrowest]
    clamped = np.clip(sizes, shader.least, shader.largest)
    return Ends(clamped, np.where(clamped == sizes, rules, 'size'))


def _mesh_ends(errors, name, max_error) -> Ends:
    """Return the ends of a lighter mesh, extrapolated beyond the measured sizes."""
    largest, needs = errors['sizes'][-1], mesh_needs(errors[name])
    measured = _accurate_to(errors['sizes'], needs, max_error)
    last = {cause: need[-1] for cause, need in needs.items()}
    # As facets become visible, the colour error about doubles with the size.
    octaves = np.log2(max_error / np.maximum(worst(last), 1e-9))
    cause = np.array([*last])[np.argmax([*last.values()], axis=0)]
    beyond = Ends(
        largest * 2 ** np.clip(octaves, 0, _OCTAVES), np.where(octaves < _OCTAVES, cause, 'size')
    )
    outline_end = max(2 * max_error / max(float(errors[f'{name}.radii']), 1e-9), largest)
    outline = Ends(np.full(PATCHES, outline_end), np.full(PATCHES, 'outline'))
    return _chosen(measured.sizes < largest, measured, _narrower(beyond, outline))


def _accurate_to(sizes, needs, max_error) -> Ends:
    """Return the largest measured sizes that meet every need, and the first cause to fail."""
    by_cause = np.array([_met_up_to(sizes, need, max_error) for need in needs.values()])
    ends = by_cause.min(0)
    rules = np.array([*needs])[by_cause.argmin(0)]
    return Ends(ends, np.where(ends < sizes[-1], rules, 'size'))


def _met_up_to(sizes, need, max_error):
    """Return the largest size at which a need, (sizes, patches), is met in each patch."""
    exceeds = need > max_error
    k = exceeds.argmax(0)
    patch = np.arange(len(k))
    # Below the smallest measured size, errors shrink with the size.
    low, need_below = np.where(k > 0, (sizes[k - 1], need[k - 1, patch]), 0.0)
    fraction = (max_error - need_below) / np.maximum(need[k, patch] - need_below, 1e-9)
    return np.where(exceeds.any(0), low + fraction * (sizes[k] - low), sizes[-1])


@dataclass(frozen=True)
class LevelChoice:
    """What decides between the levels of a set: errors and costs, unless a rule overrides them."""

    max_error: float
    #: Sizes of forced levels, empty if none is forced.
    forced: dict
    #: ``forced``, or why all are meshes at every size; empty if errors and costs decide.
    rule: str

    def limits(self, model, driver=None) -> Limits:
        """Return the limits of a mesh's model."""
        if not self.rule and model.atlas.errors:
            return model.limits(self.max_error, driver)
        level_count = len(model.levels)
        has_levels = model.is_draft or model.atlas.errors
        if self.rule not in ('', 'forced') or not has_levels:
            return limits_of({}, level_count, 1)
        if self.rule and not (model.is_draft and needs_images(self.forced)):
            return forced_limits(self.forced, level_count)
        return model.limits(self.max_error, driver)

    def limits_in(self, frame, models) -> list[Limits]:
        """Return the limits of models in a frame, which may be a depth map or of low quality."""
        if frame.depth_map and not self.rule:
            low, high = sorted(frame.pixel_scales)
            return [model.depth_limits(self.max_error, high / low) for model in models]
        driver = frame.once(driver_in)
        found = [self.limits(model, driver) for model in models]
        return found if frame.quality == 1 else [x.coarser(frame.quality) for x in found]


def driver_in(frame):
    """Return the kind of driver that draws a frame."""
    return driver_of(frame.window)
