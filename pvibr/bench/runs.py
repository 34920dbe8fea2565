"""What every bench does: measure its parts, print a table, write it as JSON, draw a plot."""

from __future__ import annotations

import time

from rich.console import Console

from pvibr.bench.rows import Results
from pvibr.capture.offscreen import Stage


def run(name, parts, settings, draw, out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows."""
    with Stage((64, 64)) as stage:
        results = Results(stage.driver(), {'quick': quick, **vars(settings)})
    console = Console(stderr=True)
    for part, measure in parts.items():
        start = time.perf_counter()
        measure(settings, results)
        console.print(f'{part}: {time.perf_counter() - start:.0f} s')
    out.mkdir(parents=True, exist_ok=True)
    (out / f'bench_{name}.json').write_text(results.to_json() + '\n', encoding='utf-8')
    draw(results, out / f'bench_{name}.png')
    Console().print(results.table())
    return results.rows
