"""Measure run time against error, on the spot; each number beside its bar."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

NAMES = (
    'instances',
    'shadows',
    'projection',
    'effects',
    'figures',
    'billboards',
    'impostors',
    'layers',
    'clouds',
    'moving',
)


def main(name, *, out=Path('out'), quick=False) -> list:
    """Measure, print a table, and write it as JSON with a plot beside it.

    Parameters
    ----------
    name : str
        What is measured: one of ``NAMES``.
    out : pathlib.Path
        Folder for ``bench_NAME.json`` and ``bench_NAME.png``.
    quick : bool
        A few points only, to see that it runs; the bars are not meant for them.

    Returns
    -------
    list of pvibr.bench.rows.Row
        What was measured.

    Raises
    ------
    ValueError
        If there is no such bench.

    Examples
    --------
    >>> from pvibr.bench import main
    >>> main('instances', quick=True)  # doctest: +SKIP
    """
    if name not in NAMES:
        msg = f'name is {name!r}; it must be one of {", ".join(NAMES)}.'
        raise ValueError(msg)
    bench = import_module(f'pvibr.bench.{name}')
    return bench.measure(Path(out), quick=quick)
