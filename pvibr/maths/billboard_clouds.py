"""Billboard clouds: few planes that approximate all triangles of a mesh.

Decoret, Durand, Sillion and Dorsey, "Billboard Clouds for Extreme Model Simplification", SIGGRAPH
2003: each triangle votes for the planes that all of its corners are close to, and the plane with
the most votes is taken until no triangle remains. Votes of assigned triangles are subtracted, so
that each triangle is visited twice. A plane is a unit normal n and an offset r: n . x = r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.maths.arguments import checked_positive
from pvibr.maths.slabs import Cover, hemisphere, turned
from pvibr.maths.vectors import unit_vectors

_CHUNK = 1 << 20  # numbers in an array of a block: what stays in the cache is fastest
_MISSING = 1.0  # votes against a plane by what it just misses, over votes for it
_CORE, _CENTRED = 0.3, 0.5  # of the bound: what is as near as this has so many votes more
_FLAT = 1e-2  # of its area: what a triangle counts that stands on a plane
_FINEST = 1e-4  # of half the diagonal: a smaller bound would need too many bins of votes
_SMALL = 1e-9  # of epsilon: what rounding may add to a distance
_ROUNDS = 3  # of finding the best plane for each triangle and the best fit of each plane


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
    finest = _FINEST * surface.radius
    if epsilon < finest:
        raise ValueError(
            f'epsilon is {epsilon!r}; for this mesh it must be at least {finest:.3g}.'
        )
    bound = float(epsilon) / surface.radius * (1 - _SMALL)
    normals, offsets = _Greedy(surface, bound).planes()
    return surface.in_world(*_polished(surface, normals, offsets, bound))


def kmeans_planes(points, faces, count, *, rounds=15, seed=0) -> Planes:
    """Return at most `count` planes by Lloyd's algorithm (k-means).

    Triangles go to the nearest plane by distance and direction; planes fit their triangles.
    """
    if not (int(count) == count and count >= 1):
        raise ValueError(f'planes is {count!r}; it must be an integer of at least 1.')
    surface = _Surface(points, faces)
    # As thick as the slabs that so many planes could cut a ball into.
    scale = 1.0 / np.sqrt(count)
    normals, offsets = _scattered(surface, int(count), scale, np.random.default_rng(seed))
    for _ in range(rounds):
        owner, _ = _assigned(surface, normals, offsets, scale, np.inf)
        normals, offsets = _fitted(surface, normals, offsets, owner, np.inf)
    return surface.in_world(*_used(normals, offsets, owner))


class _Surface:
    """Triangles in units of the mesh's radius, centred at the origin."""

    def __init__(self, points, faces, smallest=1.0):
        points, faces = np.asarray(points, float), np.asarray(faces, int)
        if not len(faces):
            raise ValueError('the mesh has no triangle.')
        low, high = points.min(0), points.max(0)
        self.center = (low + high) / 2
        self.radius = float(np.linalg.norm(high - low)) / 2 or smallest
        self.faces = faces
        self.points = (points - self.center) / self.radius
        self.corners = self.points[faces]
        a, b, c = self.corners.transpose(1, 0, 2)
        across = np.cross(b - a, c - a)
        length = np.linalg.norm(across, axis=1)
        self.normals = unit_vectors(across)
        total = length.sum() or 1.0
        self.areas = length / total + 1e-9 / len(faces)
        self.middles = self.corners.mean(1)

    def __len__(self):
        return len(self.faces)

    def in_world(self, normals, offsets, owner):
        """Return planes in world units."""
        return Planes(normals, offsets * self.radius + normals @ self.center, owner)

    def groups(self, size):
        """Return the group of each triangle, and one member of each group.

        Small triangles that are close and similar share a group; large ones are alone.
        """
        cell = np.floor(self.middles / size)
        looks = np.rint(2 * self.normals)
        small = np.ptp(self.corners, axis=1).max(1) < size
        alone = np.where(small, 0, 1 + np.arange(len(self)))
        keys = np.column_stack([cell, looks, alone]).astype(int)
        _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        return group.reshape(-1), first

    def away(self, normal, offset):
        """Return the largest distance of the corners of each triangle from a plane."""
        return np.abs(self.points @ normal - offset)[self.faces].max(1)

    def own_plane(self, face):
        """Return the plane of a triangle, degenerate ones included."""
        a, b, c = self.corners[face]
        _, _, axes = np.linalg.svd(np.stack([b - a, c - a, c - b]))
        return axes[2], float(axes[2] @ (a + b + c)) / 3


