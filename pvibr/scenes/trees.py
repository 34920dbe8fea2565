"""Procedural trees: tubes for bark, cut-out cards for leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.core.arguments import check_one_of, checked_positive
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
    shape_of_kind = _kind(kind)
    height = checked_positive('height', shape_of_kind.height if height is None else height)
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    branches = _grow(shape_of_kind, LEVELS[kind], rng)
    bark_mesh = _bark(shape_of_kind, branches, rng)
    card_count = (triangles - bark_mesh.n_cells + 1) // 2
    if card_count < 1:
        raise ValueError(
            f'triangles must be above {bark_mesh.n_cells}, the bark of a {kind}, got {triangles}'
        )
    leaf_mesh = _leaves(shape_of_kind, branches[-2:], card_count, rng)
    for block in (bark_mesh, leaf_mesh):
        block.points *= np.float32(height)
    return pv.MultiBlock({'bark': bark_mesh, 'leaves': leaf_mesh})


def leaf_texture(kind='broadleaf'):
    """Return the texture of a spray of leaves, with an alpha channel."""
    _kind(kind)
    draw_leaves = _needles if kind == 'conifer' else _blades
    alpha, brightness = draw_leaves(round_leaves=kind == 'poplar')
    image = np.empty((LEAF_PIXELS, LEAF_PIXELS, 4), dtype=np.uint8)
    image[..., :3] = np.clip(brightness * 255, 0, 255)[..., None]
    image[..., 3] = np.clip(alpha * 255, 0, 255)
    # No mipmaps: their mean alpha is below any useful cutoff, so distant leaves would vanish.
    texture = pv.Texture(image)
    texture.interpolate = True
    texture.repeat = False
    return texture


def tree_parts(kind='broadleaf', seed=0, triangles=50_000, height=None):
    """Return a tree as parts with their looks."""
    return with_looks(tree(kind, seed, triangles, height), kind)


def with_looks(blocks, kind):
    """Return the parts of a tree with their looks."""
    bark_look = {'scalars': COLORS, 'rgb': True}
    parts = as_parts(blocks['bark'], **bark_look)
    parts += as_parts(blocks['leaves'], texture=leaf_texture(kind), alpha_cutoff=0.5, **bark_look)
    for part in parts:
        # smooth_shading would recompute normals.
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
    grown_levels = [_Branches(trunk, radii, np.array([form.trunk]), 12)]
    for level in levels:
        grown_levels.append(_sprout(grown_levels[-1], level, rng))
    return grown_levels


def _sprout(parent_level, level, rng):
    parents, points = parent_level.lines.shape[:2]
    # Evenly spaced along the parent, with jitter.
    share_along = (np.arange(level.count) + rng.random((parents, level.count))) / level.count
    place_on_parent = level.span[0] + share_along * (level.span[1] - level.span[0])
    start, tangent, radius = _sample(parent_level, place_on_parent * (points - 1))
    tilt = np.radians(_mix(level.angle, share_along) + rng.normal(0, 6, share_along.shape))
    turn_angle = _turns(level, share_along.shape, rng)
    direction = _tilted(tangent, tilt, turn_angle, level.flat).reshape(-1, 3)
    if not level.flat:
        # Branches that grow downwards die in the shade: start them sideways.
        direction[:, 2] = np.maximum(direction[:, 2], 0.3 * direction[:, 2])
        direction = _unit(direction)
    vigour = rng.uniform(0.8, 1.12, share_along.shape)
    lengths = (_mix(level.length, share_along) * parent_level.lengths[:, None] * vigour).ravel()
    lines = _curves(
        start.reshape(-1, 3), direction, lengths, level.points, level.lift, level.wander, rng
    )
    base_radii = np.minimum(0.62 * radius.ravel(), 0.035 * lengths)
    radii = base_radii[:, None] * np.linspace(1, 0.15, level.points)
    return _Branches(lines, radii, lengths, level.sides)


def _mix(ends, share):
    return ends[0] + (ends[1] - ends[0]) * share


def _turns(level, shape, rng):
    order = np.arange(shape[1])
    if level.flat:
        return order * np.pi + rng.normal(0, 0.25, shape)
    return order * GOLDEN_ANGLE + rng.normal(0, 0.5, shape) + rng.random((shape[0], 1)) * 6


def _sample(below, place):
    """Return points, tangents and radii at fractional positions (n, k) along n branches."""
    low_index = np.minimum(place.astype(int), below.lines.shape[1] - 2)
    share = place - low_index
    row = np.arange(len(low_index))[:, None]
    start = below.lines[row, low_index]
    step = below.lines[row, low_index + 1] - start
    radius = below.radii[row, low_index] * (1 - share) + below.radii[row, low_index + 1] * share
    return start + step * share[..., None], _unit(step), radius


def _across(tangent):
    """Return two normals of a tangent, the first horizontal if possible."""
    level_normal = np.cross(UP, tangent)
    is_steep = np.linalg.norm(level_normal, axis=-1, keepdims=True) < 0.1
    side_normal = _unit(np.where(is_steep, np.cross([1.0, 0.0, 0.0], tangent), level_normal))
    return side_normal, np.cross(tangent, side_normal)


def _tilted(tangent, tilt, turn, flat):
    first_normal, second_normal = _across(tangent)
    if flat:
        # Alternate right and left, a little up or down.
        turn = np.where(np.cos(turn) > 0, 0, np.pi) + 0.3 * np.sin(turn * 7)
    turn = turn[..., None]
    side_direction = np.cos(turn) * first_normal + np.sin(turn) * second_normal
    return np.cos(tilt)[..., None] * tangent + np.sin(tilt)[..., None] * side_direction


def _curves(start, direction, lengths, points, lift, wander, rng):
    """Return crooked lines (n, points, 3) that bend upwards or droop."""
    step_length = (lengths / (points - 1))[:, None]
    line_points = [start]
    for _ in range(points - 1):
        bend_direction = rng.normal(0, wander, start.shape) + lift * UP
        direction = _unit(direction + bend_direction * np.sqrt(4 / points))
        line_points.append(line_points[-1] + direction * step_length)
    return np.stack(line_points, axis=1)


def _bark(form, branches, rng):
    points, normals, faces = [], [], []
    shade_per_level: list[np.ndarray] = []
    point_count = 0
    for level in branches:
        ring_points, normal, face = _tubes(level)
        points.append(ring_points)
        normals.append(normal)
        faces.append(face + point_count)
        point_count += len(ring_points)
        # Young wood is lighter.
        shade_per_level.append(np.full(len(ring_points), 0.85 + 0.1 * len(shade_per_level)))
    bark = _surface(np.concatenate(points), np.concatenate(faces))
    bark.point_data.active_normals = np.concatenate(normals).astype(np.float32)
    grain_factor = rng.normal(1, 0.10, point_count) * np.concatenate(shade_per_level)
    bark[COLORS] = np.clip(np.outer(grain_factor, form.bark), 0, 255).astype(np.uint8)
    return bark


def _surface(points, faces):
    return pv.PolyData.from_regular_faces(points.astype(np.float32), faces)


def _tubes(level):
    count, points = level.radii.shape
    tangent = _unit(np.gradient(level.lines, axis=1))
    # One reference per branch, so that rings do not twist along it.
    reference_normal, _ = _across(_unit(tangent.mean(axis=1)))
    along = (reference_normal[:, None] * tangent).sum(-1)[..., None]
    side = _unit(reference_normal[:, None] - along * tangent)
    angle = (np.arange(level.sides) * (2 * np.pi / level.sides))[:, None]
    over = np.cross(tangent, side)
    normal = np.cos(angle) * side[:, :, None] + np.sin(angle) * over[:, :, None]
    rings = level.lines[:, :, None] + level.radii[:, :, None, None] * normal
    start = np.arange(count * (points)).reshape(count, points)[:, :-1, None] * level.sides
    ring_index = start + np.arange(level.sides)
    next_index = start + np.roll(np.arange(level.sides), -1)
    up = level.sides
    lower, upper = (ring_index, next_index), (next_index + up, ring_index + up)
    faces = np.stack([*lower, upper[0], ring_index, *upper], axis=-1)
    return rings.reshape(-1, 3), normal.reshape(-1, 3), faces.reshape(-1, 3)


def _leaves(form, twigs, count, rng):
    """Return `count` leaf cards around the last two levels of branches."""
    anchor, along, size = _anchors(form, twigs, count, rng)
    center, half_size = anchor.mean(axis=0), np.ptp(anchor, axis=0) / 2
    from_center = (anchor - center) / half_size
    bent_normals = _unit(_unit(from_center) + 0.35 * UP + rng.normal(0, 0.25, anchor.shape))
    is_conifer = form is KINDS['conifer']
    spread = 0.28 if is_conifer else 0.9
    grown = _unit(along + rng.normal(0, spread, anchor.shape) - 0.1 * UP)
    # Cards face about toward the light, so that their front is lit.
    facing = _unit((UP if is_conifer else bent_normals) + rng.normal(0, 0.45, anchor.shape))
    right = _unit(np.cross(grown, facing))
    front_normals = np.cross(right, grown)
    is_turned = (front_normals * bent_normals).sum(axis=1, keepdims=True) < 0
    right = np.where(is_turned, -right, right)
    leaves = _cards(anchor, right * size[:, :1] / 2, grown * size[:, 1:])
    leaves.point_data.active_normals = np.repeat(bent_normals, 4, axis=0).astype(np.float32)
    leaves[COLORS] = np.repeat(_leaf_colors(form, from_center, rng), 4, axis=0)
    return leaves


def _anchors(form, twigs, count, rng):
    """Return positions, directions and sizes of cards: (n, 3), (n, 3), (n, 2)."""
    branch_weights = np.concatenate([twigs[0].lengths * 0.35, twigs[1].lengths])
    branch_ids = rng.choice(len(branch_weights), count, p=branch_weights / branch_weights.sum())
    level_split = len(twigs[0].lengths)
    # Leaves grow on the young end of a branch.
    share_along = 0.25 + 0.75 * np.sqrt(rng.random(count))
    anchor, leaf_directions = np.empty((count, 3)), np.empty((count, 3))
    for level, member, first_id in (
        (twigs[0], branch_ids < level_split, 0),
        (twigs[1], branch_ids >= level_split, level_split),
    ):
        ids = branch_ids[member] - first_id
        member_branches = _Branches(level.lines[ids], level.radii[ids], level.lengths[ids], 0)
        places = share_along[member, None] * (level.lines.shape[1] - 1)
        sampled, tangent, _ = _sample(member_branches, places)
        anchor[member], leaf_directions[member] = sampled[:, 0], tangent[:, 0]
    # Short branches have small cards, so that a spruce ends in a point.
    largest_size = np.array(form.leaf) / form.height
    branch_lengths = np.concatenate([twigs[0].lengths, twigs[1].lengths])[branch_ids, None]
    growth = np.minimum(rng.uniform(0.7, 1.25, (count, 1)), 0.3 + branch_lengths / largest_size[1])
    return anchor, leaf_directions, largest_size * growth


def _cards(foot, half, stem):
    corners = np.stack([foot - half, foot + half, foot + half + stem, foot - half + stem], axis=1)
    quads = np.arange(len(foot))[:, None] * 4
    cards = _surface(corners.reshape(-1, 3), (quads + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3))
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    cards.active_texture_coordinates = np.tile(corner, (len(foot), 1))
    return cards


def _leaf_colors(form, from_center, rng):
    # Darker inside the crown and below it, where less sky is visible.
    crown_depth = np.linalg.norm(from_center, axis=1)
    light = np.clip(0.75 * crown_depth - 0.05 + 0.25 * from_center[:, 2], 0, 1)
    light = np.clip(light + rng.normal(0, 0.13, len(from_center)), 0, 1)[:, None]
    shade_color, bright_color = map(np.array, form.leaves)
    hue_factor = 1 + rng.normal(0, 0.07, (len(from_center), 3)) * [1.3, 0.6, 1.0]
    color = shade_color + (bright_color - shade_color) * light
    return np.clip(color * hue_factor, 0, 255).astype(np.uint8)


def _grid():
    """Return pixel coordinates: u to the right, v upwards, row 0 at the top."""
    center = (np.arange(LEAF_PIXELS) + 0.5) / LEAF_PIXELS
    u, v = np.meshgrid(center, center[::-1])
    return u, v


def _blades(round_leaves):
    """Return alpha and brightness of seven leaves on a stem."""
    u, v = _grid()
    alpha, light = _stroke(u, v, (0.5, 0.0), (0.5, 0.75), 0.018), np.full_like(u, 0.8)
    leaf_width = 0.17 if round_leaves else 0.115
    for number, angle in enumerate(np.radians([78, -80, 48, -46, 20, -24, 0])):
        leaf_foot = np.array([0.5, 0.10 + 0.085 * number])
        x, y = u - leaf_foot[0], v - leaf_foot[1]
        leaf_length = 0.42 if round_leaves else 0.47
        share_along = (x * np.sin(angle) + y * np.cos(angle)) / leaf_length
        side_distance = x * np.cos(angle) - y * np.sin(angle)
        inside = np.clip(share_along, 0, 1)
        half_width = leaf_width * np.sin(np.pi * inside**0.8) ** 0.8
        inset = half_width - np.abs(side_distance)
        leaf_cover = np.clip(inset * LEAF_PIXELS * 0.5 + 0.5, 0, 1)
        leaf_cover *= (share_along > 0) & (share_along < 1)
        vein_shade = 1 - 0.25 * np.exp(-((side_distance / 0.012) ** 2))
        leaf_shade = (0.80 + 0.20 * inside + 0.04 * (number % 3)) * vein_shade
        light = np.where(leaf_cover > alpha * 0.5, leaf_shade, light)
        alpha = np.maximum(alpha, leaf_cover)
    return alpha, np.clip(light, 0, 1)


def _needles(round_leaves):
    """Return alpha and brightness of a twig with needles on both sides."""
    del round_leaves
    u, v = _grid()
    alpha, light = _stroke(u, v, (0.5, 0.0), (0.5, 0.93), 0.02), np.full_like(u, 0.75)
    for number, needle_foot in enumerate(np.linspace(0.02, 0.93, 17)):
        needle_reach = 0.46 * (1 - 0.75 * needle_foot**2)
        for sign in (-1, 1):
            needle_tip = (0.5 + sign * needle_reach, min(needle_foot + 0.22, 0.995))
            needle_cover = _stroke(u, v, (0.5, needle_foot), needle_tip, 0.017)
            light = np.where(needle_cover > 0.4, 0.82 + 0.09 * (number % 3), light)
            alpha = np.maximum(alpha, needle_cover)
    return alpha, light


def _stroke(u, v, start, end, radius):
    """Return the pixel coverage of a thick line."""
    start, line_vector = np.array(start), np.subtract(end, start)
    share_along = np.clip(
        ((u - start[0]) * line_vector[0] + (v - start[1]) * line_vector[1])
        / (line_vector @ line_vector),
        0,
        1,
    )
    distance = np.hypot(
        u - start[0] - share_along * line_vector[0], v - start[1] - share_along * line_vector[1]
    )
    return np.clip((radius - distance) * LEAF_PIXELS * 0.7 + 0.5, 0, 1)
