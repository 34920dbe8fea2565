"""Billboard clouds: few planes that approximate all triangles of a mesh.

Decoret, Durand, Sillion and Dorsey, "Billboard Clouds for Extreme Model Simplification", SIGGRAPH
2003: each triangle votes for the planes that all of its corners are close to, and the plane with
the most votes is taken until no triangle remains. Votes of assigned triangles are subtracted, so
that each triangle is visited twice. A plane is a unit normal n and an offset r: n . x = r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.core.arguments import checked_positive
from pvibr.maths.vectors import unit_vectors
from pvibr.substitutes.slabs import Cover, hemisphere, turned

_CHUNK = 1 << 20  # numbers per batch, which should stay in the processor's cache
_MISSING = 1.0  # votes against a plane by a triangle that it just misses, over votes for it
_CORE, _CENTRED = 0.3, 0.5  # of the bound: what is as near as this has so many votes more
_FLAT = 1e-2  # least share of its area that a triangle perpendicular to a plane counts
_FINEST = 1e-4  # of half the diagonal: a smaller bound would need too many bins of votes
_SMALL = 1e-9  # of epsilon: rounding of a distance
_ROUNDS = 3  # of assigning triangles to planes and fitting planes to triangles


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes, and the assignment of triangles to them.

    Normals (k, 3), offsets along them (k,) in world units, and the plane of each triangle (m,).
    """

    normals: np.ndarray
    offsets: np.ndarray
    owner: np.ndarray

    def __len__(self):
        return len(self.offsets)

    def distances(self, points) -> np.ndarray:
        """Return the signed distances of points from each plane, (..., k), world units."""
        return np.asarray(points, float) @ self.normals.T - self.offsets

    def displacements(self, points, faces) -> np.ndarray:
        """Return how far projection moves each corner of each triangle, (m, 3), world units."""
        corners = np.asarray(points, float)[np.asarray(faces)]
        along = np.einsum('mcd,md->mc', corners, self.normals[self.owner])
        return np.abs(along - self.offsets[self.owner][:, None])


def greedy_planes(points, faces, epsilon) -> Planes:
    """Return few planes such that each triangle has one within `epsilon` of its corners."""
    surface = _Surface(points, faces, checked_positive('epsilon', epsilon))
    min_epsilon = _FINEST * surface.radius
    if epsilon < min_epsilon:
        raise ValueError(
            f'epsilon must be at least {min_epsilon:.3g} for this mesh, got {epsilon!r}'
        )
    bound = float(epsilon) / surface.radius * (1 - _SMALL)
    normals, offsets = _Greedy(surface, bound).planes()
    return surface.in_world(*_polished(surface, normals, offsets, bound))


def kmeans_planes(points, faces, count, *, rounds=15, seed=0) -> Planes:
    """Return at most `count` planes by Lloyd's algorithm (k-means).

    Triangles go to the nearest plane by distance and direction; planes fit their triangles.
    """
    if not (int(count) == count and count >= 1):
        raise ValueError(f'planes must be an integer of at least 1, got {count!r}')
    surface = _Surface(points, faces)
    # As thick as the slabs that so many planes could cut a ball into.
    slab_width = 1.0 / np.sqrt(count)
    normals, offsets = _scattered(surface, int(count), slab_width, np.random.default_rng(seed))
    for _ in range(rounds):
        owner, _ = _assigned(surface, normals, offsets, slab_width, np.inf)
        normals, offsets = _fitted(surface, normals, offsets, owner, np.inf)
    return surface.in_world(*_used(normals, offsets, owner))


class _Surface:
    """Triangles in units of the mesh's radius, centred at the origin."""

    def __init__(self, points, faces, smallest=1.0):
        points, faces = np.asarray(points, float), np.asarray(faces, int)
        if not len(faces):
            raise ValueError('the mesh must have triangles, got none')
        low, high = points.min(0), points.max(0)
        self.center = (low + high) / 2
        self.radius = float(np.linalg.norm(high - low)) / 2 or smallest
        self.faces = faces
        self.points = (points - self.center) / self.radius
        self.corners = self.points[faces]
        a, b, c = self.corners.transpose(1, 0, 2)
        face_crosses = np.cross(b - a, c - a)
        double_areas = np.linalg.norm(face_crosses, axis=1)
        self.normals = unit_vectors(face_crosses)
        total_area = double_areas.sum() or 1.0
        self.areas = double_areas / total_area + 1e-9 / len(faces)
        self.middles = self.corners.mean(1)

    def __len__(self):
        return len(self.faces)

    def in_world(self, normals, offsets, owner):
        """Return planes in world units."""
        return Planes(normals, offsets * self.radius + normals @ self.center, owner)

    def groups(self, cell_size):
        """Return the group of each triangle, and one member of each group.

        Small triangles that are close and similar share a group; large ones are alone.
        """
        grid_cell = np.floor(self.middles / cell_size)
        normal_bin = np.rint(2 * self.normals)
        is_small = np.ptp(self.corners, axis=1).max(1) < cell_size
        lone_group = np.where(is_small, 0, 1 + np.arange(len(self)))
        keys = np.column_stack([grid_cell, normal_bin, lone_group]).astype(int)
        _, speakers, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        return group.reshape(-1), speakers

    def away(self, normal, offset):
        """Return the largest distance of the corners of each triangle from a plane."""
        return np.abs(self.points @ normal - offset)[self.faces].max(1)

    def own_plane(self, face):
        """Return the plane of a triangle, degenerate ones included."""
        a, b, c = self.corners[face]
        _, _, right_vectors = np.linalg.svd(np.stack([b - a, c - a, c - b]))
        return right_vectors[2], float(right_vectors[2] @ (a + b + c)) / 3


