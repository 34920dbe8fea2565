"""Every box is under the root once, and the cheapest cover covers each once."""

import numpy as np
import pytest

from pvibr.substitutes.impostor_tree import Tree


@pytest.mark.parametrize('n', [1, 2, 3, 7, 100])
def test_every_box_is_below_the_root_once(n):
    tree = Tree(np.random.default_rng(n).normal(size=(n, 3)), True)
    assert len(tree) == 2 * n - 1
    assert sorted(tree.below(tree.root)) == list(range(n))
    total = tree.gather(np.ones(n), np.add)
    assert total[tree.root] == n
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

    assert cost[cut].sum() == pytest.approx(least(tree.root))


def test_without_a_hierarchy_there_are_boxes_only():
    tree = Tree(np.zeros((4, 3)), False)
    assert tree.cheapest(np.ones(4), np.array([True, False, True, True])).tolist() == [0, 2, 3]


def test_above_are_all_ancestors():
    tree = Tree(np.random.default_rng(0).normal(size=(16, 3)), True)
    for k in tree.above([3]):
        assert 3 in tree.below(k)
    assert len(tree.above([3])) == 5


def depth(tree, node):
    return 0 if node < tree.leaves else 1 + max(depth(tree, k) for k in pair(tree, node))


def pair(tree, node):
    return tree.children[node - tree.leaves].tolist()


@pytest.mark.parametrize('order', ['random', 'sorted', 'one place'])
def test_boxes_that_come_and_go_leave_a_low_tree_of_them_all(order):
    rng = np.random.default_rng(7)
    centers = {
        'random': rng.normal(size=(200, 3)),
        'sorted': np.arange(200.0)[:, None] * [1, 0.1, 0],
        'one place': np.ones((200, 3)),
    }[order]
    tree, known = Tree(centers[:3], True), {0, 1, 2}
    tree.grow(197)
    low = np.concatenate([centers - 0.1, np.zeros((len(tree) - 200, 3))])
    high = low + 0.2
    for rows, *_ in tree.levels:
        for node in rows:
            below = tree.below(node)
            low[node], high[node] = low[below].min(0), high[below].max(0)
    for step in range(400):
        before = {k: set(tree.below(k)) for k in range(200, len(tree)) if pair(tree, k)[0] >= 0}
        leaf = step if step in range(3, 200) else int(rng.integers(200))
        act = tree.remove if leaf in known else tree.insert
        changed = act(leaf, low, high)
        known ^= {leaf}
        assert tree.has(leaf) == (leaf in known)
        assert set(tree.below(tree.root)) == known
        for node in [k for k in range(200, len(tree)) if pair(tree, k)[0] >= 0]:
            below = tree.below(node)
            assert node in changed or set(below) == before[node]
            assert all(tree.parent[k] == node for k in pair(tree, node))
            if step % 20 == 0:
                assert np.array_equal(low[node], low[below].min(0))
                assert np.array_equal(high[node], high[below].max(0))
        total = tree.gather(np.isin(np.arange(200), list(known)) * 1, np.add)
        assert total[tree.root] == len(known)
        assert depth(tree, tree.root) <= 1.45 * np.log2(len(known) + 2)


def test_the_last_box_goes_and_another_comes():
    tree = Tree(np.zeros((1, 3)), True)
    low = high = np.zeros((1, 3))
    tree.remove(0, low, high)
    assert not tree.has(0)
    assert tree.cheapest(np.ones(1), np.zeros(1, bool)).tolist() == []
    tree.insert(0, low, high)
    assert tree.cheapest(np.ones(1), np.ones(1, bool)).tolist() == [0]
