"""Instances in frames that may be less good."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.instances.card_layers import PATCHES
from pvibr.instances.limits import Limits, forced_limits

CAMERA = {'eye': (0.0, -7.0, 2.5), 'focus': (0.0, 0.0, 0.0)}
SPANS = {
    name: np.repeat([[low], [high]], PATCHES, 1)
    for name, low, high in (
        ('splat', 0.0, 4.0),
        ('flat', 4.0, 30.0),
        ('parallax', 30.0, 30.0),
        ('blended', 30.0, 90.0),
    )
}
MESHES = np.repeat([[np.inf], [200.0]], PATCHES, 1)
LIMITS = Limits(SPANS, np.full(PATCHES, 90.0), MESHES, SPANS)


class Level:
    """A pace that says what quality is."""

    def __init__(self, quality=1.0):
        self.level, self.why = quality, ''

    def quality(self, renderer):
        return self.level

    @property
    def latest(self):
        return self.level


def test_full_quality_is_what_it_was():
    full = LIMITS.coarser(1.0)
    assert all((full.cards[name] == SPANS[name]).all() for name in SPANS)
    assert (full.mesh_to == MESHES).all()


def test_forced_sizes_begin_where_they_are_said_to():
    limits = forced_limits({'flat': (50.0, 100.0), 'fine': (20.0, 50.0)}, 2)
    for quality in (1.0, 0.5):
        spans = limits.coarser(quality).cards
        assert (quality * spans['flat'].T == [50, 100]).all()
        assert (quality * spans['fine'].T == [20, 50]).all()


@pytest.mark.parametrize('low', [0.0, 1e3])
def test_nothing_is_drawn_below_the_sizes_of_a_forced_level(scenes, see, bean, low):
    pl, things = scenes.instances(bean, [[0, 0, 0]], size=(60, 40), camera=CAMERA)
    things.force_level = {'flat': (low, 1e4)}
    assert (np.ptp(see.grab(pl)) > 0.1) == (low == 0)
    assert things.explain(0).level == ('' if low else 'flat')


@given(st.floats(1 / 16, 1))
def test_less_quality_is_no_finer_at_any_size(quality):
    coarser = LIMITS.coarser(quality)
    for spans in (coarser.cards, coarser.side_cards):
        assert all((spans[name][1] >= SPANS[name][1]).all() for name in SPANS)
        assert all((a[1] == b[0]).all() for a, b in pairwise(spans.values()))  # no gap
        assert (spans['splat'] == SPANS['splat']).all()  # boxes of one colour stay small
        assert (spans['blended'][1] == coarser.mesh_from).all()
    np.testing.assert_allclose(coarser.mesh_to, MESHES / quality)


def test_less_quality_draws_fewer_meshes_and_full_quality_every_bit(scenes, see, bean):
    grid = np.meshgrid(np.arange(6), np.arange(6))
    poses = np.stack([*grid, np.zeros((6, 6))], -1).reshape(-1, 3) * 1.7 - [4.2, 4.2, 0]
    pl, things = scenes.instances(bean, poses, size=(600, 450), camera=CAMERA)
    pace = pl.ibr.pipeline._adaptive_quality = Level()
    full, before = see.grab(pl), meshes(things)
    pace.level = 0.25
    less, fewer = see.grab(pl), meshes(things)
    assert 0 <= fewer < before
    assert 1e-5 < np.abs(less - full).mean() < 0.02
    pace.level = 1.0
    np.testing.assert_array_equal(see.grab(pl), full)
    assert meshes(things) == before


def meshes(things):
    return sum(count for name, count in things.report().items() if name.startswith('mesh '))
