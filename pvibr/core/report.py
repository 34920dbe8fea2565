"""What ran in the last frame, what was skipped and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

from pvibr.core.counts import Counts

#: Alignment of each column, and its text for a row.
_COLUMNS = {
    'name': ('<', lambda row: row.effect),
    'state': ('<', lambda row: row.state),
    'ms': ('>', lambda row: f'{row.ms:.1f}'),
    'bytes': ('>', lambda row: f'{row.bytes:,}'),
    'why': ('<', lambda row: row.why),
}


@dataclass
class Row:
    """What one effect did in the last frame."""

    effect: str
    state: str = 'new'
    why: str = ''
    ms: float = 0.0
    bytes: int = 0
    details: dict = field(default_factory=dict)


@dataclass
class Report:
    """Rows of one or more subplots; prints as a table."""

    rows: list[Row]
    frames: int = 0
    picture_bytes: int = 0
    quality: str = ''
    #: What the last frame asked of the GPU.
    counts: Counts = field(default_factory=Counts)
    #: What settings, effects and things cost when that was last measured.
    costs: str = ''
    #: Cells of meshes that `add_large_mesh` would draw by fewer triangles, by name.
    large_meshes: dict[str, int] = field(default_factory=dict)

    def as_dict(self) -> dict:
        """Return the report as JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        cells = [[*_COLUMNS], *([text(row) for _, text in _COLUMNS.values()] for row in self.rows)]
        column_widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        text_lines = [_line(row, column_widths) for row in cells]
        for row in self.rows:
            text_lines += [f'{row.effect}.{k}: {v}' for k, v in row.details.items()]
        text_lines.append(f'{self.frames} frames, {self.picture_bytes:,} bytes between effects')
        text_lines.append(f'last frame: {self.counts}')
        if self.quality:
            text_lines.append(f'quality: {self.quality}')
        text_lines += [
            f'{name}: {cells:,} cells; add_large_mesh draws what the view needs of them'
            for name, cells in self.large_meshes.items()
        ]
        text_lines.append(self.costs or 'costs of settings: pl.ibr.costs() measures them')
        return '\n'.join(text_lines)


def _line(cells, column_widths):
    columns = zip(cells, column_widths, _COLUMNS.values(), strict=True)
    return '  '.join(f'{cell:{align}{width}}' for cell, width, (align, _) in columns).rstrip()
