"""What a new user of PyVista would type: each script asserts what it should have got."""

import runpy
import warnings
from pathlib import Path

import pytest

from tests.marks import slow

FOLDER = Path(__file__).with_name('first_scripts')
#: Four seconds of processor time and more.
SLOW = {'kinds_of_mesh'}
SCRIPTS = [
    slow(path, when=path.stem in SLOW, id=path.stem)
    for path in sorted(FOLDER.glob('*.py'))
    if path.stem != 'conftest'
]


@pytest.mark.parametrize('script', SCRIPTS)
def test_it_works_as_written(script):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('default')
            runpy.run_path(str(script), run_name='__main__')
    except ModuleNotFoundError as error:
        if str(error.name).startswith('pvibr'):
            raise
        pytest.skip(f'needs {error.name}')
