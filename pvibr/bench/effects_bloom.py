"""What a bloom costs in full-screen copies, and how near it comes to a true Gaussian."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from pvibr.bench.copies import Stand, in_copies
from pvibr.effects.bloom import Bloom
from pvibr.gl.offscreen import hidden_window

#: What is measured against a true Gaussian, each by itself.
SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {'kernel': 3},
    {'kernel': 9},
    {'downsample': 4},
    {'downsample': 16},
    {'levels': 1},
    {'levels': 2},
    {'levels': 5},
    {'chain': 'tent'},
    {'chain': 'tent', 'downsample': 4},
    {'chain': 'tent', 'downsample': 16},
)


def bloom_times(size=(1280, 720), rounds=15, **settings) -> dict:
    """Time a bloom, one that finds nothing bright, and a copy of the picture, in turns."""
    with hidden_window() as (window, _):
        stand = Stand(window, _squares(size))
        blooms = {'bloom': Bloom(**settings), 'dark': Bloom(**(settings | {'threshold': 2.0}))}
        jobs = {n: partial(b.render, stand, stand) for n, b in blooms.items()}
        found = in_copies(stand, jobs, rounds)
        _release(stand, *blooms.values())
    return found


def bloom_stages(size=(1280, 720), rounds=15, **settings) -> dict:
    """Time the stages of a bloom."""
    with hidden_window() as (window, _):
        stand, bloom = Stand(window, _squares(size)), Bloom(**settings)
        bloom.render(stand, stand)
        side, light = bloom.downsample // 2, bloom._light
        blur = bloom._ready(stand, stand.size, side)
        source = blur.source.colors[0]
        jobs = {
            'bright pass': partial(bloom._draw_source, stand, stand, blur.source, side),
            'is there light': blur.lit,
            'blur': partial(blur.draw, source, bloom.spread),
            'blend': partial(blur.blend, stand, light),
        }
        found = in_copies(stand, jobs, rounds)
        _release(stand, bloom)
    del found['copy_ms']
    return found


def bloom_errors(size=(1280, 720), rounds=5, settings=SETTINGS) -> list[dict]:
    """Compare the widest blur alone with the Gaussian of its width, and time the bloom."""
    picture = natural(size)
    found = []
    with hidden_window() as (window, _):
        timed, seen = Stand(window, _squares(size)), Stand(window, picture)
        blooms = [Bloom(**one) for one in settings]
        jobs = {str(i): partial(b.render, timed, timed) for i, b in enumerate(blooms)}
        copies = in_copies(timed, jobs, rounds)
        for i, (one, bloom) in enumerate(zip(settings, blooms, strict=True)):
            for name in ('threshold', 'operator', 'spread', 'debug'):
                setattr(bloom, name, _BLUR_ALONE[name])
            bloom.render(seen, seen)
            shown = seen.target.colors[0].download()[..., 0]
            sigma = width_of(bloom)
            true = gaussian_filter(picture[..., 0].astype(float), sigma, mode='reflect')
            name = ', '.join(f'{k} {v}' for k, v in one.items()) or 'as it comes'
            error = 255 * float(np.abs(shown - true).mean())
            found.append({'name': name, 'sigma': sigma, 'error': error, 'copies': copies[str(i)]})
        _release(timed, seen, *blooms)
    return found


_BLUR_ALONE = {'threshold': 0.0, 'operator': 'keep', 'spread': 1.0, 'debug': 'blur'}


def width_of(bloom) -> float:
    """Return the standard deviation of a bloom's widest blur in pixels."""
    side = bloom.downsample // 2
    squares, between = (side**2 - 1) / 12, bloom.downsample**2 / 6
    return float(np.sqrt((side * bloom._blur.sigma) ** 2 + squares + between))


def natural(size, seed=0):
    """Return a picture whose spectrum falls with frequency as those of photographs do."""
    width, height = size
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(np.random.default_rng(seed).normal(size=(height, width)))
    grey = np.fft.irfft2(spectrum / frequency, (height, width))
    grey = 0.05 + 0.95 * (grey - grey.min()) / np.ptp(grey)
    return np.dstack([grey] * 3 + [np.ones_like(grey)]).astype(np.float32)


def _squares(size):
    width, height = size
    small = np.random.default_rng(0).uniform(0, 255, (-(-height // 20), -(-width // 20), 4))
    array = np.kron(small, np.ones((20, 20, 1)))[:height, :width]
    array[..., 3] = 255
    return array.astype(np.uint8)


def _release(*owners):
    for owner in owners:
        owner.release()
