"""A bench declares what it measures; the harness runs, tabulates, plots and writes it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from types import SimpleNamespace

from rich.console import Console
from rich.table import Table

from benchmarks.common import whole_frames
from pvibr.scenes.stage import Stage


@dataclass(frozen=True)
class Row:
    """One number and its bar."""

    name: str
    value: float
    unit: str = ''
    bar: float | None = None
    at_least: bool = False
    #: Whether it depends on how long frames took, though it is no time.
    follows_times: bool = False

    def __post_init__(self):
        object.__setattr__(self, 'value', float(self.value))  # numpy's numbers are no JSON

    @property
    def ok(self) -> bool | None:
        """Whether the bar is passed; None without a bar."""
        if self.bar is None:
            return None
        return self.value >= self.bar if self.at_least else self.value <= self.bar

    @property
    def asked(self) -> str:
        """The bar as people read it."""
        return '' if self.bar is None else f'{">=" if self.at_least else "<="} {self.bar:g}'


@dataclass
class Results:
    """All rows of a bench, the settings that they were measured with, and the points of a plot."""

    driver: str
    settings: dict
    rows: list[Row] = field(default_factory=list)
    points: dict = field(default_factory=dict)
    whole_frames: dict = field(default_factory=dict)

    def to_json(self) -> str:
        """Return everything as JSON."""
        found = {
            'driver': self.driver,
            **self.settings,
            'rows': [asdict(row) | {'ok': row.ok} for row in self.rows],
            'points': self.points,
            'whole_frames': self.whole_frames,
        }
        return json.dumps(found, indent=1)

    def as_dict(self) -> dict:
        """Return everything as its file holds it: without tuples and numbers as keys."""
        return json.loads(self.to_json())

    def table(self) -> Table:
        """Return a table to print."""
        table = Table('what', 'measured', 'bar', 'ok', title=self.driver)
        marks = {True: 'yes', False: '[bold red]no', None: ''}
        for row in self.rows:
            table.add_row(row.name, f'{row.value:,.4g} {row.unit}', row.asked, marks[row.ok])
        return table


#: Measures a part of a bench: yields its rows and adds the points of the plot to the results.
Part = Callable[[SimpleNamespace, Results], Iterable[Row] | None]


@dataclass(frozen=True)
class Bench:
    """What is measured of one capability, how much of it, and how it is plotted."""

    parts: dict[str, Part]
    plot: Callable  # of the points and an empty figure of matplotlib
    outside: dict[str, whole_frames.Maker]
    settings: dict[str, tuple]  # by name, how much is measured in full and by --quick
    tables: Callable = lambda points: []  # of the points, more to print and to write as text

    def extent(self, *, quick=False) -> SimpleNamespace:
        """Return how much is measured."""
        return SimpleNamespace(**{name: pair[quick] for name, pair in self.settings.items()})

    def run(self, name, out, *, quick=False) -> Results:
        """Measure every part, then whole frames; write and print everything."""
        settings = self.extent(quick=quick)
        with Stage((64, 64)) as stage:
            results = Results(stage.driver(), {'quick': quick, **vars(settings)})
        parts = {**self.parts, 'whole frames': self._whole_frames}
        console = Console(stderr=True)
        for part, measure in parts.items():
            start = time.perf_counter()
            results.rows.extend(measure(settings, results) or ())
            console.print(f'{part}: {time.perf_counter() - start:.0f} s')
        self.write(name, results, out)
        Console().print(*self.tables(results.points), results.table())
        return results

    def _whole_frames(self, settings, results):
        """Yield the rows of whole frames with and without the capability."""
        extent = whole_frames.EXTENTS[results.settings['quick']]
        for name, make in self.outside.items():
            found = whole_frames.measured(make, settings, *extent)
            results.whole_frames[name] = found
            for samples, times in found.items():
                title = f'whole frame, {name}, {samples} samples'
                for what, value, unit in whole_frames.told(times):
                    yield Row(f'{title}: {what}', value, unit)

    def write(self, name, results, out):
        """Write everything as JSON, the tables as text, and the plot beside them."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        out.mkdir(parents=True, exist_ok=True)
        (out / f'bench_{name}.json').write_text(results.to_json() + '\n', encoding='utf-8')
        with (out / f'bench_{name}.txt').open('w', encoding='utf-8') as file:
            Console(file=file, width=200).print(*self.tables(results.points), results.table())
        figure = Figure(layout='constrained')
        FigureCanvasAgg(figure)  # needs no screen
        self.plot(results.points, figure)
        for axes in figure.axes:
            if axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize='x-small')
        figure.suptitle(f'pvibr bench {name}: {results.driver}')
        figure.savefig(out / f'bench_{name}.png', dpi=110)
        figure.savefig(out / f'bench_{name}.svg')
