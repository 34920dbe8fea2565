"""Warnings point at the line of the user, whatever lies between."""

import inspect
import re
import warnings
from pathlib import Path

import pytest
import pyvista as pv

import pvibr
from pvibr.core import errors
from tests.pictures import plotter

HOME = Path(pvibr.__file__).parent


def test_all_warnings_are_given_by_the_same_function():
    with_own = [p for p in HOME.rglob('*.py') if re.search(r'warnings\.warn\(', p.read_text())]
    assert [p.name for p in with_own] == ['errors.py']


def told(call):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter('always', pvibr.PvibrWarning)
        call()
    return [(w.filename, w.lineno) for w in said if issubclass(w.category, pvibr.PvibrWarning)]


class Broken(pvibr.Effect):
    """Raises in a frame."""

    def prepare(self, frame):
        """Raise an error."""
        raise ValueError


def test_a_frame_points_at_who_drew_it():
    pl = plotter((40, 30))
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(Broken()).enabled = False
    pl.show(auto_close=False)

    def draw():
        pl.ibr.effects[0].enabled = True
        pl.render()

    line = inspect.getsourcelines(draw)[1] + 2
    assert told(draw) == [(__file__, line)]


@pytest.mark.parametrize('depth', [1, 4])
def test_frames_of_libraries_are_skipped(depth):
    names = {'warn': errors.warn, '__name__': 'pyvista.plotting.x'}
    exec('def call(depth):\n    call(depth - 1) if depth else warn("so")', names)

    def user():
        names['call'](depth)

    assert told(user) == [(__file__, inspect.getsourcelines(user)[1] + 1)]


def test_a_state_with_unknown_names():
    pl = plotter((40, 30))
    pl.ibr.add(pvibr.Vignette())
    state = pl.ibr.state()
    pl.ibr.clear()

    def restore():
        pl.ibr.restore(state)

    assert told(restore) == [(__file__, inspect.getsourcelines(restore)[1] + 1)]


@pytest.mark.parametrize('bakes', [True, False])
def test_pyvistas_warnings_of_an_export_are_at_the_user(tmp_path, bakes):
    pl = plotter((40, 30))
    pl.add_mesh(pv.Cube())
    if bakes:
        pl.ibr.add_spheres([[0.0, 0.0, 0.0]])
    else:
        pl.ibr.add(pvibr.Bloom())
    pl.render()

    def write():
        pl.export_html(tmp_path / 'page.html')

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter('always')
        write()
    line = inspect.getsourcelines(write)[1] + 1
    deprecated = [w for w in said if 'export_html is deprecated' in str(w.message)]
    assert [(w.filename, w.lineno) for w in deprecated] == [(__file__, line)]
    assert (tmp_path / 'page.html').stat().st_size > 10_000
