"""Signatures and docstrings name every setting, also of what is passed on."""

import inspect
import re

import pytest
import pyvista as pv

import pvibr
from pvibr.api.plotter_component import IBRComponent
from pvibr.core.effect import Effect
from pvibr.core.params import params_of
from pvibr.core.signatures import arguments_of, docstring_of, signature_of, takes

ADDED = {name: getattr(IBRComponent, name) for name in dir(IBRComponent) if name[:4] == 'add_'}
EXPORTED = [getattr(pvibr, name) for name in pvibr.__all__]
EFFECTS = [
    e for e in EXPORTED if isinstance(e, type) and issubclass(e, Effect) and e is not Effect
]


def documented(doc):
    """The names in a docstring's section of parameters."""
    section = re.search(r'Parameters\n-+\n(.*?)(\n\n\w[\w ]*\n---|\Z)', doc, re.DOTALL)[1]
    entries = re.findall(r'^(\S.*)$', section, re.MULTILINE)
    return [n.strip() for entry in entries for n in entry.split(' :')[0].split(',')]


@pytest.mark.parametrize('kind', EFFECTS)
def test_each_setting_is_an_argument_with_its_default(kind):
    taken = inspect.signature(kind).parameters
    assert 'settings' not in taken
    own = inspect.signature(kind.__init__).parameters
    if 'settings' in own:
        for name, param in params_of(kind).items():
            assert taken[name].default == param.default
            assert name in own or taken[name].kind is inspect.Parameter.KEYWORD_ONLY
            assert param.doc.split()[0] in kind.__doc__


@pytest.mark.parametrize('kind', EFFECTS)
def test_each_argument_is_documented_once(kind):
    names = documented(kind.__doc__) if inspect.signature(kind).parameters else []
    assert len(set(names)) == len(names)
    assert set(inspect.signature(kind).parameters) == {n.lstrip('*') for n in names}


@pytest.mark.parametrize('name', ADDED)
def test_what_adds_has_the_arguments_of_what_it_makes(name):
    method = ADDED[name]
    found = inspect.signature(method).parameters
    assert next(iter(found)) == 'self'
    assert {'name', 'reset_camera', 'render'} <= set(found)
    assert ('show_scalar_bar' in found) is ('scalars' in found)
    assert documented(method.__doc__) == list(found)[1:]
    assert not any(p.kind is p.VAR_KEYWORD for p in found.values())
    assert method.__name__ == name
    assert method.__module__ == 'pvibr.api.plotter_component'


def test_tab_completes_what_users_set():
    pl = pv.Plotter(off_screen=True)
    found = inspect.signature(pl.ibr.add_instances).parameters
    assert {'max_error', 'scalars', 'color', 'cmap', 'opacity'} <= set(found)
    assert next(iter(found)) == 'mesh'
    assert 'Draw' in pl.ibr.add_animated.__doc__
    assert {'times', 'skinning'} <= set(inspect.signature(pl.ibr.add_animated).parameters)
    assert pl.ibr.add_spheres.__doc__.startswith(pvibr.Spheres.__doc__.partition('\n')[0])


def inner(first, size=2, *, color='red'):
    """Do.

    Parameters
    ----------
    first : int
        First.
    size, color
        How.
    """


@takes(rest=(inner, 'more'), without=('size',))
def outer(first, **rest):
    """Do it.

    Parameters
    ----------
    first : float
        Own.
    **rest
        Others.

    Returns
    -------
    int
    """


def test_keywords_are_those_of_whoever_takes_them():
    arguments = arguments_of(outer)
    assert str(signature_of(arguments)) == "(first, *, color='red', more=None)"
    doc = docstring_of(outer, arguments)
    assert doc == (
        'Do it.\n\nParameters\n----------\nfirst : float\n    Own.\n'
        'color, more : optional\n    Others.\n\n'
        'Returns\n-------\nint\n'
    )


def test_unknown_keywords_stay():
    def other(**anything):
        pass

    assert str(signature_of(arguments_of(other))) == '(**anything)'
