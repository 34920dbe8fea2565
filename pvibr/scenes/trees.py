"""Procedural trees: tubes for bark, cut-out cards for leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.maths.arguments import check_one_of, checked_positive
from pvibr.meshes.parts import as_parts

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
UP = np.array([0.0, 0.0, 1.0])
COLORS = 'color_rgb'
LEAF_PIXELS = 64


@dataclass(frozen=True)
class Level:
    """Growth of one level of branches; lengths are relative to the parent's."""

    count: int
    span: tuple[float, float]
    length: tuple[float, float]
    angle: tuple[float, float]
    lift: float
    wander: float
    points: int
    sides: int
    flat: bool = False


@dataclass(frozen=True)
class Kind:
    """Parameters of a species."""

    height: float
    trunk: float
    girth: float
    bark: tuple[int, int, int]
    leaves: tuple[tuple[int, int, int], tuple[int, int, int]]
    leaf: tuple[float, float] = (0.36, 0.36)


#: Levels of branches by species, those on the trunk first.
LEVELS = {
    'broadleaf': (
        Level(16, (0.32, 0.99), (0.68, 0.40), (70, 20), 0.10, 0.10, 10, 7),
        Level(9, (0.18, 0.99), (0.50, 0.30), (54, 38), 0.04, 0.18, 6, 4),
        Level(5, (0.15, 1.00), (0.50, 0.40), (55, 42), 0.00, 0.24, 4, 3),
    ),
    'conifer': (
        Level(170, (0.06, 0.995), (0.205, 0.006), (98, 42), 0.035, 0.05, 6, 3),
        Level(11, (0.14, 0.97), (0.40, 0.14), (58, 46), -0.05, 0.08, 3, 3, flat=True),
    ),
    'poplar': (
        Level(70, (0.07, 0.985), (0.19, 0.055), (42, 24), 0.18, 0.06, 6, 4),
        Level(5, (0.15, 0.98), (0.46, 0.30), (40, 30), 0.14, 0.14, 4, 3),
        Level(3, (0.20, 1.00), (0.50, 0.40), (44, 34), 0.08, 0.20, 3, 3),
    ),
}
#: Height, trunk, girth, colour of the bark, colours of leaves, size of leaves.
KINDS = {
    'broadleaf': Kind(14.0, 0.66, 0.026, (124, 104, 84), ((70, 100, 40), (168, 206, 86))),
    'conifer': Kind(
        20.0, 1.0, 0.017, (112, 88, 70), ((48, 82, 54), (120, 164, 102)), leaf=(0.32, 0.56)
    ),
    'poplar': Kind(22.0, 0.97, 0.016, (140, 132, 114), ((84, 112, 44), (186, 212, 104))),
}


def tree(kind='broadleaf', seed=0, triangles=50_000, height=None):
    """Return a tree as a MultiBlock of bark and leaves."""
    form = _kind(kind)
    height = checked_positive('height', form.height if height is None else height)
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    branches = _grow(form, LEVELS[kind], rng)
    bark = _bark(form, branches, rng)
    cards = (triangles - bark.n_cells + 1) // 2
    if cards < 1:
        raise ValueError(
            f'triangles is {triangles}; a {kind} needs more than {bark.n_cells}, its bark.'
        )
    leaves = _leaves(form, branches[-2:], cards, rng)
    for block in (bark, leaves):
        block.points *= np.float32(height)
    return pv.MultiBlock({'bark': bark, 'leaves': leaves})


def leaf_texture(kind='broadleaf'):
    """Return the texture of a spray of leaves, with an alpha channel."""
    _kind(kind)
    draw = _needles if kind == 'conifer' else _blades
    alpha, light = draw(round_leaves=kind == 'poplar')
    image = np.empty((LEAF_PIXELS, LEAF_PIXELS, 4), dtype=np.uint8)
    image[..., :3] = np.clip(light * 255, 0, 255)[..., None]
    image[..., 3] = np.clip(alpha * 255, 0, 255)
    # No mipmaps: the mean alpha of a spray is below any useful cutoff, so far leaves would
    # vanish.
    texture = pv.Texture(image)
    texture.interpolate = True
    texture.repeat = False
    return texture


def tree_parts(kind='broadleaf', seed=0, triangles=50_000, height=None):
    """Return a tree as parts with their looks."""
    return with_looks(tree(kind, seed, triangles, height), kind)


