"""Tiles never overlap, and what is given back can be taken as one again."""

import numpy as np

from pvibr.substitutes.impostor_images import Tiles


def test_tiles_never_overlap_and_come_together_again():
    rng = np.random.default_rng(3)
    tiles, taken = Tiles(256), {}
    cover = np.zeros((256, 256), int)
    for _ in range(2000):
        if taken and rng.random() < 0.45:
            corner = list(taken)[rng.integers(len(taken))]
            side = taken.pop(corner)
            tiles.give(corner, side)
            cover[corner[0] : corner[0] + side, corner[1] : corner[1] + side] -= 1
        else:
            side = int(2 ** rng.integers(3, 7))
            corner = tiles.take(side)
            if corner is not None:
                assert corner not in taken
                taken[corner] = side
                cover[corner[0] : corner[0] + side, corner[1] : corner[1] + side] += 1
        assert cover.max() <= 1
    for corner, side in taken.items():
        tiles.give(corner, side)
    assert tiles.take(256) == (0, 0)
    assert tiles.take(8) is None


def test_sides_are_powers_of_two():
    tiles = Tiles(256)
    assert [tiles.fits(n) for n in (1, 8, 9, 64, 65)] == [8, 8, 16, 64, 128]
