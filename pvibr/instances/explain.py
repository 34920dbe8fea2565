"""Why instances are drawn at their levels of detail, and what that costs: methods of a set."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.limits import card_ends, mesh_ends, side_ends
from pvibr.maths import octahedral
from pvibr.meshes.turntable import SIDE_ELEVATION
from pvibr.things.some_items import checked_ids

_CLOSE = 1e-6  # px, tolerance of sizes
#: Why nothing draws an instance.
HIDDEN, OUT_OF_VIEW = 'it is hidden', 'it is out of view'
NOT_FORCED = 'no level is forced at its size'


@dataclass(frozen=True)
class LevelSpan:
    """The sizes at which a level is drawn from one direction, and the rule that ends them."""

    #: Card shader, ``mesh``, or ``mesh1`` and on for lighter meshes, as in ``force_level``.
    name: str
    #: On-screen diameters of the bounding sphere, px; equal where the level is not used.
    low: float
    high: float
    #: What ends it: ``outline``, ``colour``, ``blur``, ``cost``, ``size`` (largest measured or
    #: of the shader), ``forced``, ``translucent``, ``clipped``, ``memory``, ``not baked``,
    #: ``shaders failed``; empty if nothing does.
    rule: str
    #: Triangles of a mesh; 0 for cards.
    triangles: int = 0


@dataclass(frozen=True)
class Explanation:
    """Why an instance is drawn at its level; `print` shows it as a table."""

    #: Index of the instance.
    index: int
    #: On-screen diameter of its bounding sphere, px.
    size: float
    #: Patch of its view direction, of 16.
    patch: int
    #: Name of the level that draws it; empty if none does.
    level: str
    #: Why it is not drawn, or why there are no images; else empty.
    note: str
    #: All levels, coarsest first.
    levels: tuple[LevelSpan, ...]

    def as_dict(self) -> dict:
        """Return everything as plain data."""
        return asdict(self)

    def __str__(self):
        drawn_as = f'drawn as {self.level}' if self.level else 'not drawn'
        reason = f': {self.note}' if self.note else ''
        lines = [
            f'instance {self.index}, {self.size:.1f} px from patch {self.patch}, '
            f'{drawn_as}{reason}'
        ]
        for span in self.levels:
            label = f'{span.name}, {span.triangles:,} triangles' if span.triangles else span.name
            if span.high <= span.low:
                sizes = 'not used'
            elif span.high == np.inf:
                sizes = f'from {span.low:.0f} px'
            else:
                sizes = f'{span.low:.0f} to {span.high:.0f} px'
            lines.append(f'  {label:28} {sizes:16} {span.rule}'.rstrip())
        return '\n'.join(lines)


def explain(self, index) -> Explanation:
    """Return why an instance is drawn at its level of detail.

    Parameters
    ----------
    index : int
        The instance.

    Returns
    -------
    Explanation
        Its size on the screen, the patch of its view direction, and for each level the sizes
        at which that direction uses it and the rule that ends them, for the current camera.
        `print` shows it as a table.

    Raises
    ------
    IndexError
        If the instance does not exist.
    TypeError
        If `index` is not one number.
    RuntimeError
        If the set is in no plotter.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> cones = pl.ibr.add_instances(pv.Cone(), [[0, 0, 0], [2, 0, 0]], cache=False)
    >>> cones.explain(1).level
    'mesh'
    >>> pl.close()
    """
    if np.ndim(index) != 0:
        raise TypeError(f'index must be an int, the index of one instance, got {index!r:.80}')
    (index,) = checked_ids(index, len(self)).tolist()
    if self.pipeline is None:
        raise RuntimeError(
            'instances must be in a plotter, whose camera decides the level; add them first'
        )
    hidden = not (self.drawn_items()[index] and self.GetVisibility())
    group, slot = self.groups.slot_of(index)
    frame, choice = self.pipeline.view(), self._level_choice()
    return _explanation(index, group, slot, frame, choice, hidden=hidden)


def _explanation(index, group, slot, frame, choice, *, hidden) -> Explanation:
    """Return why a slot of a group is drawn at its level in a frame."""
    slots = np.array([slot])
    toward, elevations, distances = group.toward_eye(slots, frame)
    size = float(2 * group.radii[slot] * frame.pixel_scale / distances[0])
    patch = int(octahedral.cells(toward, PATCH_SIDE, group.atlas.half)[0][0])
    from_side = group.atlas.turntable is not None and elevations[0] < SIDE_ELEVATION
    model, always = group.model, choice.rule
    limits = choice.limits(model)
    if model.why_unbaked and always in ('', 'forced'):  # there is no other level to force
        always = _unbaked_rule(model)
    rules = {} if always else _rules(model, limits, choice.max_error, patch, from_side=from_side)
    drawn_limits = limits.coarser(frame.quality)
    levels = tuple(_spans(model, drawn_limits, patch, rules, always, from_side=from_side))
    note = model.why_unbaked
    if hidden:
        note = HIDDEN
    elif not _in_view(group, slot, frame):
        note = OUT_OF_VIEW
    elif not (drawn_level := next((s.name for s in levels if s.low <= size < s.high), '')):
        note = NOT_FORCED
    level = '' if note in (HIDDEN, OUT_OF_VIEW, NOT_FORCED) else drawn_level
    return Explanation(index, size, patch, level, note, levels)


def report(self) -> dict:
    """Return bytes, counts of what was drawn, and the levels and errors of each mesh."""
    choice, errors = self._level_choice(), {}
    if self.pipeline is not None and not choice.rule:
        errors = _described_errors(self.groups, self.pipeline.view(), choice)
    details = {
        'bytes': sum(k.cards.nbytes for k in self.groups),
        'instances': len(self),
        'an instance': self.groups.memory_per_item(),
        **self.groups.counts(),
        'triangles of meshes': self.groups.triangles_drawn(),
    }
    for k, model in self._models.by_mesh.items():
        details[f'atlas {k}'] = model.describe(choice.limits(model))
        if k in errors:
            details[f'error {k}'] = errors[k]
    return details


def _described_errors(groups, frame, choice) -> dict[int, str]:
    """Return the measured error of what groups draw in a frame in words, by mesh."""
    group_limits = choice.limits_in(frame, [group.model for group in groups])
    messages = {}
    for k, group, limits in zip(groups.meshes, groups, group_limits, strict=True):
        if group.atlas.errors and len(group.visible_slots()):
            flip, displaced, blur = measured_error(group, frame, limits)
            messages[k] = (
                f'FLIP {flip:.2f} of that of the mesh at one sample, outlines within '
                f'{displaced:.1f} px, up to {blur:.0%} softer'
            )
    return messages


def measured_error(group, frame, limits) -> tuple[float, float, float]:
    """Return FLIP, outline displacement in pixels, and blur of what a group draws in a frame.

    FLIP relative to the mesh at one sample, mean over pixels; blur as share of gradients lost.
    """
    slots = group.visible_slots()
    toward, _, distances = group.toward_eye(slots, frame)
    sizes = 2 * group.radii[slots] * frame.pixel_scale / distances
    patches = octahedral.cells(toward, PATCH_SIDE, group.atlas.half)[0]
    errors, pixel_counts = group.atlas.errors, sizes**2
    # Those of the mesh itself.
    flip_ratios, displacement_and_blur = np.ones(len(slots)), np.zeros((2, len(slots)))
    level_of = group.near.level_of[slots]
    drawn_by = {f'mesh{k}': level_of == k for k in range(1, len(group.levels))}
    for name, spans in limits.cards.items():
        low, high = spans[:, patches]
        drawn_by[name] = (sizes >= low) & (sizes < high) & (level_of < 0)
    for name, by_level in drawn_by.items():
        level_errors = _interpolated(errors, name, sizes[by_level], patches[by_level])
        displacement, flip, mesh_flip, blur = level_errors
        # The error of a lighter mesh adds to that of one sample per pixel.
        flip_ratios[by_level] = flip / mesh_flip + name.startswith('mesh')
        displacement_and_blur[:, by_level] = displacement, blur
    mean_ratio = float((flip_ratios * pixel_counts).sum() / max(pixel_counts.sum(), 1e-30))
    return mean_ratio, *displacement_and_blur.max(1, initial=0.0).tolist()


def _interpolated(errors, name, sizes, patches) -> np.ndarray:
    """Return the errors of a level interpolated at sizes and patches, (4, n)."""
    octaves = np.log2(errors['sizes'])
    position = np.interp(np.log2(np.maximum(sizes, 1e-9)), octaves, np.arange(len(octaves)))
    lower_size = np.minimum(position.astype(int), len(octaves) - 2)
    fraction = (position - lower_size)[:, None]
    below, above = (errors[name][k, patches] for k in (lower_size, lower_size + 1))
    return ((1 - fraction) * below + fraction * above).T


def _unbaked_rule(model) -> str:
    if any(part.actor.GetProperty().GetOpacity() < 1 for part in model.levels[0].parts):
        return 'translucent'
    return 'memory' if 'memory' in model.why_unbaked else 'not baked'


def _spans(model, limits, patch, rules, always, *, from_side):
    """Yield the span of each level in one patch, coarsest first."""
    cards = limits.side_cards if from_side and limits.side_cards else limits.cards
    for name, (lows, highs) in cards.items():
        yield LevelSpan(name, float(lows[patch]), float(highs[patch]), rules.get(name, always))
    low, lightest = float(limits.mesh_from[patch]), len(model.levels) - 1
    for k in range(lightest, -1, -1):
        high = max(float(limits.mesh_to[k, patch]), low)
        name = _mesh_name(k)
        yield LevelSpan(name, low, high, rules.get(name, always), model.levels[k].triangles)
        low = high


def _rules(model, limits, max_error, patch, *, from_side) -> dict[str, str]:
    """Return what ends each level in one patch: its errors, or the cost of others."""
    errors = model.atlas.errors
    side_cards = from_side and limits.side_cards
    ends = (side_ends if side_cards else card_ends)(errors, max_error)
    level_highs = {
        name: high
        for name, (_, high) in (limits.side_cards if side_cards else limits.cards).items()
    }
    for k, mesh in enumerate(mesh_ends(errors, len(model.levels), max_error)):
        name = _mesh_name(k)
        ends[name], level_highs[name] = mesh, limits.mesh_to[k]
    return {name: _rule(end, level_highs[name], patch) for name, end in ends.items()}


def _mesh_name(k) -> str:
    return f'mesh{k}' if k else 'mesh'


def _rule(ends, highs, patch) -> str:
    """Return the rule that ends a level: cost, if its errors allow larger sizes."""
    return 'cost' if highs[patch] < ends.sizes[patch] - _CLOSE else str(ends.rules[patch])


def _in_view(group, slot, frame) -> bool:
    """Return whether the bounding sphere of a slot reaches into the frustum."""
    eye = frame.view_from_world @ np.append(group.centers(np.array([slot]))[0], 1.0)
    planes, radius = frame.view.side_planes, group.radii[slot]
    inside = (planes[:, :3] @ eye[:3] + planes[:, 3]).min() > -radius
    return bool(inside and (frame.parallel or eye[2] < radius))