class _Votes:
    """Votes of triangles for planes of some directions, as differences between offset bins."""

    def __init__(self, directions, bound, low, width, count):
        self.directions, self.bound = directions, bound
        self.low, self.width, self.count = low, width, count
        self._steps = np.zeros(len(directions) * (count + 1))
        self._zero = int(np.clip(np.ceil(-low / width), 0, count))

    def add(self, surface, faces, areas):
        """Add the votes of triangles; negative areas withdraw them."""
        block = max(1, _CHUNK // len(self.directions))
        for start in range(0, len(faces), block):
            part = faces[start : start + block]
            corners = surface.corners[part].reshape(-1, 3)
            along = (corners @ self.directions.T).reshape(len(part), 3, -1)
            facing = np.abs(surface.normals[part] @ self.directions.T)
            weight = areas[start : start + block, None] * np.maximum(facing, _FLAT)
            self._add(along.max(1), along.min(1), weight)

    def _add(self, high, low, weight):
        """Add votes for planes between the lowest and the highest corner, `bound` around them."""
        first, last = self._around(high, low, 1)
        row, column = np.nonzero(last > first)
        high, low, weight = high[row, column], low[row, column], weight[row, column]
        first, last, start = first[row, column], last[row, column], column * (self.count + 1)
        ranges = [(first, last, weight)]
        # A central plane displaces less.
        begin, end = self._around(high, low, _CORE)
        ranges.append((begin, np.maximum(begin, end), _CENTRED * weight))
        # A plane that leaves something just outside of it, where nothing else will come, is bad.
        before, beyond = self._around(high, low, 2)
        out = np.maximum(before, self._zero), np.maximum(first, self._zero)
        ranges.append((*out, -_MISSING * weight))
        out = np.minimum(last, self._zero), np.minimum(beyond, self._zero)
        ranges.append((*out, -_MISSING * weight))
        for begin, end, amount in ranges:
            for at, step in ((begin, amount), (end, -amount)):
                self._steps += np.bincount(start + at, step, len(self._steps))

    def _around(self, high, low, bounds):
        """Return the bins, first and last + 1, of planes within some bounds of all corners."""
        away = bounds * self.bound
        return self._bin(high - away, 1), self._bin(low + away, 0) + 1

    def _bin(self, value, up):
        """Return the bin at or below a value, or the one at or above it."""
        bins = (value - self.low) * (1 / self.width) + 1
        found = bins.astype(np.int32)  # towards zero, which is down from 0 on
        if up:
            return np.clip(found + (bins > found) - 1, 0, self.count)
        return np.clip(found - 1, -1, self.count - 1)

    def best(self):
        """Return the normal, offset and vote count of the plane with the most votes."""
        votes = np.cumsum(self._steps.reshape(len(self.directions), -1), axis=1)[:, :-1]
        row, column = np.unravel_index(np.argmax(votes), votes.shape)
        found = self.low + self.width * column
        return self.directions[row], float(found), float(votes[row, column])


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
        self.left = np.ones(len(surface), bool)
        # One triangle votes for those around it that are much smaller than a slab is thick.
        self.group, self.speaker = surface.groups(bound)
        self.weight = np.bincount(self.group, surface.areas)

    def planes(self):
        normals, offsets = [], []
        self.votes.add(self.surface, self.speaker, self.weight)
        while self.left.any():
            normal, offset, near = self._next()
            normals.append(normal)
            offsets.append(offset)
            self.left &= ~near
            self._take(near)
        return np.array(normals), np.array(offsets)

    def _take(self, near):
        group = self.group[near]
        taken = np.bincount(group, self.surface.areas[near], len(self.weight))
        some = np.unique(group)
        self.votes.add(self.surface, self.speaker[some], -taken[some])
        left = np.bincount(self.group[self.left], self.surface.areas[self.left])
        self.weight[:] = 0
        self.weight[: len(left)] = left

    def _next(self):
        """Return a plane and the triangles assigned to it, at least one."""
        normal, offset, votes = self.votes.best()
        if votes > 0:
            normal, offset = self._refined(normal, offset)
            near = self._near(normal, offset)
            if near.any():
                return normal, offset, near
        largest = int(np.argmax(np.where(self.left, self.surface.areas, -1.0)))
        own = self.surface.own_plane(largest)
        normal, offset = self._refined(*own)
        near = self._near(normal, offset)
        if not near[largest]:
            normal, offset = own
            near = self._near(normal, offset)
            near[largest] = True
        return normal, offset, near

    def _near(self, normal, offset):
        return self.left & (self.surface.away(normal, offset) <= self.bound)

    def _refined(self, normal, offset):
        step = self.step / 2
        for _ in range(3):
            groups = self._around(normal, offset, step)
            if not len(groups):
                break
            width = self.bound / 8
            span = 2 * self.bound + step
            count = int(2 * span / width) + 1
            votes = _Votes(turned(normal, step), self.bound, offset - span, width, count)
            votes.add(self.surface, self.speaker[groups], self.weight[groups])
            better = votes.best()
            if better[2] > 0:
                normal, offset = better[:2]
            step /= 2.5
        return normal, offset

    def _around(self, normal, offset, step):
        """Return the groups that may vote for planes turned by a step or two."""
        away = np.abs(self.surface.middles[self.speaker] @ normal - offset)
        reach = 2 * self.bound + 1.5 * step
        return np.flatnonzero((self.weight > 0) & (away <= reach))


def _main_normals(surface, count=64):
    """Return the normals with the most area, exact for walls."""
    largest = np.abs(surface.normals).argmax(1)[:, None]
    sign = np.take_along_axis(surface.normals, largest, 1)  # the same for similar normals
    normals = surface.normals * np.where(sign < 0, -1, 1)
    _, which = np.unique(np.rint(normals * 50).astype(int), axis=0, return_inverse=True)
    which = which.reshape(-1)
    sums = np.stack([np.bincount(which, surface.areas * normals[:, k]) for k in range(3)], 1)
    lengths = np.linalg.norm(sums, axis=1)
    most = np.argsort(-lengths)[:count]
    most = most[lengths[most] > 0]
    return sums[most] / lengths[most, None]


def _polished(surface, normals, offsets, bound):
    """Return better and fewer planes, and the plane of each triangle, all within the bound."""
    normals, offsets = _needed(surface, normals, offsets, bound)
    cover = Cover(surface.points, surface.faces, surface.areas, normals, offsets, bound)
    normals, offsets = cover.merged()
    for _ in range(_ROUNDS):
        owner, _ = _assigned(surface, normals, offsets, bound, bound)
        # A little within: what rounding put beyond the bound would be no plane's.
        normals, offsets = _fitted(surface, normals, offsets, owner, bound * (1 - _SMALL))
    normals, offsets = _needed(surface, normals, offsets, bound)
    owner, _ = _assigned(surface, normals, offsets, bound, bound)
    return _used(normals, offsets, owner)


def _needed(surface, normals, offsets, bound):
    """Return the planes without redundant ones, the smallest removed first."""
    near = np.empty((len(surface), len(offsets)), bool)
    for rows, away, _ in _blocks(surface, normals, offsets):
        near[rows] = away.max(1) <= bound
    times = near.sum(1)
    keep = np.ones(len(offsets), bool)
    for plane in np.argsort(surface.areas @ near):
        mine = near[:, plane]
        if (times[mine] > 1).all():
            keep[plane] = False
            times -= mine
    return normals[keep], offsets[keep]


def _assigned(surface, normals, offsets, scale, bound):
    """Return the plane that moves and foreshortens each triangle least, and that cost."""
    owner, cost = np.zeros(len(surface), int), np.zeros(len(surface))
    for rows, away, facing in _blocks(surface, normals, offsets):
        price = (away**2).mean(1) / scale**2 + (1 - facing)
        far = away.max(1)
        # Those that rounding left without a plane take the nearest.
        price = np.where(far <= bound, price, 1e6 * (1 + far / scale))
        owner[rows] = price.argmin(1)
        cost[rows] = price.min(1)
    return owner, cost


def _blocks(surface, normals, offsets):
    """Yield rows, distances (m, 3, k) and cosines (m, k) of triangles in batches."""
    block = max(1, _CHUNK // len(offsets))
    for start in range(0, len(surface), block):
        rows = slice(start, start + block)
        corners = surface.corners[rows]
        away = np.abs(corners.reshape(-1, 3) @ normals.T - offsets)
        facing = np.abs(surface.normals[rows] @ normals.T)
        yield rows, away.reshape(len(corners), 3, -1), facing


def _fitted(surface, normals, offsets, owner, bound):
    """Return planes through the centroids of their triangles, rotated within the bound."""
    weight = surface.areas
    count = len(offsets)
    total = np.maximum(np.bincount(owner, weight, count), 1e-300)
    sums = [np.bincount(owner, weight * surface.middles[:, k], count) for k in range(3)]
    mean = np.stack(sums, 1) / total[:, None]
    local = surface.corners - mean[owner][:, None]
    spread = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            product = (local[..., i] * local[..., j]).sum(1)
            spread[:, i, j] = np.bincount(owner, weight * product, count)
    _, axes = np.linalg.eigh(spread / total[:, None, None])
    best = axes[..., 0]
    best = best * np.where((best * normals).sum(1) < 0, -1, 1)[:, None]
    found, where = normals.copy(), offsets.copy()
    todo = np.bincount(owner, minlength=count) > 0
    for share in (1.0, 0.5, 0.25, 0.0):
        trial = share * best + (1 - share) * normals
        trial /= np.maximum(np.linalg.norm(trial, axis=1, keepdims=True), 1e-300)
        low, high = _extent(surface, trial, owner)
        middle = np.clip(
            (trial * mean).sum(1), high - bound, np.maximum(low + bound, high - bound)
        )
        good = todo & (high - low <= 2 * bound)
        found[good], where[good] = trial[good], middle[good]
        todo &= ~good
    return found, where


def _extent(surface, normals, owner):
    """Return the smallest and largest offset of the corners of each plane's triangles."""
    along = np.einsum('mcd,md->mc', surface.corners, normals[owner])
    low, high = np.full(len(normals), np.inf), np.full(len(normals), -np.inf)
    np.minimum.at(low, owner, along.min(1))
    np.maximum.at(high, owner, along.max(1))
    return low, high


def _scattered(surface, count, scale, rng):
    """Return planes of triangles, each far from those before, as k-means++ chooses them."""
    cost = np.ones(len(surface))
    normals, offsets = np.empty((count, 3)), np.empty(count)
    for k in range(count):
        chance = surface.areas * cost
        face = rng.choice(len(surface), p=chance / chance.sum())
        normals[k], offsets[k] = surface.own_plane(face)
        _, price = _assigned(surface, normals[k : k + 1], offsets[k : k + 1], scale, np.inf)
        cost = price if k == 0 else np.minimum(cost, price)
        cost = np.maximum(cost, 1e-12)
    return normals, offsets


def _used(normals, offsets, owner):
    used, owner = np.unique(owner, return_inverse=True)
    return normals[used], offsets[used], owner.reshape(-1)
