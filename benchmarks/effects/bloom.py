"""What a bloom costs in full-screen copies, and how near it comes to a true Gaussian."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv
from scipy.ndimage import gaussian_filter

from benchmarks.common.harness import Row
from benchmarks.common.timing import seconds
from benchmarks.common.whole_frames import real_plotter, turning
from benchmarks.effects.copies import HalfFloatCopy, Stand, in_copies
from pvibr.effects.bloom import Bloom
from pvibr.gl.hidden_window import hidden_window

#: What is measured against a true Gaussian, each by itself.
SETTINGS: tuple[dict, ...] = (
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
_THRESHOLD = 0.8  # some of the picture is brighter
_FROM_OUTSIDE = {0: 3.0, 8: None}  # samples asked for, PyVista's default last; bars in copies
_BLUR_ALONE = {'threshold': 0.0, 'operator': 'keep', 'spread': 1.0, 'debug': 'blur'}


def measure(settings, results):
    """Yield the time of a bloom and of its stages, and its errors."""
    size, rounds = settings.screen, settings.rounds
    with hidden_window() as (window, _):
        stand = Stand(window, _squares(size))
        bloom, dark = _Staged(_THRESHOLD), Bloom(2.0)
        whole = {'bloom': partial(bloom.render, stand, stand)}
        whole['dark'] = partial(dark.render, stand, stand)
        times, copy_ms = in_copies(stand, whole, rounds)
        stages, _ = in_copies(stand, bloom.stages(stand), rounds)
        for effect in (bloom, dark):
            effect.release()
        stand.release()
    yield Row('one full-screen copy', copy_ms, 'ms')
    yield Row('bloom over a copy', times['bloom'], 'x', 2.5)
    yield Row('bloom where nothing is bright, over a copy', times['dark'], 'x', 0.3)
    results.points['copies'] = {'Bloom': times['bloom']}
    for name, copies in stages.items():
        yield Row(f'bloom: {name}, over a copy', copies, 'x')
    yield from _errors(size, rounds, results)
    for samples, bar in _FROM_OUTSIDE.items():
        name = f'frame with bloom over one without, 30 lit spheres, {samples} samples asked for'
        yield Row(name, _added_copies(size, settings.pairs, samples), 'copies', bar)


def _added_copies(size, pairs, samples) -> float:
    """Return what bloom adds to a frame as users time it, on and off in turn, in copies."""
    plotter = _lit_spheres(size, samples)
    bloom = plotter.ibr.add(Bloom())
    plotter.show(auto_close=False)
    window, draw = plotter.render_window, turning(plotter)
    copy = HalfFloatCopy(window, size)
    times: dict[str, list[float]] = {'with': [], 'without': [], 'copy': []}
    for k in range(-2, pairs):
        for name, spent in times.items():
            bloom.enabled = name == 'with'
            job = copy.draw if name == 'copy' else partial(draw, k)
            elapsed = seconds(window, job)
            if k >= 0:  # the first two upload and compile
                spent.append(elapsed)
    copy.release()
    plotter.close()
    added = np.subtract(times['with'], times['without'])
    return float(np.median(added) / np.median(times['copy']))


def _lit_spheres(size, samples) -> pv.Plotter:
    """Return a plotter of shiny spheres in the lights that PyVista puts there."""
    plotter, rng = real_plotter(size), np.random.default_rng(0)
    for center in rng.uniform(-2, 2, (30, 3)):
        sphere = pv.Sphere(radius=0.4, center=center)
        color = rng.uniform(0.3, 1, 3)
        plotter.add_mesh(sphere, color=color, specular=1.0, smooth_shading=True)
    plotter.render_window.SetMultiSamples(samples)
    return plotter


class _Staged(Bloom):
    """A bloom whose stages can be drawn one by one."""

    def stages(self, stand) -> dict:
        """Return what draws each stage of a picture that the bloom was drawn on."""
        self.render(stand, stand)
        side = self._texel_size
        blur = self._ready_blur(stand, stand.size, side)
        return {
            'bright pass': partial(self._draw_source, stand, stand, blur.source, side),
            'is there light': blur.lit,
            'blur': partial(blur.draw, blur.source.colors[0], self.spread),
            'blend': partial(blur.blend, stand, self._light),
        }


def _errors(size, rounds, results):
    """Compare the widest blur alone with the Gaussian of its width, and time the bloom."""
    picture = natural(size)
    found = results.points['bloom'] = []
    with hidden_window() as (window, _):
        timed, seen = Stand(window, _squares(size)), Stand(window, picture)
        blooms = [Bloom(_THRESHOLD, **one) for one in SETTINGS]
        jobs = {i: partial(b.render, timed, timed) for i, b in enumerate(blooms)}
        copies, _ = in_copies(timed, jobs, rounds)
        for i, (one, bloom) in enumerate(zip(SETTINGS, blooms, strict=True)):
            for name, value in _BLUR_ALONE.items():
                setattr(bloom, name, value)
            bloom.render(seen, seen)
            shown = seen.target.colors[0].download()[..., 0]
            sigma = bloom.blur_sigma
            true = gaussian_filter(picture[..., 0].astype(float), sigma, mode='reflect')
            name = ', '.join(f'{k} {v}' for k, v in one.items()) or 'as it comes'
            error = 255 * float(np.abs(shown - true).mean())
            found.append({'name': name, 'sigma': sigma, 'error': error, 'copies': copies[i]})
            name = f'bloom, {name}: mean error against a Gaussian of {sigma:.0f} px'
            yield Row(name, error, '/255', 0.5)
        for bloom in blooms:
            bloom.release()
        for stand in (timed, seen):
            stand.release()


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
