"""The table of effects in docs/effects.md; ``python tests/effects/test_docs.py`` writes it."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pvibr

PAGE = Path(__file__).parents[2] / 'docs' / 'effects.md'
TABLE = re.compile(r'(?<=\| effect \| what it is \|\n\|---\|---\|\n)(\|[^\n]*\n)*')


def row(name):
    effect = getattr(pvibr, name)
    given = inspect.signature(effect).parameters.values()
    given = ', '.join(p.name for p in given if p.kind is p.POSITIONAL_OR_KEYWORD)
    summary = inspect.cleandoc(effect.__doc__).split('\n\n')[0].rstrip('.')
    text = f'{summary[:1].lower()}{summary[1:]}'.replace('\n', ' ').replace('``', '`')
    return f'| `{name}({given})` | {text} |\n'


def table():
    return ''.join(map(row, pvibr.EFFECTS))


def test_table_is_that_of_the_classes():
    found = TABLE.search(PAGE.read_text(encoding='utf-8'))
    assert found[0] == table(), f'run python {Path(__file__).name}'


if __name__ == '__main__':
    text = PAGE.read_text(encoding='utf-8')
    PAGE.write_text(TABLE.sub(lambda _: table(), text, count=1), encoding='utf-8')
