"""The sizes at which levels of detail change, from their measured errors."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from pvibr.instances.cards import ALL_CARD_SHADERS, CARD_SHADERS, SPLAT
from pvibr.instances.measure import allowed

SIDES = {p.name for p in ALL_CARD_SHADERS if p.sides}
_LARGEST = 1e9  # px: no instance is larger
_OCTAVES = 2  # beyond the largest size measured, to which errors of meshes are extrapolated


@dataclass(frozen=True)
class Limits:
    """On-screen diameters, in pixels, at which levels change."""

    cards: tuple
    mesh: float
    meshes: tuple
    level: tuple = ()

    def coarser(self, quality) -> Limits:
        """Return limits for an image drawn at a quality, 0 to 1, of its size."""
        cards, level = _grown(self.cards, quality), _grown(self.level, quality)
        meshes = tuple(limit / quality for limit in self.meshes)
        return Limits(cards, self.mesh / quality, meshes, level)


def _grown(spans, quality) -> tuple:
    """Return contiguous spans of sizes that end at larger ones."""
    grown, reached = [], 0.0
    for name, _, high in spans:
        # A splat replaces what is a few pixels large, and nothing else.
        high = high if name == SPLAT.name else high / quality
        grown.append((name, reached, high))
        reached = high
    return tuple(grown)


def limits_of(errors, mesh_levels, max_error) -> Limits:
    """Return the sizes up to which each level keeps an error in the worst patch of directions."""
    if not errors:
        never = tuple((p.name, 0.0, 0.0) for p in CARD_SHADERS)
        return Limits(never, 0.0, (float('inf'), *[0.0] * (mesh_levels - 1)))
    cards = _spans(errors, CARD_SHADERS, max_error)
    reached = cards[-1][2]
    level: tuple = ()
    if set(errors) >= SIDES:
        level = tuple(
            (name, *np.minimum(span, reached).tolist())
            for name, *span in _spans(errors, ALL_CARD_SHADERS, max_error)
        )
    meshes = [float('inf')]
    for i in range(1, mesh_levels):
        meshes.append(min(_mesh_good_up_to(errors, f'mesh{i}', max_error), meshes[-1]))
    return Limits(cards, reached, tuple(meshes), level)


def checked_force(level) -> dict[str, tuple]:
    """Return the on-screen sizes, in pixels, of each forced level."""
    if level is None:
        return {}
    ranges = level if isinstance(level, dict) else {level: (0.0, _LARGEST)}
    known = [*(p.name for p in ALL_CARD_SHADERS), 'mesh']
    for name, sizes in ranges.items():
        if name not in known and not re.fullmatch('mesh[1-9]', name):
            names = ', '.join([*known, 'mesh1 to mesh9'])
            msg = f'force_level has {name!r}; it must be None, or levels of {names}'
            raise ValueError(msg)
        if np.shape(sizes) != (2,) or not 0 <= sizes[0] <= sizes[1]:
            msg = f'force_level[{name!r}] is {sizes!r}; it must be two rising sizes in pixels'
            raise ValueError(msg)
    return {name: tuple(map(float, sizes)) for name, sizes in ranges.items()}


def needs_images(ranges) -> bool:
    """Return True if forced levels are other than the mesh itself."""
    return bool(set(ranges) - {'mesh'})


def forced_limits(ranges, mesh_levels) -> Limits:
    """Return limits by which each level is drawn between its own sizes."""
    cards = tuple((p.name, *ranges.get(p.name, (0.0, 0.0))) for p in CARD_SHADERS)
    level = tuple((name, *span) for name, span in ranges.items() if name in SIDES)
    lighter = [ranges.get(f'mesh{k}', (0.0, 0.0))[1] for k in range(1, mesh_levels)]
    least = min((low for n, (low, _) in ranges.items() if n.startswith('mesh')), default=_LARGEST)
    return Limits(cards, least, (float('inf'), *lighter), level)


def _spans(errors, shaders, max_error):
    """Return the sizes at which each shader is used, in the order of cost."""
    reached, spans = 0.0, []
    for shader in shaders:
        good = float(good_up_to(errors['sizes'], errors[shader.name], max_error).min())
        good = max(min(good, shader.largest), shader.least, reached)
        spans.append((shader.name, reached, good))
        reached = good
    return tuple(spans)


def good_up_to(sizes, rows, max_error):
    """Return the largest size at which outline and colour are within bounds, in each patch."""
    need = allowed(rows).reshape(len(sizes), -1)
    over = need > max_error
    k = over.argmax(0)
    patch = np.arange(len(k))
    # Below the smallest size that was measured, errors shrink with the size.
    low, before = np.where(k > 0, (sizes[k - 1], need[k - 1, patch]), 0.0)
    part = (max_error - before) / np.maximum(need[k, patch] - before, 1e-9)
    return np.where(over.any(0), low + part * (sizes[k] - low), sizes[-1])


def _mesh_good_up_to(errors, name, max_error):
    """Return the same for a lighter mesh in the worst patch; beyond what was measured as well."""
    sizes, rows = errors['sizes'], errors[name]
    good = float(good_up_to(sizes, rows, max_error).min())
    if good < sizes[-1]:
        return good
    need = allowed(rows).reshape(len(sizes), -1).max(1)
    octaves = (max_error - need[-1]) / max(need[-1] - need[-2], 0.1 * max_error)
    far = sizes[-1] * 2 ** min(octaves, _OCTAVES)
    return min(far, max(2 * max_error / max(float(errors[f'{name}.radii']), 1e-9), good))
