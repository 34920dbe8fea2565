"""What every bench does: measure its parts, print a table, write it as JSON, draw a plot."""

from __future__ import annotations

import time

from rich.console import Console

from pvibr.bench.rows import Results
from pvibr.offscreen import Stage


def run(name, parts, settings, draw, out, *, quick=False) -> list:
    """Run every part, print and write the table and the plot, and return the rows.

    Parameters
    ----------
    name : str
        Of the bench, as in ``bench_NAME.json``.
    parts : dict of str to callable
        By name, each taking settings and results.
    settings : object
        How much is measured; its attributes are written, too.
    draw : callable
        Takes results and a path, and writes a plot there.
    out : pathlib.Path
        Folder.
    quick : bool, optional
        Whether only a few points are measured; this is written, too.

    Returns
    -------
    list of Row
        What was measured.
    """
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
