"""What a new user of PyVista would type: each script asserts what it should have got."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path

import pytest

FOLDER = Path(__file__).with_name('first_scripts')
SCRIPTS = sorted(path for path in FOLDER.glob('*.py') if path.stem != 'conftest')


@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_it_works_as_written(script):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('default')
            runpy.run_path(str(script), run_name='__main__')
    except ModuleNotFoundError as error:
        if str(error.name).startswith('pvibr'):
            raise
        pytest.skip(f'needs {error.name}')
