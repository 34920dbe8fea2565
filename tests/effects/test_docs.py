"""The table of effects, which ``python tests/effects/test_docs.py`` writes, and the tutorial."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pvibr
from pvibr.core.effect import Effect

ROOT = Path(__file__).parents[2]
PAGE = ROOT / 'docs' / 'effects.md'
TUTORIAL = (ROOT / 'docs' / 'add-an-effect.md').read_text(encoding='utf-8')
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


@pytest.fixture
def with_tutorial(tmp_path):
    """A copy of pvibr to which the blocks of the tutorial were added as printed."""
    shutil.copytree(ROOT / 'pvibr', tmp_path / 'pvibr')
    for path, text in re.findall(r'```\w+\n(?:#|//) (pvibr/\S+)\n(.*?)```', TUTORIAL, re.DOTALL):
        file = tmp_path / path
        if file.exists():
            registered = file.read_text(encoding='utf-8').replace(
                'EFFECTS = {\n', 'EFFECTS = {\n' + text
            )
            file.write_text(registered, encoding='utf-8')
        else:
            file.write_text(text, encoding='utf-8')
    return tmp_path


@pytest.mark.slow
def test_effect_of_the_tutorial_keeps_the_contract(with_tutorial):
    paths = os.pathsep.join([str(with_tutorial), *sys.path])
    tests = [ROOT / 'tests/effects/test_every.py', ROOT / 'tests/widgets/test_presets.py']
    options = ['-q', '-n', '0', '-k', 'Scanlines', '-c', ROOT / 'pyproject.toml']
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', *options, '-o', 'cache_dir=cache', *tests],
        cwd=with_tutorial,
        env=os.environ | {'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert re.search(r'^\d passed', done.stdout, re.MULTILINE), done.stdout
    *_, script = re.findall(r'```python\n(.*?)```', TUTORIAL, re.DOTALL)
    subprocess.run(
        [sys.executable, '-W', 'error', '-c', script],
        cwd=with_tutorial,
        env=os.environ | {'PYTHONPATH': paths, 'PYVISTA_OFF_SCREEN': 'true'},
        check=True,
    )


def test_protocol_of_the_tutorial_is_that_of_the_class():
    public = {name for name in vars(Effect) if not name.startswith('_')}
    hooks = public - {*Effect.FOR_USERS, 'FOR_USERS', 'pipeline', 'revision', 'is_image_effect'}
    rows = ' '.join(re.findall(r'^\| (`.*?) \| ', TUTORIAL, re.MULTILINE))
    said = set(re.findall(r'`(\w+)(?:\([\w, ]*\))?`', rows))
    assert said == hooks | {'Param', 'report'}


if __name__ == '__main__':
    text = PAGE.read_text(encoding='utf-8')
    PAGE.write_text(TABLE.sub(lambda _: table(), text, count=1), encoding='utf-8')
