"""What was measured, and the bar that it must pass."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from rich.table import Table


@dataclass(frozen=True)
class Row:
    """One number and its bar."""

    name: str
    value: float
    unit: str = ''
    bar: float | None = None
    at_least: bool = False

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

    def to_json(self) -> str:
        """Return everything as JSON."""
        rows = [asdict(row) | {'ok': row.ok} for row in self.rows]
        return json.dumps(
            {'driver': self.driver, **self.settings, 'rows': rows, 'points': self.points}, indent=1
        )

    def table(self) -> Table:
        """Return a table to print."""
        table = Table('what', 'measured', 'bar', 'ok', title=self.driver)
        marks = {True: 'yes', False: '[bold red]no', None: ''}
        for row in self.rows:
            table.add_row(row.name, f'{row.value:,.4g} {row.unit}', row.asked, marks[row.ok])
        return table
