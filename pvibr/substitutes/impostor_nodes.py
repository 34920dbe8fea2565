"""Bounding volumes of leaves and inner nodes, and their projection."""

from __future__ import annotations

import numpy as np

from pvibr.substitutes.impostor_maths import Card, displacement, fit_cards
from pvibr.substitutes.impostor_tree import Tree

#: Least eye distance for an image, in radii.
NEAREST = 1.5
#: Most frames of camera motion that an image anticipates.
FARTHEST = 60.0
# Share of the allowed error that an anticipating image may have now.
_AHEAD = 0.85


class Nodes:
    """A tree over leaves, with the box of each node."""

    def __init__(self, leaves, hierarchical):
        self.leaves = leaves
        self.tree = Tree(leaves.center, hierarchical, leaves.present)
        self.fit()

    def __len__(self):
        return len(self.tree)

    def grow(self, more):
        """Follow leaves that grew."""
        self.tree.grow(more)
        self.fit()

    def insert(self, leaf) -> list[int]:
        """Insert a leaf; return the nodes that changed."""
        middle, half_size = self.leaves.center[leaf], self.leaves.reach[leaf]
        self.low[leaf], self.high[leaf] = middle - half_size, middle + half_size
        return self.tree.insert(leaf, self.low, self.high)

    def remove(self, leaf) -> list[int]:
        """Remove a leaf; return the nodes that changed."""
        return self.tree.remove(leaf, self.low, self.high)

    def fit(self):
        """Fit the boxes of all nodes to the leaves."""
        leaves, gather = self.leaves, self.tree.gather
        live = leaves.eligible & leaves.visible
        low = np.where(live[:, None], leaves.center - leaves.reach, np.inf)
        high = np.where(live[:, None], leaves.center + leaves.reach, -np.inf)
        low, high = gather(low, np.minimum), gather(high, np.maximum)
        self.live = gather(live, np.logical_or)
        low, high = (np.where(self.live[:, None], a, 0.0) for a in (low, high))
        self.low, self.high = low, high
        self.center, half_size = (low + high) / 2, (high - low) / 2
        self.radius = np.linalg.norm(half_size, axis=1)
        leaf_count = len(leaves)
        half = half_size[:, :, None] * np.eye(3)
        half[:leaf_count] = leaves.half
        self.center[:leaf_count], self.radius[:leaf_count] = leaves.center, leaves.radius
        self._half = half.reshape(-1, 3)
        x, y, z = np.maximum(np.linalg.norm(half, axis=2).T, 1e-300)
        self._faces = 4 * np.stack([y * z / x, z * x / y, x * y / z], 1)

    @property
    def bounds(self) -> np.ndarray:
        """Bounds of all live nodes, in VTK's order."""
        return np.stack([self.low[self.live].min(0), self.high[self.live].max(0)], 1).ravel()

    def span(self, eyes):
        """Return the least and the greatest distance of each box along the view."""
        view_axis = eyes.frame.view_from_world[2, :3]
        center_depth = (eyes.eye - (self.low + self.high) / 2) @ view_axis
        half_depth = (self.high - self.low) / 2 @ np.abs(view_axis)
        return center_depth - half_depth, center_depth + half_depth

    def faces(self, eyes):
        """Return depth and visible area of the boxes."""
        if eyes.parallel:
            edge_depth = self._half @ eyes.toward
        else:
            to_eye = eyes.eye - self.center
            to_eye /= np.maximum(np.linalg.norm(to_eye, axis=1), 1e-300)[:, None]
            edge_depth = np.einsum('nij,nj->ni', self._half.reshape(-1, 3, 3), to_eye)
        edge_depth = np.abs(edge_depth.reshape(-1, 3))
        return np.minimum(edge_depth.sum(1), self.radius), (edge_depth * self._faces).sum(1)

    def below(self, node) -> list[int]:
        """Return the live leaves under a node."""
        return [i for i in self.tree.below(node) if self.live[i]]

    def corners(self, node) -> np.ndarray:
        """Return the corners of a node's leaves, relative to its centre, shape (k, 3)."""
        leaf_ids = self.below(node)
        leaf_offsets = self.leaves.center[leaf_ids] - self.center[node]
        return (leaf_offsets[:, None] + self.leaves.corners[leaf_ids]).reshape(-1, 3)

    def cards(self, nodes, eyes, eye_step, max_error) -> Card:
        """Return cards for new images, as far ahead of the camera as the error allows."""
        is_leaf = nodes < len(self.leaves)
        index_groups = [np.flatnonzero(is_leaf), *np.flatnonzero(~is_leaf)[:, None]]
        cards = []
        for indices in index_groups if is_leaf.any() else index_groups[1:]:
            group_nodes = nodes[indices]
            corners = self.corners(group_nodes[0])[None]
            if indices is index_groups[0]:
                corners = self.leaves.corners[group_nodes]
            cards.append(self._cards_within(group_nodes, corners, eyes, eye_step, max_error))
        joined = Card(*(np.concatenate(field) for field in zip(*cards, strict=True)))
        return joined.rows(np.argsort(np.concatenate(index_groups)))

    def _cards_within(self, nodes, corners, eyes, eye_step, max_error):
        center, radius = self.center[nodes], self.radius[nodes]
        hull = center, corners, radius
        now = fit_cards(*hull, eyes.eye, eyes.up, eyes.toward)
        if eyes.parallel or not eye_step.any():
            return now
        limit = max_error / eyes.pixels(now.center, now.depth)
        error_per_step = displacement(fit_cards(*hull, eyes.eye + eye_step, eyes.up), eyes.eye)
        step_count = np.minimum(_AHEAD * limit / np.maximum(error_per_step, 1e-12), FARTHEST)
        eye_ahead = eyes.eye + step_count[:, None] * eye_step
        far_enough = np.linalg.norm(eye_ahead - center, axis=1) > NEAREST * radius
        ahead = fit_cards(*hull, np.where(far_enough[:, None], eye_ahead, eyes.eye), eyes.up)
        is_valid = far_enough & (displacement(ahead, eyes.eye) <= 0.95 * limit)
        fields = zip(ahead, now, strict=True)
        return Card(
            *(np.where(is_valid.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in fields)
        )
