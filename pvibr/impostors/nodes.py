"""Bounding volumes of leaves and inner nodes, and their projection."""

from __future__ import annotations

import numpy as np

from pvibr.impostors.tree import Tree
from pvibr.maths.impostors import Card, displacement, fit_cards

#: Distance of the eye in radii within which there is no image.
NEAREST = 1.5
#: Frames ahead from which an image is taken at most.
FARTHEST = 60.0
# And not farther than where it will be wrong by this share of what is allowed.
_AHEAD = 0.85


class Nodes:
    """A tree over leaves, with the box of each node."""

    def __init__(self, leaves, hierarchical):
        self.leaves = leaves
        self.tree = Tree(leaves.center, hierarchical, leaves.present)
        self.fit()

    def __len__(self):
        return len(self.tree)

    @property
    def has_levels(self) -> bool:
        """Whether there may be inner nodes."""
        return self.tree.hierarchical

    def grow(self, more):
        """Have places for more leaves, as these have."""
        self.tree.grow(more)
        self.fit()

    def insert(self, leaf) -> list[int]:
        """Put a leaf in, and return the nodes that are others now."""
        middle, reach = self.leaves.center[leaf], self.leaves.reach[leaf]
        self.low[leaf], self.high[leaf] = middle - reach, middle + reach
        return self.tree.insert(leaf, self.low, self.high)

    def remove(self, leaf) -> list[int]:
        """Take a leaf out, and return the nodes that are others now."""
        return self.tree.remove(leaf, self.low, self.high)

    def fit(self):
        """Fit all nodes to the leaves."""
        leaves, gather = self.leaves, self.tree.gather
        live = leaves.fits & leaves.wanted
        low = np.where(live[:, None], leaves.center - leaves.reach, np.inf)
        high = np.where(live[:, None], leaves.center + leaves.reach, -np.inf)
        low, high = gather(low, np.minimum), gather(high, np.maximum)
        self.live = gather(live, np.logical_or)
        low, high = (np.where(self.live[:, None], a, 0.0) for a in (low, high))
        self.low, self.high = low, high
        self.center, size = (low + high) / 2, (high - low) / 2
        self.radius = np.linalg.norm(size, axis=1)
        n = len(leaves)
        half = size[:, :, None] * np.eye(3)
        half[:n] = leaves.half
        self.center[:n], self.radius[:n] = leaves.center, leaves.radius
        self._half = half.reshape(-1, 3)
        x, y, z = np.maximum(np.linalg.norm(half, axis=2).T, 1e-300)
        self._faces = 4 * np.stack([y * z / x, z * x / y, x * y / z], 1)

    @property
    def bounds(self) -> np.ndarray:
        """Bounds of all live nodes: x, y and z, low and high."""
        return np.stack([self.low[self.live].min(0), self.high[self.live].max(0)], 1).ravel()

    def span(self, eyes):
        """Return the least and the largest distance of each box along the view."""
        row = eyes.frame.view_from_world[2]
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        away, reach = -(middle - eyes.eye) @ row[:3], half @ np.abs(row[:3])
        return away - reach, away + reach

    def faces(self, eyes):
        """Return depth and visible area of the boxes."""
        if eyes.parallel:
            along = self._half @ eyes.toward
        else:
            toward = eyes.eye - self.center
            toward /= np.maximum(np.linalg.norm(toward, axis=1), 1e-300)[:, None]
            along = np.einsum('nij,nj->ni', self._half.reshape(-1, 3, 3), toward)
        along = np.abs(along.reshape(-1, 3))
        return np.minimum(along.sum(1), self.radius), (along * self._faces).sum(1)

    def below(self, node) -> list[int]:
        """Return the live leaves under a node."""
        return [i for i in self.tree.below(node) if self.live[i]]

    def corners(self, node) -> np.ndarray:
        """Return the corners of a node's leaves, relative to its centre, shape (k, 3)."""
        rows = self.below(node)
        middles = self.leaves.center[rows] - self.center[node]
        return (middles[:, None] + self.leaves.corners[rows]).reshape(-1, 3)

    def cards(self, nodes, eyes, step, max_error) -> Card:
        """Return cards for new images, as far ahead of the motion as the error allows."""
        leaves = nodes < len(self.leaves)
        rows = [np.flatnonzero(leaves), *np.flatnonzero(~leaves)[:, None]]
        cards = []
        for row in rows if leaves.any() else rows[1:]:
            some = nodes[row]
            corners = self.corners(some[0])[None]
            if row is rows[0]:
                corners = self.leaves.corners[some]
            cards.append(self._cards_within(some, corners, eyes, step, max_error))
        joined = Card(*(np.concatenate(field) for field in zip(*cards, strict=True)))
        return joined.rows(np.argsort(np.concatenate(rows)))

    def _cards_within(self, nodes, corners, eyes, step, max_error):
        boxes = self.center[nodes], corners, self.radius[nodes]
        card = fit_cards(*boxes, eyes.eye, eyes.up, eyes.toward)
        if eyes.parallel or not step.any():
            return card
        limit = max_error / eyes.pixels(card.center, card.depth)
        # A card from one step ahead tells how many there may be.
        slope = displacement(fit_cards(*boxes, eyes.eye + step, eyes.up), eyes.eye)
        steps = np.minimum(_AHEAD * limit / np.maximum(slope, 1e-12), FARTHEST)
        ahead = eyes.eye + steps[:, None] * step
        far = np.linalg.norm(ahead - boxes[0], axis=1) > NEAREST * boxes[2]
        guess = fit_cards(*boxes, np.where(far[:, None], ahead, eyes.eye), eyes.up)
        serves = far & (displacement(guess, eyes.eye) <= 0.95 * limit)
        pairs = zip(guess, card, strict=True)
        return Card(*(np.where(serves.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in pairs))
