"""A bounding volume hierarchy over objects that may share an image."""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import may_see_boxes
from pvibr.substitutes.impostor_maths import Card, displacement, fit_cards


class Tree:
    """A binary tree over a changing set of boxes.

    Nodes below `leaves` are boxes, the others join two; node numbers are stable. Catto, "Dynamic
    Bounding Volume Hierarchies", GDC 2019.
    """

    def __init__(self, centers, hierarchical, present=None):
        self.leaves = box_count = len(centers)
        self.hierarchical = bool(hierarchical)
        inner_count = max(box_count - 1, 0) if hierarchical else 0
        self.children = np.full((inner_count, 2), -1)
        self.parent = np.full(box_count + inner_count, -1)
        self.height = np.zeros(box_count + inner_count, int)
        self.root = -1  # if empty or flat
        self._levels: list | None = None
        box_ids = np.arange(box_count) if present is None else np.asarray(present, int)
        if hierarchical and len(box_ids):
            self._split(np.asarray(centers, float), box_ids)

    def __len__(self):
        return self.leaves + len(self.children)

    def _split(self, centers, box_ids):
        """Split top-down at the median along the longest side."""
        next_node = self.leaves
        self.root = next_node if len(box_ids) > 1 else int(box_ids[0])
        stack: list = [(box_ids, -1, 0)]
        while stack:
            box_ids, parent, side = stack.pop()
            node = int(box_ids[0])
            if len(box_ids) > 1:
                node, next_node = next_node, next_node + 1
                axis = np.ptp(centers[box_ids], axis=0).argmax()
                sorted_ids = box_ids[np.argsort(centers[box_ids, axis], kind='stable')]
                cut = (len(sorted_ids) + 1) // 2
                stack += [(sorted_ids[cut:], node, 1), (sorted_ids[:cut], node, 0)]
                self.height[node] = (len(box_ids) - 1).bit_length()
            self.parent[node] = parent
            if parent >= 0:
                self.children[parent - self.leaves, side] = node

    # -- insertion and removal -------------------------------------------------------------------

    def grow(self, extra):
        """Make room for more boxes, which shifts the numbers of inner nodes."""
        old_count, extra_inner = self.leaves, extra if self.hierarchical else 0
        self.parent = np.insert(self.parent, old_count, np.full(extra, -1))
        self.height = np.insert(self.height, old_count, np.zeros(extra, int))
        for array in (self.parent, self.children):
            array[array >= old_count] += extra
        self.root += extra if self.root >= old_count else 0
        self.leaves += extra
        self.parent = np.append(self.parent, np.full(extra_inner, -1))
        self.height = np.append(self.height, np.zeros(extra_inner, int))
        self.children = np.append(self.children, np.full((extra_inner, 2), -1), axis=0)
        self._levels = None

    def has(self, leaf) -> bool:
        """Return True if a box is in the tree."""
        return not self.hierarchical or leaf == self.root or self.parent[leaf] >= 0

    def insert(self, leaf, low, high) -> list[int]:
        """Insert a box, given the corners of all nodes; return the nodes that changed."""
        if self.root < 0:
            self.root = leaf
            return [leaf]
        sibling = self._nearest(leaf, low, high)
        new_parent = self.leaves + int(np.flatnonzero(self.children[:, 0] < 0)[0])
        self._replace(sibling, new_parent)
        self._join(new_parent, sibling, leaf)
        return [leaf, *self._rebalance(new_parent, low, high)]

    def remove(self, leaf, low, high) -> list[int]:
        """Remove a box; return the nodes that changed."""
        if not self.hierarchical or not self.has(leaf):
            return [leaf]
        old_parent = int(self.parent[leaf])
        if old_parent < 0:
            self.root = -1
            return [leaf]
        pair = self.children[old_parent - self.leaves]
        sibling, grand_parent = int(pair[pair != leaf][0]), int(self.parent[old_parent])
        self._replace(old_parent, sibling)
        self.children[old_parent - self.leaves] = self.parent[[leaf, old_parent]] = -1
        return [leaf, old_parent, *self._rebalance(grand_parent, low, high)]

    def _nearest(self, leaf, low, high) -> int:
        """Return the best sibling of a box: the one whose union with it grows least."""
        node = self.root
        while node >= self.leaves:
            pair = self.children[node - self.leaves]
            joined_sides = np.maximum(high[pair], high[leaf]) - np.minimum(low[pair], low[leaf])
            node = int(pair[np.argmin((joined_sides - (high - low)[pair]).sum(1))])
        return node

    def _replace(self, old_node, new_node):
        parent = self.parent[new_node] = self.parent[old_node]
        if parent < 0:
            self.root = new_node
        else:
            pair = self.children[parent - self.leaves]
            pair[pair == old_node] = new_node

    def _join(self, node, *pair):
        self.children[node - self.leaves] = pair
        self.parent[list(pair)] = node

    def _rebalance(self, node, low, high) -> list[int]:
        """Balance and refit a node and its ancestors; return the changed nodes."""
        changed_nodes = []
        self._levels = None
        while node >= 0:
            changed_nodes += [*self._balance(node, low, high), node]
            self._fit(node, low, high)
            node = int(self.parent[node])
        return changed_nodes

    def _balance(self, node, low, high) -> list[int]:
        """Rotate a grandchild up if the heights of the children differ by two or more."""
        low_child, high_child = self._by_height(node)
        if self.height[high_child] - self.height[low_child] < 2:
            return []
        low_grandchild, high_grandchild = self._by_height(high_child)
        self._join(high_child, low_child, low_grandchild)
        self._join(node, high_grandchild, high_child)
        self._fit(high_child, low, high)
        return [high_child]

    def _by_height(self, node) -> list[int]:
        return sorted(self.children[node - self.leaves].tolist(), key=lambda k: self.height[k])

    def _fit(self, node, low, high):
        pair = self.children[node - self.leaves]
        self.height[node] = self.height[pair].max() + 1
        low[node], high[node] = low[pair].min(0), high[pair].max(0)

    # -- queries ---------------------------------------------------------------------------------

    @property
    def levels(self) -> list:
        """Inner nodes with their children, bottom-up by height."""
        if self._levels is None:
            inner_nodes = self.leaves + np.flatnonzero(self.children[:, 0] >= 0)
            heights = self.height[inner_nodes]
            order = np.argsort(heights, kind='stable')
            edges = np.flatnonzero(np.diff(heights[order])) + 1
            nodes_by_level = np.split(inner_nodes[order], edges) if len(inner_nodes) else []
            self._levels = [(r, *self.children[r - self.leaves].T) for r in nodes_by_level]
        return self._levels

    def gather(self, box_values, join) -> np.ndarray:
        """Reduce values of the boxes up the tree; return those of all nodes."""
        node_values = np.zeros((len(self), *box_values.shape[1:]), box_values.dtype)
        node_values[: self.leaves] = box_values
        for parents, left_child, right_child in self.levels:
            node_values[parents] = join(node_values[left_child], node_values[right_child])
        return node_values

    def cheapest(self, cost, in_view) -> np.ndarray:
        """Return the nodes that cover all boxes in view at minimum cost."""
        best_cost = np.where(in_view, cost, 0.0)
        keep_whole = np.ones(len(self), bool)
        for parents, left_child, right_child in self.levels:
            split_cost = best_cost[left_child] + best_cost[right_child]
            keep_whole[parents] = best_cost[parents] <= split_cost
            best_cost[parents] = np.minimum(best_cost[parents], split_cost)
        in_cut = np.full(len(self), not self.hierarchical)
        if self.root >= 0:
            in_cut[self.root] = True
        for parents, left_child, right_child in reversed(self.levels):
            is_split = in_cut[parents] & ~keep_whole[parents]
            in_cut[left_child[is_split]] = in_cut[right_child[is_split]] = True
            in_cut[parents[is_split]] = False
        return np.flatnonzero(in_cut & in_view)

    def below(self, node) -> list[int]:
        """Return the boxes under a node."""
        box_ids, stack = [], [int(node)]
        while stack:
            node = stack.pop()
            if node < self.leaves:
                box_ids.append(node)
            else:
                stack += self.children[node - self.leaves].tolist()
        return box_ids

    def above(self, nodes) -> np.ndarray:
        """Return nodes and their ancestors."""
        node_ids = set(np.asarray(nodes, int).tolist())
        for node in list(node_ids):
            node = self.parent[node]
            while node >= 0 and node not in node_ids:
                node_ids.add(int(node))
                node = self.parent[node]
        return np.array(sorted(node_ids), int)


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
        live = leaves.live
        low = np.where(live[:, None], leaves.center - leaves.reach, np.inf)
        high = np.where(live[:, None], leaves.center + leaves.reach, -np.inf)
        low, high = gather(low, np.minimum), gather(high, np.maximum)
        self.live = gather(live, np.logical_or)
        self.moving = gather(leaves.sections.moving & live, np.logical_or)
        self.stroke_px = gather(leaves.stroke_px * live, np.maximum)
        self.is_clear = gather((leaves.opacity < 1) & live, np.logical_or)
        # Translucent surfaces have images of their own.
        self.is_mixed = self.is_clear & (np.arange(len(self)) >= len(leaves))
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

    def seen(self, eyes):
        """Return which nodes are in view, and which of them an image may show from there."""
        near_end, far_end = self.span(eyes)
        view = eyes.frame.view
        in_view = self.live & may_see_boxes(view, self.low, self.high) & (far_end > view.near)
        is_far = (eyes.away(self.center) > NEAREST * self.radius) | eyes.parallel
        # A mesh cut by the near plane shows its inside, which no image has.
        return in_view, is_far & (near_end >= view.near) & ~self.moving & ~self.is_mixed

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

    def cards(self, nodes, eyes, eye_step, allowed_error) -> Card:
        """Return cards for new images, as far ahead of the camera as the error allows."""
        is_leaf = nodes < len(self.leaves)
        index_groups = [np.flatnonzero(is_leaf), *np.flatnonzero(~is_leaf)[:, None]]
        cards = []
        for indices in index_groups if is_leaf.any() else index_groups[1:]:
            group_nodes = nodes[indices]
            corners = self.corners(group_nodes[0])[None]
            if indices is index_groups[0]:
                corners = self.leaves.corners[group_nodes]
            limit = allowed_error[indices]
            cards.append(self._cards_within(group_nodes, corners, eyes, eye_step, limit))
        joined = Card(*(np.concatenate(field) for field in zip(*cards, strict=True)))
        return joined.rows(np.argsort(np.concatenate(index_groups)))

    def _cards_within(self, nodes, corners, eyes, eye_step, allowed_error):
        center, radius = self.center[nodes], self.radius[nodes]
        hull = center, corners, radius
        now = fit_cards(*hull, eyes.eye, eyes.up, eyes.toward)
        if eyes.parallel or not eye_step.any():
            return now
        limit = allowed_error / eyes.pixels(now.center, now.depth)
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
