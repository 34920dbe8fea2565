"""What a bloom costs in full-screen copies."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pvibr.bench.copies import Stand, in_copies
from pvibr.effects.bloom import Bloom
from pvibr.gl.offscreen import hidden_window


def bloom_times(size=(1280, 720), rounds=15, **settings) -> dict:
    """Time a bloom, one that finds nothing bright, and a copy of the picture, in turns.

    Parameters
    ----------
    size : tuple of 2 int
        Width and height in pixels.
    rounds : int
        How often; the least of each counts.
    **settings
        Of the bloom.

    Returns
    -------
    dict
        ``copy_ms``, and ``bloom`` and ``dark``, as multiples of the copy.
    """
    rng = np.random.default_rng(0)
    array = np.kron(rng.uniform(0, 255, (-(-size[1] // 20), -(-size[0] // 20), 4)),
                    np.ones((20, 20, 1)))[: size[1], : size[0]]  # fmt: skip
    array[..., 3] = 255
    with hidden_window() as (window, _):
        stand = Stand(window, array.astype(np.uint8))
        blooms = {'bloom': Bloom(**settings), 'dark': Bloom(**(settings | {'threshold': 2.0}))}
        jobs = {n: partial(b.render, stand, stand) for n, b in blooms.items()}
        found = in_copies(stand, jobs, rounds)
        owners: list[Any] = [stand, *blooms.values()]
        for owner in owners:
            owner.release()
    return found