def with_looks(blocks, kind):
    """Return the parts of a tree with their looks."""
    look = {'scalars': COLORS, 'rgb': True}
    parts = as_parts(blocks['bark'], **look)
    parts += as_parts(blocks['leaves'], texture=leaf_texture(kind), alpha_cutoff=0.5, **look)
    for part in parts:
        # Not smooth_shading, which would compute normals anew.
        part.actor.prop.interpolation = 'Phong'
    return parts


def _kind(kind):
    check_one_of('kind', kind, KINDS)
    return KINDS[kind]


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


@dataclass
class _Branches:
    """All branches of a level: centre lines (n, m, 3), radii (n, m), lengths (n,)."""

    lines: np.ndarray
    radii: np.ndarray
    lengths: np.ndarray
    sides: int


def _grow(form, levels, rng):
    """Return the levels of branches of a tree of height one, the trunk first."""
    trunk = _curves(np.zeros((1, 3)), UP[None], np.array([form.trunk]), 24, 0.35, 0.04, rng)
    radii = form.girth * np.linspace(1, 0.12, 24)[None] ** 0.9
    radii[:, :2] *= [1.7, 1.15]  # The foot.
    found = [_Branches(trunk, radii, np.array([form.trunk]), 12)]
    for level in levels:
        found.append(_sprout(found[-1], level, rng))
    return found


def _sprout(below, level, rng):
    parents, points = below.lines.shape[:2]
    # Evenly spread along the parent, each a little off its place.
    along = (np.arange(level.count) + rng.random((parents, level.count))) / level.count
    place = level.span[0] + along * (level.span[1] - level.span[0])
    start, tangent, radius = _sample(below, place * (points - 1))
    tilt = np.radians(_mix(level.angle, along) + rng.normal(0, 6, along.shape))
    turn = _turns(level, along.shape, rng)
    direction = _tilted(tangent, tilt, turn, level.flat).reshape(-1, 3)
    if not level.flat:
        # A branch that starts downwards soon dies in the shade: start it sideways.
        direction[:, 2] = np.maximum(direction[:, 2], 0.3 * direction[:, 2])
        direction = _unit(direction)
    vigour = rng.uniform(0.8, 1.12, along.shape)
    lengths = (_mix(level.length, along) * below.lengths[:, None] * vigour).ravel()
    lines = _curves(
        start.reshape(-1, 3), direction, lengths, level.points, level.lift, level.wander, rng
    )
    thick = np.minimum(0.62 * radius.ravel(), 0.035 * lengths)
    radii = thick[:, None] * np.linspace(1, 0.15, level.points)
    return _Branches(lines, radii, lengths, level.sides)


def _mix(ends, share):
    return ends[0] + (ends[1] - ends[0]) * share


def _turns(level, shape, rng):
    order = np.arange(shape[1])
    turn = order * (np.pi if level.flat else GOLDEN_ANGLE)
    spread = 0.25 if level.flat else 0.5
    return (
        turn + rng.normal(0, spread, shape) + (0 if level.flat else rng.random((shape[0], 1)) * 6)
    )


def _sample(below, place):
    """Return points, tangents and radii at fractional positions (n, k) along n branches."""
    low = np.minimum(place.astype(int), below.lines.shape[1] - 2)
    share = place - low
    row = np.arange(len(low))[:, None]
    first, second = below.lines[row, low], below.lines[row, low + 1]
    radius = below.radii[row, low] * (1 - share) + below.radii[row, low + 1] * share
    return first + (second - first) * share[..., None], _unit(second - first), radius


def _across(tangent):
    """Return two directions across a tangent, the first horizontal if possible."""
    level = np.cross(UP, tangent)
    steep = np.linalg.norm(level, axis=-1, keepdims=True) < 0.1
    side = _unit(np.where(steep, np.cross([1.0, 0.0, 0.0], tangent), level))
    return side, np.cross(tangent, side)


def _tilted(tangent, tilt, turn, flat):
    side, over = _across(tangent)
    if flat:
        # Right and left alternate; a little up or down.
        turn = np.where(np.cos(turn) > 0, 0, np.pi) + 0.3 * np.sin(turn * 7)
    away = np.cos(turn)[..., None] * side + np.sin(turn)[..., None] * over
    return np.cos(tilt)[..., None] * tangent + np.sin(tilt)[..., None] * away


