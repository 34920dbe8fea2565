"""A bounding volume hierarchy over what may share an image."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


class Tree:
    """A binary tree over n boxes; nodes below n are the boxes themselves, the root is the last."""

    def __init__(self, centers, hierarchical):
        self.leaves = len(centers)
        self.children = np.zeros((0, 2), int)
        self._levels: list = []
        if hierarchical and self.leaves > 1:
            self._split(np.asarray(centers, float))
        self.parent = np.full(len(self), -1)
        for k, pair in enumerate(self.children):
            self.parent[pair] = self.leaves + k

    def __len__(self):
        return self.leaves + len(self.children)

    def _split(self, centers):
        """Split at the median of the longest side top-down; number bottom-up."""
        made: list = []
        stack: list = [(np.arange(self.leaves), 0, None)]
        while stack:
            rows, depth, place = stack.pop()
            number = int(rows[0])
            if len(rows) > 1:
                number = self.leaves + len(made)
                made.append([depth, -1, -1])
                axis = np.ptp(centers[rows], axis=0).argmax()
                order = rows[np.argsort(centers[rows, axis], kind='stable')]
                cut = (len(order) + 1) // 2
                parent = number - self.leaves
                stack.append((order[cut:], depth + 1, (parent, 2)))
                stack.append((order[:cut], depth + 1, (parent, 1)))
            if place is not None:
                made[place[0]][place[1]] = number
        made_rows = np.array(made)
        order = np.argsort(-made_rows[:, 0], kind='stable')
        turned = np.arange(len(self) + len(made))
        turned[self.leaves + order] = self.leaves + np.arange(len(made))
        self.children = turned[made_rows[order, 1:]]
        depths = made_rows[order, 0]
        edges = [0, *np.flatnonzero(np.diff(depths)) + 1, len(made)]
        self._levels = [slice(a, b) for a, b in pairwise(edges)]

    def gather(self, values, join) -> np.ndarray:
        """Return values of all nodes from those of the boxes."""
        out = np.zeros((len(self), *values.shape[1:]), values.dtype)
        out[: self.leaves] = values
        for level in self._levels:
            rows = slice(self.leaves + level.start, self.leaves + level.stop)
            first, second = self.children[level].T
            out[rows] = join(out[first], out[second])
        return out

    def cheapest(self, cost, here) -> np.ndarray:
        """Return the nodes that cover all boxes at minimum cost."""
        least = np.where(here, cost, 0.0)
        whole = np.ones(len(self), bool)
        for level in self._levels:
            rows = np.arange(self.leaves + level.start, self.leaves + level.stop)
            first, second = self.children[level].T
            parts = least[first] + least[second]
            whole[rows] = least[rows] <= parts
            least[rows] = np.minimum(least[rows], parts)
        wanted = np.zeros(len(self), bool)
        wanted[-1 if len(self.children) else slice(None)] = True
        for level in reversed(self._levels):
            rows = np.arange(self.leaves + level.start, self.leaves + level.stop)
            opened = wanted[rows] & ~whole[rows]
            wanted[self.children[level][opened].ravel()] = True
            wanted[rows[opened]] = False
        return np.flatnonzero(wanted & here)

    def below(self, node) -> list[int]:
        """Return the boxes under a node."""
        found, stack = [], [int(node)]
        while stack:
            node = stack.pop()
            if node < self.leaves:
                found.append(node)
            else:
                stack += self.children[node - self.leaves].tolist()
        return found

    def above(self, nodes) -> np.ndarray:
        """Return nodes and their ancestors."""
        found = set(np.asarray(nodes, int).tolist())
        for node in list(found):
            node = self.parent[node]
            while node >= 0 and node not in found:
                found.add(int(node))
                node = self.parent[node]
        return np.array(sorted(found), int)
