"""Measure run time against error, on the spot; each number beside its bar."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

#: What can be measured, and what its command says of itself.
BENCHES = {
    'instances': "Measure instances: each point is one setting, VTK's own ways on the same axes.",
    'shadows': 'Measure shadows against rays: each point is one setting, '
    "VTK's own pass on the same axes.",
    'projection': 'Measure projected pictures against rays and against the photographs.',
    'effects': 'Measure what image effects cost, and their error.',
    'figures': "Measure figures that move: against float64, numpy and VTK's own reader of glTF.",
    'impostors': 'Measure impostors on the fly against the meshes that they stand for.',
    'layers': 'Measure coherent layers against full rendering.',
    'billboards': 'Measure billboards, what cut-outs cover, and the levels of a plant.',
    'clouds': 'Measure billboard clouds: against k-means, '
    'and against fewer triangles of as many bytes.',
    'moving': "Measure frames of the demo's forest while it is dragged, "
    'and the full picture after it.',
}


def main(name, *, out=Path('out'), quick=False) -> list:
    """Measure, print a table, and write it as JSON with a plot beside it."""
    if name not in BENCHES:
        msg = f'name is {name!r}; it must be one of {", ".join(BENCHES)}.'
        raise ValueError(msg)
    bench = import_module(f'pvibr.bench.{name}')
    return bench.measure(Path(out), quick=quick)
