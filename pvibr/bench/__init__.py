"""Measure run time against error: every module here but ``common`` is a bench."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules


def _summary(module) -> str:
    """Return the first line of a module's docstring without importing the module."""
    home = Path(__file__).parent / module.name
    source = home / '__init__.py' if module.ispkg else home.with_suffix('.py')
    text = ast.get_docstring(ast.parse(source.read_text(encoding='utf-8'))) or ''
    return text.partition('\n')[0]


#: What can be measured, and the help of its command.
BENCHES = {
    module.name: _summary(module)
    for module in iter_modules(__path__)
    if module.name not in ('common', '__main__')
}


#: Benches of which a survey can be made from a seed.
SURVEYS = ('instances',)


def main(name, *, out=Path('out'), quick=False, survey=None, heavy=False) -> list:
    """Run a bench, or its survey of a seed: print the tables and write them beside a plot."""
    if name not in BENCHES:
        msg = f'name is {name!r}; it must be one of {", ".join(BENCHES)}.'
        raise ValueError(msg)
    if survey is None:
        if heavy:
            msg = 'heavy needs survey, the seed of what is surveyed.'
            raise ValueError(msg)
        return import_module(f'pvibr.bench.{name}').BENCH.run(name, Path(out), quick=quick)
    if name not in SURVEYS:
        msg = f'survey is {survey}; it must be None but for {", ".join(SURVEYS)}.'
        raise ValueError(msg)
    bench = import_module(f'pvibr.bench.{name}.survey').survey(survey, heavy=heavy)
    title = f'{name}_heavy_survey_{survey}' if heavy else f'{name}_survey_{survey}'
    return bench.run(title, Path(out), quick=quick)
