"""What all tests share: off-screen, no VTK error unseen, real data where it lies."""

from __future__ import annotations

import gc
import itertools
import os
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

# Each worker has a core of its own: more threads would wait for each other, OpenMP's spinning.
# Read as its libraries are loaded, and by the programs that tests start.
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('LP_NUM_THREADS', '1')  # Mesa's renderer without a GPU
# Its shaders draw few pixels here: most of their time is LLVM's, which compiles them.
os.environ.setdefault('GALLIVM_PERF', 'nopt')

import pytest
import pyvista as pv
from hypothesis import HealthCheck, settings

from pvibr.gl.hidden_window import hidden_window
from pvibr.instances.atlas import Atlas
from pvibr.scenes.trees import LEVELS
from tests.instances.scenes import (  # noqa: F401
    atlases,
    bean,
    quick,
    scenes,
    see,
    textures_of,
)

#: Tests so far, and of how many one is followed by a search for garbage.
_TESTS, _COLLECTED = itertools.count(1), 8

pv.OFF_SCREEN = True
# Mesa compiles what resolves samples anew for every window, as long as all else takes. Tests that
# are about samples ask for them.
pv.global_theme.anti_aliasing = None
# Speed is measured by the bench; a machine that is busy fails no test.
settings.register_profile('untimed', deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile('untimed')


def pytest_configure(config):
    """Let nothing that is baked here be kept in the user's own cache, or come from it."""
    if not hasattr(config, 'workerinput'):  # workers share that of the process that starts them
        folder = TemporaryDirectory(prefix='pvibr-tests-')
        patch = pytest.MonkeyPatch()
        patch.setenv('PVIBR_CACHE', folder.name)
        config.add_cleanup(patch.undo)
        config.add_cleanup(folder.cleanup)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests that need real files, and the cases that wait for ./test -m slow."""
    cases = Counter()
    for item in items:
        if 'data_dir' in item.fixturenames:
            item.add_marker('data')
        if item.get_closest_marker('sampled'):
            where = item.path, item.originalname
            # Multiples of the golden ratio meet all values of all parameters.
            if cases[where] * (5**0.5 - 1) / 2 % 1 > 0.3:
                item.add_marker('slow')
            cases[where] += 1


def pytest_collection_finish():
    """Let no search for garbage go through modules and tests: they stay.

    VTK lets other threads run while it draws, as that by which xdist talks to its workers. What
    they find to be garbage would be freed there, OpenGL's objects too, in the middle of a frame.
    """
    gc.freeze()
    gc.disable()


@pytest.fixture(autouse=True, scope='session')
def _open_display():
    """Hold a window open: with the last one the driver is unloaded, and loaded for the next."""
    with hidden_window(8, 8):
        yield


@pytest.fixture(scope='module')
def window():
    """A small window that is not shown."""
    with hidden_window(16, 16) as (window, _):
        yield window


@pytest.fixture(autouse=True)
def no_vtk_errors(monkeypatch):
    """Fail a test on what VTK would only print: its errors, and Python's within its observers."""
    errors = []
    monkeypatch.setattr(sys, 'excepthook', lambda kind, error, _: errors.append(repr(error)))
    with pv.VtkErrorCatcher(send_to_logging=False) as catcher:
        yield
        pv.close_all()
        assert not gc.isenabled(), 'a test must leave the search for garbage off'
        if (count := next(_TESTS)) % _COLLECTED == 0:  # what is old, less often
            gc.collect(2 if count % (32 * _COLLECTED) == 0 else 0)
    errors += [str(event) for event in catcher.error_events]
    assert not errors, '\n'.join(errors)


@pytest.fixture(scope='session')
def shared_folder(tmp_path_factory) -> Path:
    """A folder of this run that all its workers share: what one bakes, the others read."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if 'PYTEST_XDIST_WORKER' in os.environ else base


@pytest.fixture(scope='module')
def is_quick(request) -> bool:
    """Whether atlases are measured at few sizes, as nothing in the module is about their error."""
    return request.node.get_closest_marker('all_sizes') is None


@pytest.fixture(autouse=True, scope='module')
def _quick_bakes(is_quick):
    """Bake quickly, with a cache of its own, where all sizes are not asked for."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Atlas, 'textures', textures_of)
        if is_quick:
            quick(patch)
            patch.setenv('PVIBR_CACHE', os.path.join(os.environ['PVIBR_CACHE'], 'quick'))
        yield


@pytest.fixture
def small_trees(monkeypatch):
    """Trees with a third of the branches at each level; 5 000 triangles are enough for them."""
    levels = {
        kind: tuple(replace(level, count=max(level.count // 3, 2)) for level in found)
        for kind, found in LEVELS.items()
    }
    monkeypatch.setattr('pvibr.scenes.trees.LEVELS', levels)


@pytest.fixture(scope='session')
def data_dir() -> Path:
    """The folder of real files that is not part of the repository."""
    path = Path(__file__).parents[2] / 'shared' / 'data'
    if not path.is_dir():
        pytest.skip('needs the real files of ../shared/data')
    return path