def _curves(start, direction, lengths, points, lift, wander, rng):
    """Return crooked lines (n, points, 3) that bend upwards or droop."""
    step = (lengths / (points - 1))[:, None]
    line = [start]
    for _ in range(points - 1):
        bend = rng.normal(0, wander, start.shape) + lift * UP
        direction = _unit(direction + bend * np.sqrt(4 / points))
        line.append(line[-1] + direction * step)
    return np.stack(line, axis=1)


def _bark(form, branches, rng):
    points, normals, faces = [], [], []
    shades: list[np.ndarray] = []
    total = 0
    for level in branches:
        ring, normal, face = _tubes(level)
        points.append(ring)
        normals.append(normal)
        faces.append(face + total)
        total += len(ring)
        # Young wood is a little lighter than old.
        shades.append(np.full(len(ring), 0.85 + 0.1 * len(shades)))
    bark = _surface(np.concatenate(points), np.concatenate(faces))
    bark.point_data.active_normals = np.concatenate(normals).astype(np.float32)
    grain = rng.normal(1, 0.10, total) * np.concatenate(shades)
    bark[COLORS] = np.clip(np.outer(grain, form.bark), 0, 255).astype(np.uint8)
    return bark


def _surface(points, faces):
    return pv.PolyData.from_regular_faces(points.astype(np.float32), faces)


def _tubes(level):
    count, points = level.radii.shape
    tangent = _unit(np.gradient(level.lines, axis=1))
    # One reference per branch, not per point: rings must not turn along the tube.
    reference, _ = _across(_unit(tangent.mean(axis=1)))
    side = _unit(reference[:, None] - (reference[:, None] * tangent).sum(-1)[..., None] * tangent)
    angle = np.arange(level.sides) * (2 * np.pi / level.sides)
    normal = (
        np.cos(angle)[:, None] * side[:, :, None]
        + np.sin(angle)[:, None] * np.cross(tangent, side)[:, :, None]
    )
    rings = level.lines[:, :, None] + level.radii[:, :, None, None] * normal
    start = np.arange(count * (points)).reshape(count, points)[:, :-1, None] * level.sides
    this = start + np.arange(level.sides)
    following = start + np.roll(np.arange(level.sides), -1)
    up = level.sides
    faces = np.stack([this, following, following + up, this, following + up, this + up], axis=-1)
    return rings.reshape(-1, 3), normal.reshape(-1, 3), faces.reshape(-1, 3)


def _leaves(form, twigs, count, rng):
    """Return `count` leaf cards around the last two levels of branches."""
    anchor, along, size = _anchors(form, twigs, count, rng)
    center, reach = anchor.mean(axis=0), np.ptp(anchor, axis=0) / 2
    out = (anchor - center) / reach
    bent = _unit(_unit(out) + 0.35 * UP + rng.normal(0, 0.25, anchor.shape))
    spray = form is KINDS['conifer']
    grow = _unit(along + rng.normal(0, 0.28 if spray else 0.9, anchor.shape) - 0.1 * UP)
    # A card faces about where its light comes from, so that its front is its lit side.
    facing = _unit((UP if spray else bent) + rng.normal(0, 0.45, anchor.shape))
    across = _unit(np.cross(grow, facing))
    front = np.cross(across, grow)
    across = np.where((front * bent).sum(axis=1, keepdims=True) < 0, -across, across)
    leaves = _cards(anchor, across * size[:, :1] / 2, grow * size[:, 1:])
    leaves.point_data.active_normals = np.repeat(bent, 4, axis=0).astype(np.float32)
    leaves[COLORS] = np.repeat(_leaf_colors(form, out, rng), 4, axis=0)
    return leaves


def _anchors(form, twigs, count, rng):
    """Return positions, directions and sizes of cards: (n, 3), (n, 3), (n, 2)."""
    weights = np.concatenate([twigs[0].lengths * 0.35, twigs[1].lengths])
    chosen = rng.choice(len(weights), count, p=weights / weights.sum())
    split = len(twigs[0].lengths)
    # Leaves sit on the young end of a branch.
    share = 0.25 + 0.75 * np.sqrt(rng.random(count))
    anchor, along = np.empty((count, 3)), np.empty((count, 3))
    for level, member, first in (
        (twigs[0], chosen < split, 0),
        (twigs[1], chosen >= split, split),
    ):
        rows = chosen[member] - first
        only = _Branches(level.lines[rows], level.radii[rows], level.lengths[rows], 0)
        places = share[member, None] * (level.lines.shape[1] - 1)
        found, tangent, _ = _sample(only, places)
        anchor[member], along[member] = found[:, 0], tangent[:, 0]
    # On a branch shorter than a card only small cards grow: so a spruce ends in a point.
    largest = np.array(form.leaf) / form.height
    branch = np.concatenate([twigs[0].lengths, twigs[1].lengths])[chosen, None]
    size = largest * np.minimum(rng.uniform(0.7, 1.25, (count, 1)), 0.3 + branch / largest[1])
    return anchor, along, size


