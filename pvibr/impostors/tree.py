"""A bounding volume hierarchy over what may share an image."""

from __future__ import annotations

import numpy as np


class Tree:
    """A binary tree over boxes that come and go.

    Nodes below `leaves` are places of boxes, the others join two. A node keeps its number for as
    long as it is there. Insertion and balance: Catto, "Dynamic Bounding Volume Hierarchies",
    GDC 2019; without a hierarchy there are boxes only.
    """

    def __init__(self, centers, hierarchical, present=None):
        self.leaves = n = len(centers)
        self.hierarchical = bool(hierarchical)
        inner = max(n - 1, 0) if hierarchical else 0
        self.children = np.full((inner, 2), -1)
        self.parent = np.full(n + inner, -1)
        self.height = np.zeros(n + inner, int)
        self.root = -1  # of no box, or of no hierarchy
        self._levels: list | None = None
        rows = np.arange(n) if present is None else np.asarray(present, int)
        if hierarchical and len(rows):
            self._split(np.asarray(centers, float), rows)

    def __len__(self):
        return self.leaves + len(self.children)

    def _split(self, centers, rows):
        """Split at the median of the longest side top-down."""
        free = self.leaves
        self.root = free if len(rows) > 1 else int(rows[0])
        stack: list = [(rows, -1, 0)]
        while stack:
            rows, parent, side = stack.pop()
            node = int(rows[0])
            if len(rows) > 1:
                node, free = free, free + 1
                axis = np.ptp(centers[rows], axis=0).argmax()
                order = rows[np.argsort(centers[rows, axis], kind='stable')]
                cut = (len(order) + 1) // 2
                stack += [(order[cut:], node, 1), (order[:cut], node, 0)]
                self.height[node] = (len(rows) - 1).bit_length()
            self.parent[node] = parent
            if parent >= 0:
                self.children[parent - self.leaves, side] = node

    # -- boxes that come and go ------------------------------------------------------------------

    def grow(self, more):
        """Have places for more boxes: the numbers of nodes that join others rise by as many."""
        n, inner = self.leaves, more if self.hierarchical else 0
        self.parent = np.insert(self.parent, n, np.full(more, -1))
        self.height = np.insert(self.height, n, np.zeros(more, int))
        for array in (self.parent, self.children):
            array[array >= n] += more
        self.root += more if self.root >= n else 0
        self.leaves += more
        self.parent = np.append(self.parent, np.full(inner, -1))
        self.height = np.append(self.height, np.zeros(inner, int))
        self.children = np.append(self.children, np.full((inner, 2), -1), axis=0)
        self._levels = None

    def has(self, leaf) -> bool:
        """Return True if a box is in it."""
        return not self.hierarchical or leaf == self.root or self.parent[leaf] >= 0

    def insert(self, leaf, low, high) -> list[int]:
        """Put a box in, given the corners of all nodes; return the nodes that are others now."""
        if self.root < 0:
            self.root = leaf
            return [leaf]
        beside, above = self._nearest(leaf, low, high), self._free()
        self._replace(beside, above)
        self._join(above, beside, leaf)
        return [leaf, *self._mend(above, low, high)]

    def remove(self, leaf, low, high) -> list[int]:
        """Take a box out; return the nodes that are others now."""
        if not self.hierarchical or not self.has(leaf):
            return [leaf]
        above = int(self.parent[leaf])
        if above < 0:
            self.root = -1
            return [leaf]
        pair = self.children[above - self.leaves]
        beside, over = int(pair[pair != leaf][0]), int(self.parent[above])
        self._replace(above, beside)
        self.children[above - self.leaves] = self.parent[[leaf, above]] = -1
        return [leaf, above, *self._mend(over, low, high)]

    def _free(self) -> int:
        """Return a number that no node has."""
        return self.leaves + int(np.flatnonzero(self.children[:, 0] < 0)[0])

    def _nearest(self, leaf, low, high) -> int:
        """Return the node beside which a box enlarges the boxes least."""
        node = self.root
        while node >= self.leaves:
            pair = self.children[node - self.leaves]
            sides = np.maximum(high[pair], high[leaf]) - np.minimum(low[pair], low[leaf])
            node = int(pair[np.argmin((sides - (high - low)[pair]).sum(1))])
        return node

    def _replace(self, node, other):
        """Put a node in the place of another."""
        above = self.parent[other] = self.parent[node]
        if above < 0:
            self.root = other
        else:
            pair = self.children[above - self.leaves]
            pair[pair == node] = other

    def _join(self, node, *pair):
        self.children[node - self.leaves] = pair
        self.parent[list(pair)] = node

    def _mend(self, node, low, high) -> list[int]:
        """Balance a node and those above it, and fit their boxes; return which changed."""
        changed = []
        self._levels = None
        while node >= 0:
            changed += [*self._balance(node, low, high), node]
            self._fit(node, low, high)
            node = int(self.parent[node])
        return changed

    def _balance(self, node, low, high) -> list[int]:
        """Exchange a child for a grandchild where one side is the higher by two or more."""
        flat, tall = self._by_height(node)
        if self.height[tall] - self.height[flat] < 2:
            return []
        flatter, taller = self._by_height(tall)
        self._join(tall, flat, flatter)
        self._join(node, taller, tall)
        self._fit(tall, low, high)
        return [tall]

    def _by_height(self, node) -> list[int]:
        return sorted(self.children[node - self.leaves].tolist(), key=lambda k: self.height[k])

    def _fit(self, node, low, high):
        pair = self.children[node - self.leaves]
        self.height[node] = self.height[pair].max() + 1
        low[node], high[node] = low[pair].min(0), high[pair].max(0)

    # -- what is asked of it ---------------------------------------------------------------------

    @property
    def levels(self) -> list:
        """The nodes that join others, and their children, from the bottom."""
        if self._levels is None:
            inner = self.leaves + np.flatnonzero(self.children[:, 0] >= 0)
            heights = self.height[inner]
            order = np.argsort(heights, kind='stable')
            edges = np.flatnonzero(np.diff(heights[order])) + 1
            rows = np.split(inner[order], edges) if len(inner) else []
            self._levels = [(r, *self.children[r - self.leaves].T) for r in rows]
        return self._levels

    def gather(self, values, join) -> np.ndarray:
        """Return values of all nodes from those of the boxes."""
        out = np.zeros((len(self), *values.shape[1:]), values.dtype)
        out[: self.leaves] = values
        for rows, first, second in self.levels:
            out[rows] = join(out[first], out[second])
        return out

    def cheapest(self, cost, here) -> np.ndarray:
        """Return the nodes that cover all boxes at minimum cost."""
        least = np.where(here, cost, 0.0)
        whole = np.ones(len(self), bool)
        for rows, first, second in self.levels:
            parts = least[first] + least[second]
            whole[rows] = least[rows] <= parts
            least[rows] = np.minimum(least[rows], parts)
        wanted = np.full(len(self), not self.hierarchical)
        if self.root >= 0:
            wanted[self.root] = True
        for rows, first, second in reversed(self.levels):
            opened = wanted[rows] & ~whole[rows]
            wanted[first[opened]] = wanted[second[opened]] = True
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
