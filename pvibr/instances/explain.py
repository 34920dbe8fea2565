"""Why an instance is drawn by the level that draws it."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.limits import card_ends, level_ends, mesh_ends
from pvibr.maths import octahedral
from pvibr.maths.blocks import frustum_planes
from pvibr.meshes.turntable import LEVEL

_CLOSE = 1e-6  # of sizes that are compared, px
#: Why nothing draws an instance.
HIDDEN, OUT_OF_VIEW = 'it is hidden', 'it is out of view'
NOT_FORCED = 'no level is forced at its size'


@dataclass(frozen=True)
class LevelSpan:
    """The sizes at which a level is drawn from one side, and the rule that ends them."""

    #: A card shader, ``mesh``, or ``mesh1`` and on for lighter meshes, as in ``force_level``.
    name: str
    #: On-screen diameters of the bounding sphere, px; equal where the level is not used.
    low: float
    high: float
    #: What ends it: ``outline``, ``colour``, ``blur``, ``cost``, ``size`` (larger ones were not
    #: measured, or the shader is for these), ``forced``, ``translucent``, ``clipped``, ``memory``,
    #: ``not baked``, ``shaders failed``; empty for what is drawn at any size.
    rule: str
    #: Of meshes; 0 of cards.
    triangles: int = 0


@dataclass(frozen=True)
class Explanation:
    """Why an instance is drawn as it is; `print` shows it as a table."""

    #: The instance.
    index: int
    #: On-screen diameter of its bounding sphere, px.
    size: float
    #: From which of the 16 patches of directions it is seen.
    patch: int
    #: The level that draws it; empty if it is hidden or out of view.
    level: str
    #: Why no level draws it, or why there are no images; else empty.
    note: str
    #: Every level, from the coarsest.
    levels: tuple[LevelSpan, ...]

    def as_dict(self) -> dict:
        """Return everything as plain data."""
        return asdict(self)

    def __str__(self):
        drawn = f'drawn as {self.level}' if self.level else 'not drawn'
        why = f': {self.note}' if self.note else ''
        lines = [
            f'instance {self.index}, {self.size:.1f} px from patch {self.patch}, {drawn}{why}'
        ]
        for span in self.levels:
            what = f'{span.name}, {span.triangles:,} triangles' if span.triangles else span.name
            if span.high <= span.low:
                sizes = 'not used'
            elif span.high == np.inf:
                sizes = f'from {span.low:.0f} px'
            else:
                sizes = f'{span.low:.0f} to {span.high:.0f} px'
            lines.append(f'  {what:28} {sizes:16} {span.rule}'.rstrip())
        return '\n'.join(lines)


def explanation(index, group, slot, frame, limits, *, max_error, hidden, always) -> Explanation:
    """Return why a slot of a group is drawn as it is in a frame of some limits."""
    # `always` is the rule by which neither errors nor costs decide, empty if they do.
    slots = np.array([slot])
    toward, rise, away = group.toward_eye(slots, frame)
    size = float(2 * group.radii[slot] * frame.pixel_scale / away[0])
    patch = int(octahedral.cells(toward, PATCH_SIDE, group.atlas.half)[0][0])
    upright = group.atlas.turntable is not None and rise[0] < LEVEL
    model = group.model
    if model.unbaked and always in ('', 'forced'):  # there is nothing to be forced
        always = _unbaked_rule(model)
    rules = {} if always else _rules(model, limits, max_error, patch, upright=upright)
    drawn_at = limits.coarser(frame.quality)
    levels = tuple(_spans(model, drawn_at, patch, rules, always, upright=upright))
    note = model.unbaked
    if hidden:
        note = HIDDEN
    elif not _in_view(group, slot, frame):
        note = OUT_OF_VIEW
    elif not (drawn := next((s.name for s in levels if s.low <= size < s.high), '')):
        note = NOT_FORCED
    level = '' if note in (HIDDEN, OUT_OF_VIEW, NOT_FORCED) else drawn
    return Explanation(index, size, patch, level, note, levels)


def measured_error(group, frame, limits) -> tuple[float, float, float]:
    """Return the measured errors of what a group draws in a frame of some limits."""
    # FLIP over that of the mesh at one sample, a mean over pixels; and the greatest displacement
    # of an outline, px, and share of local gradients lost.
    slots = group.visible_slots()
    toward, _, away = group.toward_eye(slots, frame)
    sizes = 2 * group.radii[slots] * frame.pixel_scale / away
    patches = octahedral.cells(toward, PATCH_SIDE, group.atlas.half)[0]
    errors, pixels = group.atlas.errors, sizes**2
    ratios, others = np.ones(len(slots)), np.zeros((2, len(slots)))  # of the mesh itself
    level_of = group.near.level_of[slots]
    drawn = {f'mesh{k}': level_of == k for k in range(1, len(group.levels))}
    for name, spans in limits.cards.items():
        low, high = spans[:, patches]
        drawn[name] = (sizes >= low) & (sizes < high) & (level_of < 0)
    for name, rows in drawn.items():
        moved, flip, own, blur = _interpolated(errors, name, sizes[rows], patches[rows])
        # What a lighter mesh adds is beside what one sample per pixel does.
        ratios[rows] = flip / own + name.startswith('mesh')
        others[:, rows] = moved, blur
    displaced, blurred = others.max(1, initial=0.0).tolist()
    return float((ratios * pixels).sum() / max(pixels.sum(), 1e-30)), displaced, blurred


def _interpolated(errors, name, sizes, patches) -> np.ndarray:
    """Return the errors of a level at sizes and patches, (4, n)."""
    octaves = np.log2(errors['sizes'])
    place = np.interp(np.log2(np.maximum(sizes, 1e-9)), octaves, np.arange(len(octaves)))
    low = np.minimum(place.astype(int), len(octaves) - 2)
    part, rows = (place - low)[:, None], errors[name]
    return ((1 - part) * rows[low, patches] + part * rows[low + 1, patches]).T


def _unbaked_rule(model) -> str:
    if any(part.actor.GetProperty().GetOpacity() < 1 for part in model.levels[0].parts):
        return 'translucent'
    return 'memory' if 'memory' in model.unbaked else 'not baked'


def _spans(model, limits, patch, rules, always, *, upright):
    """Yield the span of each level from one side, from the coarsest."""
    cards = limits.level if upright and limits.level else limits.cards
    for name, (lows, highs) in cards.items():
        yield LevelSpan(name, float(lows[patch]), float(highs[patch]), rules.get(name, always))
    reached, last = float(limits.mesh[patch]), len(model.levels) - 1
    for k in range(last, -1, -1):
        high = max(float(limits.meshes[k, patch]), reached)
        name = _mesh_name(k)
        yield LevelSpan(name, reached, high, rules.get(name, always), model.levels[k].triangles)
        reached = high


def _rules(model, limits, max_error, patch, *, upright) -> dict[str, str]:
    """Return what ends each level from one side: its errors, or the cost of others."""
    errors = model.atlas.errors
    level = upright and limits.level
    ends = (level_ends if level else card_ends)(errors, max_error)
    highs = {name: high for name, (_, high) in (limits.level if level else limits.cards).items()}
    for k, mesh in enumerate(mesh_ends(errors, len(model.levels), max_error)):
        name = _mesh_name(k)
        ends[name], highs[name] = mesh, limits.meshes[k]
    return {name: _rule(end, highs[name], patch) for name, end in ends.items()}


def _mesh_name(k) -> str:
    return f'mesh{k}' if k else 'mesh'


def _rule(ends, highs, patch) -> str:
    """Return the rule that ends a level: what others cost if its errors allow larger sizes."""
    return 'cost' if highs[patch] < ends.sizes[patch] - _CLOSE else str(ends.rules[patch])


def _in_view(group, slot, frame) -> bool:
    """Return whether the bounding sphere of a slot reaches into the frustum."""
    eye = frame.view_from_world @ np.append(group.centers(np.array([slot]))[0], 1.0)
    planes, radius = frustum_planes(frame.clip_from_view)[:4], group.radii[slot]
    inside = (planes[:, :3] @ eye[:3] + planes[:, 3]).min() > -radius
    return bool(inside and (frame.parallel or eye[2] < radius))
