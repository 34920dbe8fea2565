"""Say what a run of a bench shows to be slower or less accurate than an earlier one.

``python -m benchmarks.common.comparison FOLDER`` compares the errors of the quick runs in a folder
with those in ``quick_errors.json``; ``--keep`` keeps them there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from pvibr.cli.timing import CLOCKS

_KEPT = Path(__file__).with_name('quick_errors.json')
#: Units of rows that depend on the machine, or on what else it did.
_TIME_UNITS = {'s', 'ms', 'x', 'copies', 'GB'}
#: Changes of times that runs of the same code show on one machine, and of errors on several.
_NOISE, _ROUNDING = 1.05, 1.1
_CONFIDENCE, _RESAMPLES = 0.99, 2_000


@dataclass(frozen=True)
class Change:
    """How many times worse something is than in an earlier run, and the limits of that."""

    name: str
    times_worse: float
    low: float
    high: float
    allowed: float

    @property
    def verdict(self) -> str:
        """Whether it is worse, better or the same beyond what is allowed."""
        if self.low > self.allowed:
            return 'worse'
        return 'better' if self.high < 1 / self.allowed else 'same'


def compare(old: dict, new: dict) -> list[Change]:
    """Return the changes of all frames and errors that two runs of a bench have in common."""
    for setting in new.keys() - {'rows', 'points', 'whole_frames'}:
        if old.get(setting) != new[setting]:
            raise ValueError(
                f'compare must be a run with {setting}={new[setting]!r}, got {old.get(setting)!r}'
            )
    return [*_frames(old, new), *_errors(old, new)]


def _frames(old, new) -> Iterator[Change]:
    """Yield changes of frames, each measured in ratios to a peer that took turns with it."""
    for scene, by_samples in new['whole_frames'].items():
        for samples, times in by_samples.items():
            before = old['whole_frames'].get(scene, {}).get(samples)
            if before is None:
                continue
            ratios = [np.log(np.divide(t['with'], t['without'])) for t in (before, times)]
            for k, clock in enumerate(CLOCKS):
                name = f'{scene}, {samples} samples, {clock}'
                yield _frame_change(name, ratios[0][:, k], ratios[1][:, k])


def _frame_change(name, old_ratios, new_ratios) -> Change:
    """Return the change of a median of log ratios, with its limits by resampling."""
    rng = np.random.default_rng(0)
    old_medians, new_medians = (
        np.median(rng.choice(ratios, (_RESAMPLES, len(ratios))), axis=1)
        for ratios in (old_ratios, new_ratios)
    )
    limits = np.quantile(new_medians - old_medians, [1 - _CONFIDENCE, _CONFIDENCE])
    value = np.median(new_ratios) - np.median(old_ratios)
    times_worse, low, high = np.exp([value, *limits]).tolist()
    return Change(name, times_worse, low, high, _NOISE)


def _errors(old, new) -> Iterator[Change]:
    """Yield changes of rows that depend on no times, and whose bar says which way is worse."""
    before = {row['name']: row['value'] for row in old['rows']}
    for row in new['rows']:
        if not _is_error(row) or row['name'] not in before:
            continue
        values = before[row['name']], row['value']
        old_value, new_value = reversed(values) if row['at_least'] else values
        floor = 1e-3 * abs(row['bar'])  # of less than that nothing can be said
        times_worse = (max(new_value, 0) + floor) / (max(old_value, 0) + floor)
        yield Change(row['name'], times_worse, times_worse, times_worse, _ROUNDING)


def _is_error(row) -> bool:
    """Whether a row depends on no time, and its bar says which way is worse."""
    is_timed = row['unit'] in _TIME_UNITS or row.get('follows_times')  # of older runs, none says
    return not is_timed and row['bar'] is not None


def table(changes: list[Change]) -> Table:
    """Return a table of what has changed, the worst first."""
    shown = Table('what', 'times as much', f'{_CONFIDENCE:.0%} limits', '', title='Compared')
    for change in sorted(changes, key=lambda c: -c.times_worse):
        if change.verdict != 'same':
            limits = f'{change.low:.3g} to {change.high:.3g}'
            shown.add_row(change.name, f'{change.times_worse:.3g}', limits, change.verdict)
    same = sum(change.verdict == 'same' for change in changes)
    shown.caption = f'{same} of {len(changes)} the same within the noise'
    return shown


def is_no_worse(old: dict, new: dict) -> bool:
    """Print what has changed since an earlier run; return False if anything is worse."""
    return _told(compare(old, new))


def _told(changes) -> bool:
    Console().print(table(changes))
    return all(change.verdict != 'worse' for change in changes)


def read_run(path: Path) -> dict:
    """Return an earlier run from its file."""
    try:
        run = json.loads(Path(path).read_text(encoding='utf-8'))
        run['rows'], run['whole_frames']
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f'compare must be a file that a bench has written, got {path}') from error
    return run


def main(folder: Path, *, keep=False) -> bool:
    """Compare the errors of all quick runs in a folder with those kept, or keep them."""
    runs = {path.stem: read_run(path) for path in sorted(folder.glob('bench_*.json'))}
    if keep:
        kept = {name: [r for r in run['rows'] if _is_error(r)] for name, run in runs.items()}
        _KEPT.write_text(json.dumps(kept, indent=1) + '\n', encoding='utf-8')
        return True
    kept = json.loads(_KEPT.read_text(encoding='utf-8'))
    pairs = ((kept.get(name, []), run) for name, run in runs.items())
    return _told([change for rows, run in pairs for change in _errors({'rows': rows}, run)])


if __name__ == '__main__':
    sys.exit(not main(Path(sys.argv[1]), keep='--keep' in sys.argv))
