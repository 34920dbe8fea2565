"""Benchmarks of run time against error: every module here but ``common`` is one."""

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


#: The help text of each benchmark by its name.
BENCHES = {
    module.name: _summary(module)
    for module in iter_modules(__path__)
    if module.name not in ('common', '__main__')
}


#: Benchmarks that can survey scenes generated from a seed.
SURVEYS = ('instances',)


def main(name, *, out=Path('out'), quick=False, survey=None, heavy=False):
    """Run a benchmark, or its survey of a seed: print the tables and write them with a plot."""
    if name not in BENCHES:
        raise ValueError(f'name must be one of {", ".join(BENCHES)}, got {name!r}')
    if survey is None:
        if heavy:
            raise ValueError('heavy requires survey, a seed')
        return import_module(f'benchmarks.{name}').BENCH.run(name, Path(out), quick=quick)
    if name not in SURVEYS:
        raise ValueError(f'survey must be None except for {", ".join(SURVEYS)}, got {survey}')
    bench = import_module(f'benchmarks.{name}.survey').survey(survey, heavy=heavy)
    title = f'{name}_heavy_survey_{survey}' if heavy else f'{name}_survey_{survey}'
    return bench.run(title, Path(out), quick=quick)
