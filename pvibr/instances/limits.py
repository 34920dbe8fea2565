"""The sizes at which levels of detail change, from their measured errors."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from pvibr.instances.card_layers import PATCHES
from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS, SPLAT
from pvibr.instances.measure import card_needs, mesh_needs, worst
from pvibr.instances.worth import hardly_costs_from, saved_by_meshes

SIDES = {p.name for p in ALL_CARD_SHADERS if p.sides}
_LARGEST = 1e9  # px: no instance is larger
_STEPS = 100  # of sizes at which costs are compared
_OCTAVES = 2  # beyond the largest size measured, to which errors of meshes are extrapolated


@dataclass(frozen=True, eq=False)
class Limits:
    """On-screen diameters, in pixels, at which levels change, for each patch of directions."""

    #: By shader, from the cheapest: from and to, shape (2, PATCHES).
    cards: dict[str, np.ndarray]
    #: From where on it is drawn as a mesh, shape (PATCHES,).
    mesh: np.ndarray
    #: Largest of each mesh level, shape (levels, PATCHES).
    meshes: np.ndarray
    #: As `cards`, where the eye is level with a turntable.
    level: dict[str, np.ndarray] = field(default_factory=dict)

    def coarser(self, quality) -> Limits:
        """Return limits for an image drawn at a quality, 0 to 1, of its size."""
        cards, level = _grown(self.cards, quality), _grown(self.level, quality)
        return Limits(cards, self.mesh / quality, self.meshes / quality, level)

    def spans(self, name) -> list[np.ndarray]:
        """Return the spans of a shader from elsewhere, and from level with a turntable."""
        none = np.zeros((2, PATCHES))
        return [spans.get(name, none) for spans in (self.cards, self.level or self.cards)]

    def varying(self) -> tuple[float, float]:
        """Return between which sizes the level depends on the direction."""
        spans = [*self.cards.values(), *self.level.values()]
        ends = np.stack([self.mesh, *self.meshes, *(high for _, high in spans)])
        ends = ends[ends.min(1) < ends.max(1)]
        return (float(ends.min()), float(ends.max())) if ends.size else (np.inf, 0.0)


def _grown(spans, quality) -> dict:
    """Return contiguous spans of sizes that end at larger ones."""
    grown, reached = {}, np.zeros(PATCHES)
    for name, (_, high) in spans.items():
        # A splat replaces what is a few pixels large, and nothing else.
        high = high if name == SPLAT.name else high / quality
        grown[name] = np.stack([reached, high])
        reached = high
    return grown


def limits_of(errors, mesh_levels, max_error) -> Limits:
    """Return the sizes up to which each level keeps an error."""
    if not errors:
        never = {p.name: np.zeros((2, PATCHES)) for p in CARD_SHADERS}
        return Limits(never, np.zeros(PATCHES), _everywhere([np.inf, *[0.0] * (mesh_levels - 1)]))
    cards = _spans(card_ends(errors, max_error))
    reached = list(cards.values())[-1][1]
    meshes = np.array([sizes for sizes, _ in mesh_ends(errors, mesh_levels, max_error)])
    return Limits(cards, reached, meshes, _spans(level_ends(errors, max_error)))


def _everywhere(sizes) -> np.ndarray:
    """Return sizes of levels that are the same in each patch."""
    return np.tile(np.reshape(sizes, (-1, 1)), PATCHES)


def by_cost(limits, triangles) -> Limits:
    """Return limits by which meshes take over from cards where that saves most."""
    if limits.level or not limits.mesh.any():
        return limits
    # A lighter one that would save little is not worth its error.
    heavier = _everywhere([np.inf, *hardly_costs_from(triangles[:-1])])
    limits = replace(limits, meshes=np.minimum(limits.meshes, heavier))
    sizes = np.geomspace(limits.mesh.max(), 1.0, _STEPS)
    lightest = (limits.meshes >= sizes[:, None, None]).cumsum(1).argmax(1)
    saved = np.zeros((_STEPS, PATCHES))
    for name, (low, high) in limits.cards.items():
        shown = (sizes[:, None] >= low) & (sizes[:, None] < high)
        saved += shown * saved_by_meshes(np.array(triangles)[lightest], name, sizes[:, None])
    # From the largest size down; of what is far there is more.
    total = (saved / sizes[:, None] ** 2).cumsum(0)
    ends = np.where(total.max(0) > 0, sizes[total.argmax(0)], limits.mesh)
    return Limits(_ended(limits.cards, ends), ends, limits.meshes, limits.level)


def cast(limits, errors, triangles, max_error, aspect) -> Limits:
    """Return limits in depth maps, sizes by the short side of their texels."""
    # Maps show a mesh's surface alone, no better than the long side of a texel.
    radii = [float(errors[f'mesh{k}.radii']) for k in range(1, len(triangles))]
    good = [2 * max_error * aspect / max(r, 1e-9) for r in radii]
    meshes = np.minimum.accumulate([np.inf, *good])
    # A mesh of fewer triangles than pixels costs less than a card.
    ends = 0.0
    for count, low, high in zip(triangles, (*meshes[1:], 0.0), meshes, strict=True):
        pays = (count * aspect) ** 0.5
        ends = max(ends, min(pays, high)) if pays > low else ends
    mesh = np.minimum(limits.mesh, ends)
    # Splats are square in oblong texels.
    cards, level = (
        _ended(spans, mesh, without=SPLAT.name) for spans in (limits.cards, limits.level)
    )
    return Limits(cards, mesh, _everywhere(meshes), level)


def _ended(spans, ends, without='') -> dict:
    """Return contiguous spans up to a size."""
    kept, reached = {}, np.zeros(PATCHES)
    for name, (_, high) in spans.items():
        high = reached if name == without else np.maximum(np.minimum(high, ends), reached)
        kept[name] = np.stack([reached, high])
        reached = high
    return kept


def checked_force(level) -> dict[str, tuple]:
    """Return the on-screen sizes, in pixels, of each forced level."""
    if level is None:
        return {}
    if not isinstance(level, (str, dict)) or not level:
        raise TypeError(
            f'force_level = {level!r:.80}: must be None, the name of a level, or sizes by name'
        )
    ranges = level if isinstance(level, dict) else {level: (0.0, _LARGEST)}
    known = [*(p.name for p in ALL_CARD_SHADERS), 'mesh']
    for name, sizes in ranges.items():
        if name not in known and not re.fullmatch('mesh[1-9]', name):
            names = ', '.join([*known, 'mesh1 to mesh9'])
            raise ValueError(f'force_level has {name!r}; it must be None, or levels of {names}')
        if np.shape(sizes) != (2,) or not 0 <= sizes[0] <= sizes[1]:
            raise ValueError(
                f'force_level[{name!r}] is {sizes!r}; it must be two rising sizes in pixels'
            )
    return {name: tuple(map(float, sizes)) for name, sizes in ranges.items()}


def needs_images(ranges) -> bool:
    """Return True if forced levels are other than the mesh itself."""
    return bool(set(ranges) - {'mesh'})


def forced_limits(ranges, mesh_levels) -> Limits:
    """Return limits by which each level is drawn between its own sizes."""
    everywhere = {k: np.tile(np.reshape(v, (2, 1)), PATCHES) for k, v in ranges.items()}
    cards = {p.name: everywhere.get(p.name, np.zeros((2, PATCHES))) for p in CARD_SHADERS}
    level = {name: span for name, span in everywhere.items() if name in SIDES}
    lighter = [ranges.get(f'mesh{k}', (0.0, 0.0))[1] for k in range(1, mesh_levels)]
    # The lightest that serves is drawn: those before it must serve as far.
    meshes = np.maximum.accumulate([0.0, *lighter[::-1], np.inf])[:0:-1]
    least = min((low for n, (low, _) in ranges.items() if n.startswith('mesh')), default=_LARGEST)
    return Limits(cards, np.full(PATCHES, least), _everywhere(meshes), level)


class Ends(NamedTuple):
    """Up to which sizes a level is accurate in each patch, and the rules that end it there."""

    sizes: np.ndarray  # px, shape (PATCHES,)
    rules: np.ndarray  # 'outline', 'colour', 'blur' or 'size', shape (PATCHES,)


def card_ends(errors, max_error) -> dict[str, Ends]:
    """Return up to which sizes the cards of each shader keep an error, from the cheapest."""
    return {shader.name: _card_ends(errors, shader, max_error) for shader in CARD_SHADERS}


def level_ends(errors, max_error) -> dict[str, Ends]:
    """Return the same where the eye is level with a turntable, of nothing else."""
    if not set(errors) >= SIDES:
        return {}
    # What is seen from the side was measured in patches of its own.
    last = reduce(_wider, card_ends(errors, max_error).values())
    return {
        shader.name: _narrower(_card_ends(errors, shader, max_error), last)
        for shader in ALL_CARD_SHADERS
    }


def mesh_ends(errors, count, max_error) -> list[Ends]:
    """Return the same of so many meshes, from the heaviest."""
    ends = [Ends(np.full(PATCHES, np.inf), np.full(PATCHES, ''))]
    for i in range(1, count):
        ends.append(_narrower(_mesh_ends(errors, f'mesh{i}', max_error), ends[-1]))
    return ends


def _narrower(one, other) -> Ends:
    """Return of two ends those at smaller sizes."""
    return _chosen(one.sizes <= other.sizes, one, other)


def _wider(one, other) -> Ends:
    """Return of two ends those at larger sizes."""
    return _chosen(one.sizes >= other.sizes, one, other)


def _chosen(first, one, other) -> Ends:
    """Return in each patch the first of two ends or the other."""
    return Ends(*(np.where(first, *pair) for pair in zip(one, other, strict=True)))


def _card_ends(errors, shader, max_error) -> Ends:
    sizes, rules = _within(errors['sizes'], card_needs(errors[shader.name]), max_error)
    if shader.sides:  # it serves all sides or none
        narrowest = np.full(PATCHES, sizes.argmin())
        sizes, rules = sizes[narrowest], rules[narrowest]
    allowed = np.clip(sizes, shader.least, shader.largest)
    return Ends(allowed, np.where(allowed == sizes, rules, 'size'))


def _mesh_ends(errors, name, max_error) -> Ends:
    # Beyond what was measured as well.
    largest, needs = errors['sizes'][-1], mesh_needs(errors[name])
    sizes, rules = _within(errors['sizes'], needs, max_error)
    last = {cause: need[-1] for cause, need in needs.items()}
    # Facets that grow visible: an error of colour doubles with the size, or nearly.
    octaves = np.log2(max_error / np.maximum(worst(last), 1e-9))
    far = largest * 2 ** np.clip(octaves, 0, _OCTAVES)
    cause = np.array([*last])[np.argmax([*last.values()], axis=0)]
    cause = np.where(octaves < _OCTAVES, cause, 'size')
    moved = max(2 * max_error / max(float(errors[f'{name}.radii']), 1e-9), largest)
    outline = Ends(np.full(PATCHES, moved), np.full(PATCHES, 'outline'))
    return _chosen(sizes < largest, Ends(sizes, rules), _narrower(Ends(far, cause), outline))


def _within(sizes, needs, max_error) -> Ends:
    """Return up to which of the measured sizes all causes allow an error, and the first to end."""
    by_cause = np.array([_good_up_to(sizes, need, max_error) for need in needs.values()])
    ends = by_cause.min(0)
    rules = np.array([*needs])[by_cause.argmin(0)]
    return Ends(ends, np.where(ends < sizes[-1], rules, 'size'))


def _good_up_to(sizes, need, max_error):
    """Return the largest size at which a need, (sizes, patches), is met in each patch."""
    over = need > max_error
    k = over.argmax(0)
    patch = np.arange(len(k))
    # Below the smallest size that was measured, errors shrink with the size.
    low, before = np.where(k > 0, (sizes[k - 1], need[k - 1, patch]), 0.0)
    part = (max_error - before) / np.maximum(need[k, patch] - before, 1e-9)
    return np.where(over.any(0), low + part * (sizes[k] - low), sizes[-1])


def _spans(ends) -> dict:
    """Return the contiguous sizes at which each shader is used, in the order of cost."""
    reached, spans = np.zeros(PATCHES), {}
    for name, (good, _) in ends.items():
        good = np.maximum(good, reached)
        spans[name] = np.stack([reached, good])
        reached = good
    return spans
