"""Every box is under the root once, and the cheapest cover covers each once."""

from __future__ import annotations

import numpy as np
import pytest

from pvibr.impostors.tree import Tree


@pytest.mark.parametrize('n', [1, 2, 3, 7, 100])
def test_every_box_is_below_the_root_once(n):
    tree = Tree(np.random.default_rng(n).normal(size=(n, 3)), True)
    assert len(tree) == 2 * n - 1
    assert sorted(tree.below(len(tree) - 1)) == list(range(n))
    total = tree.gather(np.ones(n), np.add)
    assert total[-1] == n
    assert all(len(tree.below(k)) == total[k] for k in range(len(tree)))


@pytest.mark.parametrize('seed', range(5))
def test_the_cheapest_cover(seed):
    rng = np.random.default_rng(seed)
    tree = Tree(rng.normal(size=(40, 3)), True)
    cost = rng.random(len(tree)) * tree.gather(np.ones(40), np.add) ** 0.8
    leaves = rng.random(40) < 0.8
    here = tree.gather(leaves, np.logical_or)
    cut = tree.cheapest(cost, here)
    found = [i for node in cut for i in tree.below(node) if leaves[i]]
    assert sorted(found) == np.flatnonzero(leaves).tolist()

    def least(node):
        if not here[node]:
            return 0.0
        if node < 40:
            return cost[node]
        return min(cost[node], sum(least(k) for k in tree.children[node - 40]))

    assert cost[cut].sum() == pytest.approx(least(len(tree) - 1))


def test_without_a_hierarchy_there_are_boxes_only():
    tree = Tree(np.zeros((4, 3)), False)
    assert tree.cheapest(np.ones(4), np.array([True, False, True, True])).tolist() == [0, 2, 3]


def test_above_are_all_ancestors():
    tree = Tree(np.random.default_rng(0).normal(size=(16, 3)), True)
    for k in tree.above([3]):
        assert 3 in tree.below(k)
    assert len(tree.above([3])) == 5
