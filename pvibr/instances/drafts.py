"""What is drawn until a bake is done: random triangles, enlarged, and a few small images.

The triangles follow Cook et al., "Stochastic Simplification of Aggregate Detail", SIGGRAPH 2007:
a random part of the surface, enlarged to the area of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.instances.atlas import Atlas
from pvibr.instances.bake import bake_parts
from pvibr.instances.bake_jobs import read_levels
from pvibr.instances.bake_queue import Job, State
from pvibr.instances.levels import BakePlan, LodModel, supplied_levels
from pvibr.instances.limits import Limits, forced_limits, limits_of
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.meshes.decimate import take_arrays

BAKING = 'its images are being baked'
_LIGHT_SET = 1_000_000  # triangles of all instances that any machine draws at once
_SHARE = 0.25  # triangles of a level relative to the next heavier one
_LIGHTEST = 200  # triangles of the lightest level, at least
_PX_PER_SIDE = 2.0  # on-screen size of an instance over the root of its triangles
_VIEWS, _TILE = 8, 32
_BAKED_TRIANGLES = 8_000  # of the level that the small images show, at most
_SPLATS_TO, _CARDS_TO = 3.0, 40.0  # px


@dataclass
class Draft(LodModel):
    """Levels that need no measurement, until those of a job replace them."""

    #: The bake, and who does it: None if that was stopped.
    plan: BakePlan = field(kw_only=True)
    job: Job | None = None
    #: Whether its levels are random triangles, until there are simplified ones.
    is_random: bool = False

    @property
    def better_levels(self) -> Path | None:
        """File of the job's simplified levels; None if there are none, or none are needed."""
        return self.job.levels if self.job is not None and self.is_random else None

    @property
    def is_over(self) -> bool:
        """Whether its levels are there, or will not come."""
        return self.job is not None and self.job.is_over

    @property
    def is_draft(self) -> bool:
        """True: its levels have no measured errors."""
        return True

    def limits(self, _max_error, _driver=None) -> Limits:
        """Return limits at which triangles are about as many as pixels."""
        count = len(self.levels)
        if count == 1:
            return limits_of({}, 1, 1)
        serves_to = [_PX_PER_SIDE * level.triangles**0.5 for level in self.levels]
        ranges = {'splat': (0.0, _SPLATS_TO), 'parallax': (_SPLATS_TO, _CARDS_TO)}
        ends = {k: max(serves_to[k], _CARDS_TO) for k in range(1, count)}
        ranges |= {f'mesh{k}': (_CARDS_TO, end) for k, end in ends.items()}
        return forced_limits(ranges, count)

    def with_levels(self) -> Draft:
        """Return the same with the job's simplified levels."""
        parts, levels = self.plan.parts, None
        if self.better_levels is not None:
            levels = read_levels(self.better_levels, parts)
        return replace(self, levels=levels or self.levels, is_random=False)

    def describe(self, _limits) -> str:
        """Return how far the bake is, as one line."""
        job = self.job
        if job is None:
            return 'drawn as a draft: its bake was stopped; wait() goes on with it'
        if job.state is State.WAITING:
            return f'drawn as a draft: {BAKING} once others are'
        text = f'drawn as a draft: {BAKING}, {job.fraction:.0%} done'
        seconds = job.seconds_left
        return text if seconds is None else f'{text}, about {seconds:.0f} s left'


def draft_of(plan, count) -> Draft:
    """Return what stands in for the levels of `count` instances."""
    parts = plan.parts
    levels = [MeshLevel(list(parts))]
    points = np.concatenate([p.mesh.points for p in parts])
    atlas = Atlas.blank(points, half=plan.grid['half'])
    lighter_levels = supplied_levels(parts)
    is_heavy = count * levels[0].triangles > _LIGHT_SET
    if is_heavy:
        levels += lighter_levels or _random_levels(parts)
        baked_level = next((k for k in levels if k.triangles <= _BAKED_TRIANGLES), levels[-1])
        options = {'sphere': (atlas.center, atlas.radius), 'support': atlas.support}
        options |= {'views': _VIEWS, 'tile': _TILE, 'half': plan.grid['half'], 'culls': False}
        atlas = bake_parts(baked_level.parts, **options)
    is_random = is_heavy and not lighter_levels
    return Draft(levels, atlas, BAKING, plan=plan, is_random=is_random)


def _random_levels(parts) -> list[MeshLevel]:
    levels, share, rng = [], _SHARE, np.random.default_rng(3)
    triangle_count = sum(part.mesh.n_cells for part in parts)
    while share * triangle_count > _LIGHTEST:
        levels.append(MeshLevel([_random_part(part, share, rng) for part in parts]))
        share *= _SHARE
    return levels


def _random_part(part, share, rng):
    """Return a part with about a share of the triangles, enlarged to the same area."""
    mesh = part.mesh
    corners = np.asarray(mesh.points)[mesh.regular_faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    chances = _chances(areas, max(share * len(areas), 1))
    (cell_ids,) = (rng.random(len(areas)) < chances).nonzero()
    if not len(cell_ids):
        cell_ids = np.array([areas.argmax()])
    corners = corners[cell_ids]
    middles = corners.mean(1, keepdims=True)
    growth = chances[cell_ids, None, None] ** -0.5
    points = np.clip(middles + (corners - middles) * growth, *_extent(mesh.points))
    faces: np.ndarray = np.arange(3 * len(cell_ids)).reshape(-1, 3)
    light_mesh = pv.PolyData.from_regular_faces(points.reshape(-1, 3), faces)
    take_arrays(mesh, light_mesh, mesh.regular_faces[cell_ids].ravel(), cell_ids)
    return part.with_mesh(light_mesh)


def _chances(areas, count) -> np.ndarray:
    """Return chances in proportion to areas that sum to a count, none above 1."""
    areas = np.maximum(areas, 1e-6 * max(areas.max(), 1e-300))
    scale = count / areas.sum()
    for _ in range(4):  # what large triangles have above 1 goes to the others
        is_sure = scale * areas >= 1
        free = areas[~is_sure].sum()
        if not is_sure.any() or free <= 0 or count <= is_sure.sum():
            break
        scale = (count - is_sure.sum()) / free
    return np.minimum(scale * areas, 1.0)


def _extent(points):
    return points.min(0), points.max(0)
