"""Image effects: what each costs of a frame, and how far it is from its reference."""

from __future__ import annotations

from dataclasses import dataclass

from pvibr.bench import (
    effects_bloom,
    effects_depth_of_field,
    effects_outline,
    effects_screen,
    effects_together,
)
from pvibr.bench.plot import plot_effects
from pvibr.bench.rows import Row
from pvibr.bench.runs import run


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    screen: tuple[int, int] = (1280, 720)
    rounds: int = 9
    lens: tuple[int, int] = (640, 480)
    radii: tuple[float, ...] = (0.1, 0.2)
    samples: tuple[int, ...] = (16, 48, 128)
    lenses: int = 256


QUICK = Settings((320, 180), 1, (160, 120), (0.1,), (16,), 16)


def measure(out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    parts = {
        'bloom': _bloom,
        'screen': _screen,
        'outline': _outline,
        'depth of field': _lens,
        'together': _together,
    }
    return run('effects', parts, QUICK if quick else Settings(), plot_effects, out, quick=quick)


def _bloom(settings, results):
    times = effects_bloom.bloom_times(settings.screen, settings.rounds)
    results.rows += [
        Row('one full-screen copy', times['copy_ms'], 'ms'),
        Row('bloom over a copy', times['bloom'], 'x', 2.5),
        Row('bloom where nothing is bright, over a copy', times['dark'], 'x', 0.3),
    ]
    results.points['copies'] = {'Bloom': times['bloom']}
    for name, copies in effects_bloom.bloom_stages(settings.screen, settings.rounds).items():
        results.rows.append(Row(f'bloom: {name}, over a copy', copies, 'x'))
    points = effects_bloom.bloom_errors(settings.screen, settings.rounds)
    for point in points:
        name = f'bloom, {point["name"]}: mean error against a Gaussian of {point["sigma"]:.0f} px'
        results.rows.append(Row(name, point['error'], '/255', 0.5))
    results.points['bloom'] = points


def _screen(settings, results):
    times = effects_screen.screen_times(settings.screen, settings.rounds)
    del times['copy_ms']
    results.rows += [Row(f'{name} over a copy', copies, 'x') for name, copies in times.items()]
    results.points['copies'] |= times


def _outline(settings, results):
    results.rows += effects_outline.silhouettes(settings.screen)
    points = effects_outline.settings(settings.screen, settings.rounds)
    for point in points:
        results.rows.append(Row(f'outline, {point["name"]}, over a copy', point['copies'], 'x'))
    results.points['outline'] = points


def _lens(settings, results):
    """Add the lens's error; the bar is for the most looks."""
    sizes = settings.radii, settings.samples, settings.lenses
    found = effects_depth_of_field.measure(settings.lens, *sizes)
    most = max(settings.samples)
    for point in found:
        name = f'depth of field, radius {point["radius"]:g}, {point["samples"]} samples'
        bar = 32 if point['samples'] == most else None
        results.rows.append(Row(f'{name}: PSNR', point['psnr'], 'dB', bar, at_least=True))
        results.rows.append(Row(f'{name}: time', point['ms'], 'ms'))
    results.points['lens'] = found


def _together(settings, results):
    results.rows += effects_together.together(settings.screen, settings.rounds)
    results.rows += effects_together.python()
    stages = effects_together.stages(settings.screen, settings.rounds)
    results.rows += [Row(f'stage of all together: {n}', ms, 'ms') for n, ms in stages.items()]