def _cards(foot, half, stem):
    corners = np.stack([foot - half, foot + half, foot + half + stem, foot - half + stem], axis=1)
    quads = np.arange(len(foot))[:, None] * 4
    cards = _surface(corners.reshape(-1, 3), (quads + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3))
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    cards.active_texture_coordinates = np.tile(corner, (len(foot), 1))
    return cards


def _leaf_colors(form, out, rng):
    # Deep in the crown and below it is darker: less sky is seen from there.
    depth = np.linalg.norm(out, axis=1)
    light = np.clip(0.75 * depth - 0.05 + 0.25 * out[:, 2], 0, 1)
    light = np.clip(light + rng.normal(0, 0.13, len(out)), 0, 1)[:, None]
    shade, bright = map(np.array, form.leaves)
    hue = 1 + rng.normal(0, 0.07, (len(out), 3)) * [1.3, 0.6, 1.0]
    return np.clip((shade + (bright - shade) * light) * hue, 0, 255).astype(np.uint8)


def _grid():
    """Return pixel coordinates: u to the right, v upwards, row 0 at the top."""
    center = (np.arange(LEAF_PIXELS) + 0.5) / LEAF_PIXELS
    u, v = np.meshgrid(center, center[::-1])
    return u, v


def _blades(round_leaves):
    """Return alpha and brightness of seven leaves on a stem."""
    u, v = _grid()
    alpha, light = _stroke(u, v, (0.5, 0.0), (0.5, 0.75), 0.018), np.full_like(u, 0.8)
    width = 0.17 if round_leaves else 0.115
    for number, angle in enumerate(np.radians([78, -80, 48, -46, 20, -24, 0])):
        foot = np.array([0.5, 0.10 + 0.085 * number])
        x, y = u - foot[0], v - foot[1]
        length = 0.42 if round_leaves else 0.47
        along = (x * np.sin(angle) + y * np.cos(angle)) / length
        off = x * np.cos(angle) - y * np.sin(angle)
        inside = np.clip(along, 0, 1)
        edge = width * np.sin(np.pi * inside**0.8) ** 0.8
        cover = np.clip((edge - np.abs(off)) * LEAF_PIXELS * 0.5 + 0.5, 0, 1)
        cover *= (along > 0) & (along < 1)
        vein = 1 - 0.25 * np.exp(-((off / 0.012) ** 2))
        shade = (0.80 + 0.20 * inside + 0.04 * (number % 3)) * vein
        light = np.where(cover > alpha * 0.5, shade, light)
        alpha = np.maximum(alpha, cover)
    return alpha, np.clip(light, 0, 1)


def _needles(round_leaves):
    """Return alpha and brightness of a twig with needles on both sides."""
    del round_leaves
    u, v = _grid()
    alpha, light = _stroke(u, v, (0.5, 0.0), (0.5, 0.93), 0.02), np.full_like(u, 0.75)
    for number, foot in enumerate(np.linspace(0.02, 0.93, 17)):
        reach = 0.46 * (1 - 0.75 * foot**2)
        for sign in (-1, 1):
            tip = (0.5 + sign * reach, min(foot + 0.22, 0.995))
            cover = _stroke(u, v, (0.5, foot), tip, 0.017)
            light = np.where(cover > 0.4, 0.82 + 0.09 * (number % 3), light)
            alpha = np.maximum(alpha, cover)
    return alpha, light


def _stroke(u, v, start, end, radius):
    """Return the pixel coverage of a thick line."""
    start, line = np.array(start), np.subtract(end, start)
    share = np.clip(((u - start[0]) * line[0] + (v - start[1]) * line[1]) / (line @ line), 0, 1)
    distance = np.hypot(u - start[0] - share * line[0], v - start[1] - share * line[1])
    return np.clip((radius - distance) * LEAF_PIXELS * 0.7 + 0.5, 0, 1)