class _Votes:
    """Votes of triangles for planes of some directions, as differences between offset bins."""

    def __init__(self, directions, bound, low, width, count):
        self.directions, self.bound = directions, bound
        self.low, self.width, self.count = low, width, count
        self._steps = np.zeros(len(directions) * (count + 1))
        self._zero = int(np.clip(np.ceil(-low / width), 0, count))

    def add(self, surface, faces, areas):
        """Add the votes of triangles; negative areas withdraw them."""
        batch_size = max(1, _CHUNK // len(self.directions))
        for start in range(0, len(faces), batch_size):
            batch = faces[start : start + batch_size]
            corners = surface.corners[batch].reshape(-1, 3)
            corner_offsets = (corners @ self.directions.T).reshape(len(batch), 3, -1)
            cosines = np.abs(surface.normals[batch] @ self.directions.T)
            vote_weights = areas[start : start + batch_size, None] * np.maximum(cosines, _FLAT)
            self._add(corner_offsets.max(1), corner_offsets.min(1), vote_weights)

    def _add(self, high, low, weight):
        """Add votes for planes between the lowest and the highest corner, `bound` around them."""
        first_bin, last_bin = self._around(high, low, 1)
        voters, direction_index = np.nonzero(last_bin > first_bin)
        high = high[voters, direction_index]
        low = low[voters, direction_index]
        weight = weight[voters, direction_index]
        first_bin = first_bin[voters, direction_index]
        last_bin = last_bin[voters, direction_index]
        row_start = direction_index * (self.count + 1)
        ranges = [(first_bin, last_bin, weight)]
        # A central plane displaces less.
        range_first, range_last = self._around(high, low, _CORE)
        ranges.append((range_first, np.maximum(range_first, range_last), _CENTRED * weight))
        # Penalize planes that leave a triangle just outside, where no other plane will be.
        outer_first, outer_last = self._around(high, low, 2)
        missed_bins = np.maximum(outer_first, self._zero), np.maximum(first_bin, self._zero)
        ranges.append((*missed_bins, -_MISSING * weight))
        missed_bins = np.minimum(last_bin, self._zero), np.minimum(outer_last, self._zero)
        ranges.append((*missed_bins, -_MISSING * weight))
        for range_first, range_last, votes in ranges:
            for bin_index, vote_change in ((range_first, votes), (range_last, -votes)):
                self._steps += np.bincount(row_start + bin_index, vote_change, len(self._steps))

    def _around(self, high, low, multiple):
        """Return the bins, first and last + 1, of planes within some bounds of all corners."""
        reach = multiple * self.bound
        return self._bin(high - reach, 1), self._bin(low + reach, 0) + 1

    def _bin(self, value, round_up):
        """Return the bin at or below a value, or the one at or above it."""
        exact_bins = (value - self.low) * (1 / self.width) + 1
        whole_bins = exact_bins.astype(np.int32)  # towards zero, which is down from 0 on
        if round_up:
            return np.clip(whole_bins + (exact_bins > whole_bins) - 1, 0, self.count)
        return np.clip(whole_bins - 1, -1, self.count - 1)

    def best(self):
        """Return the normal, offset and vote count of the plane with the most votes."""
        votes = np.cumsum(self._steps.reshape(len(self.directions), -1), axis=1)[:, :-1]
        best_row, best_column = np.unravel_index(np.argmax(votes), votes.shape)
        best_offset = self.low + self.width * best_column
        return self.directions[best_row], float(best_offset), float(votes[best_row, best_column])


class _Greedy:
    """Greedy selection of the plane with the most votes, until every triangle has one."""

    def __init__(self, surface, bound):
        self.surface, self.bound = surface, bound
        # Refinement finds directions between these.
        self.step = float(np.clip(3.5 * bound, 0.1, 0.25))
        directions = np.concatenate([hemisphere(self.step), _main_normals(surface)])
        width = bound / 2
        count = int(np.ceil((2 + 4 * bound) / width)) + 1
        self.votes = _Votes(directions, bound, -(count - 1) / 2 * width, width, count)
        self.unassigned = np.ones(len(surface), bool)
        # One triangle votes for its neighbours, all much smaller than a slab is thick.
        self.group, self.representative = surface.groups(bound)
        self.weight = np.bincount(self.group, surface.areas)

    def planes(self):
        normals, offsets = [], []
        self.votes.add(self.surface, self.representative, self.weight)
        while self.unassigned.any():
            normal, offset, near = self._next()
            normals.append(normal)
            offsets.append(offset)
            self.unassigned &= ~near
            self._take(near)
        return np.array(normals), np.array(offsets)

    def _take(self, near):
        near_groups = self.group[near]
        assigned = np.bincount(near_groups, self.surface.areas[near], len(self.weight))
        changed = np.unique(near_groups)
        self.votes.add(self.surface, self.representative[changed], -assigned[changed])
        remaining = np.bincount(self.group[self.unassigned], self.surface.areas[self.unassigned])
        self.weight[:] = 0
        self.weight[: len(remaining)] = remaining

    def _next(self):
        """Return a plane and the triangles assigned to it, at least one."""
        normal, offset, vote_count = self.votes.best()
        if vote_count > 0:
            normal, offset = self._refined(normal, offset)
            near = self._near(normal, offset)
            if near.any():
                return normal, offset, near
        largest_face = int(np.argmax(np.where(self.unassigned, self.surface.areas, -1.0)))
        own_plane = self.surface.own_plane(largest_face)
        normal, offset = self._refined(*own_plane)
        near = self._near(normal, offset)
        if not near[largest_face]:
            normal, offset = own_plane
            near = self._near(normal, offset)
            near[largest_face] = True
        return normal, offset, near

    def _near(self, normal, offset):
        return self.unassigned & (self.surface.away(normal, offset) <= self.bound)

    def _refined(self, normal, offset):
        step = self.step / 2
        for _ in range(3):
            voting_groups = self._around(normal, offset, step)
            if not len(voting_groups):
                break
            width = self.bound / 8
            reach = 2 * self.bound + step
            count = int(2 * reach / width) + 1
            votes = _Votes(turned(normal, step), self.bound, offset - reach, width, count)
            votes.add(self.surface, self.representative[voting_groups], self.weight[voting_groups])
            best_plane = votes.best()
            if best_plane[2] > 0:
                normal, offset = best_plane[:2]
            step /= 2.5
        return normal, offset

    def _around(self, normal, offset, step):
        """Return the groups that may vote for planes turned by a step or two."""
        group_distances = np.abs(self.surface.middles[self.representative] @ normal - offset)
        max_distance = 2 * self.bound + 1.5 * step
        return np.flatnonzero((self.weight > 0) & (group_distances <= max_distance))


def _main_normals(surface, count=64):
    """Return the normals with the most area, exact for walls."""
    main_axis = np.abs(surface.normals).argmax(1)[:, None]
    main_sign = np.take_along_axis(surface.normals, main_axis, 1)  # the same for similar normals
    normals = surface.normals * np.where(main_sign < 0, -1, 1)
    _, bin_index = np.unique(np.rint(normals * 50).astype(int), axis=0, return_inverse=True)
    bin_index = bin_index.reshape(-1)
    sums = np.stack([np.bincount(bin_index, surface.areas * normals[:, k]) for k in range(3)], 1)
    sum_lengths = np.linalg.norm(sums, axis=1)
    main_groups = np.argsort(-sum_lengths)[:count]
    main_groups = main_groups[sum_lengths[main_groups] > 0]
    return sums[main_groups] / sum_lengths[main_groups, None]


def _polished(surface, normals, offsets, bound):
    """Return better and fewer planes, and the plane of each triangle, all within the bound."""
    normals, offsets = _needed(surface, normals, offsets, bound)
    cover = Cover(surface.points, surface.faces, surface.areas, normals, offsets, bound)
    normals, offsets = cover.merged()
    for _ in range(_ROUNDS):
        owner, _ = _assigned(surface, normals, offsets, bound, bound)
        # Slightly inside: rounding must not put a triangle beyond the bound of every plane.
        normals, offsets = _fitted(surface, normals, offsets, owner, bound * (1 - _SMALL))
    normals, offsets = _needed(surface, normals, offsets, bound)
    owner, _ = _assigned(surface, normals, offsets, bound, bound)
    return _used(normals, offsets, owner)


def _needed(surface, normals, offsets, bound):
    """Return the planes without redundant ones, the smallest removed first."""
    is_near = np.empty((len(surface), len(offsets)), bool)
    for batch, distances, _ in _blocks(surface, normals, offsets):
        is_near[batch] = distances.max(1) <= bound
    plane_counts = is_near.sum(1)
    is_needed = np.ones(len(offsets), bool)
    for plane in np.argsort(surface.areas @ is_near):
        own_faces = is_near[:, plane]
        if (plane_counts[own_faces] > 1).all():
            is_needed[plane] = False
            plane_counts -= own_faces
    return normals[is_needed], offsets[is_needed]


def _assigned(surface, normals, offsets, scale, bound):
    """Return the plane that moves and foreshortens each triangle least, and that cost."""
    nearest_plane, least_cost = np.zeros(len(surface), int), np.zeros(len(surface))
    for batch, distances, cosines in _blocks(surface, normals, offsets):
        costs = (distances**2).mean(1) / scale**2 + (1 - cosines)
        farthest = distances.max(1)
        # Triangles that rounding leaves without a plane take the nearest.
        costs = np.where(farthest <= bound, costs, 1e6 * (1 + farthest / scale))
        nearest_plane[batch] = costs.argmin(1)
        least_cost[batch] = costs.min(1)
    return nearest_plane, least_cost


def _blocks(surface, normals, offsets):
    """Yield rows, distances (m, 3, k) and cosines (m, k) of triangles in batches."""
    batch_size = max(1, _CHUNK // len(offsets))
    for start in range(0, len(surface), batch_size):
        batch = slice(start, start + batch_size)
        corners = surface.corners[batch]
        distances = np.abs(corners.reshape(-1, 3) @ normals.T - offsets)
        cosines = np.abs(surface.normals[batch] @ normals.T)
        yield batch, distances.reshape(len(corners), 3, -1), cosines


def _fitted(surface, normals, offsets, owner, bound):
    """Return planes through the centroids of their triangles, rotated within the bound."""
    weight = surface.areas
    count = len(offsets)
    plane_areas = np.maximum(np.bincount(owner, weight, count), 1e-300)
    sums = [np.bincount(owner, weight * surface.middles[:, k], count) for k in range(3)]
    centroids = np.stack(sums, 1) / plane_areas[:, None]
    local_corners = surface.corners - centroids[owner][:, None]
    covariances = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            corner_products = (local_corners[..., i] * local_corners[..., j]).sum(1)
            covariances[:, i, j] = np.bincount(owner, weight * corner_products, count)
    _, axes = np.linalg.eigh(covariances / plane_areas[:, None, None])
    flattest = axes[..., 0]
    flattest = flattest * np.where((flattest * normals).sum(1) < 0, -1, 1)[:, None]
    accepted_normals, accepted_offsets = normals.copy(), offsets.copy()
    pending = np.bincount(owner, minlength=count) > 0
    for fit_share in (1.0, 0.5, 0.25, 0.0):
        trial = fit_share * flattest + (1 - fit_share) * normals
        trial /= np.maximum(np.linalg.norm(trial, axis=1, keepdims=True), 1e-300)
        low, high = _extent(surface, trial, owner)
        middle = np.clip(
            (trial * centroids).sum(1), high - bound, np.maximum(low + bound, high - bound)
        )
        within_bound = pending & (high - low <= 2 * bound)
        accepted_normals[within_bound] = trial[within_bound]
        accepted_offsets[within_bound] = middle[within_bound]
        pending &= ~within_bound
    return accepted_normals, accepted_offsets


def _extent(surface, normals, owner):
    """Return the smallest and largest offset of the corners of each plane's triangles."""
    corner_offsets = np.einsum('mcd,md->mc', surface.corners, normals[owner])
    low_offsets, high_offsets = np.full(len(normals), np.inf), np.full(len(normals), -np.inf)
    np.minimum.at(low_offsets, owner, corner_offsets.min(1))
    np.maximum.at(high_offsets, owner, corner_offsets.max(1))
    return low_offsets, high_offsets


def _scattered(surface, count, scale, rng):
    """Return planes of triangles, each far from those before, as k-means++ chooses them."""
    nearest_cost = np.ones(len(surface))
    normals, offsets = np.empty((count, 3)), np.empty(count)
    for k in range(count):
        face_weights = surface.areas * nearest_cost
        face = rng.choice(len(surface), p=face_weights / face_weights.sum())
        normals[k], offsets[k] = surface.own_plane(face)
        _, plane_cost = _assigned(surface, normals[k : k + 1], offsets[k : k + 1], scale, np.inf)
        nearest_cost = plane_cost if k == 0 else np.minimum(nearest_cost, plane_cost)
        nearest_cost = np.maximum(nearest_cost, 1e-12)
    return normals, offsets


def _used(normals, offsets, owner):
    used_planes, owner = np.unique(owner, return_inverse=True)
    return normals[used_planes], offsets[used_planes], owner.reshape(-1)
