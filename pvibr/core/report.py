"""What ran in the last frame, what was skipped and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

_COLUMNS = ('effect', 'state', 'ms', 'bytes', 'why')


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

    def as_dict(self) -> dict:
        """Return the report as JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        cells = [_COLUMNS, *(_cells(row) for row in self.rows)]
        column_widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        text_lines = [_line(row, column_widths) for row in cells]
        for row in self.rows:
            text_lines += [f'{row.effect}.{k}: {v}' for k, v in row.details.items()]
        text_lines.append(f'{self.frames} frames, {self.picture_bytes:,} bytes between effects')
        if self.quality:
            text_lines.append(f'quality: {self.quality}')
        return '\n'.join(text_lines)


def _cells(row):
    return row.effect, row.state, f'{row.ms:.1f}', f'{row.bytes:,}', row.why


def _line(cells, column_widths):
    name, state, ms, size, why = (
        cell.rjust(width) if is_number else cell.ljust(width)
        for cell, width, is_number in zip(cells, column_widths, (0, 0, 1, 1, 0), strict=True)
    )
    return f'{name}  {state}  {ms}  {size}  {why}'.rstrip()
