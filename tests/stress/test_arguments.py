"""Bad values for each argument of each ``add_*``: an error that names it, or a picture.

The arguments are those of the signatures; what effects take are Params, of which
tests/core/test_params.py tries all.
"""

from __future__ import annotations

import inspect
import re
import warnings
from itertools import islice

import numpy as np
import pytest
import pyvista as pv
from pyvista import examples

import pvibr
from pvibr.api.plotter_component import IBRComponent
from tests.browser import everything

POINTS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
MESH = pv.Sphere(theta_resolution=8, phi_resolution=8)
GRAY = np.full((4, 4, 3), 99, np.uint8)
CAMERA = pvibr.Pinhole(
    [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]],
    np.diag([1.0, -1.0, -1.0]),
    [0.0, 0.0, 5.0],
    (2048, 1024),
)
#: Right arguments of each: what is made once per call where it cannot be used again.
CALLS = {
    'add_instances': lambda pl: ((MESH, POINTS), {'bake': False}),
    'add_billboards': lambda pl: ((POINTS, GRAY), {}),
    'add_spheres': lambda pl: ((POINTS,), {}),
    'add_cylinders': lambda pl: ((POINTS, POINTS + 1), {}),
    'add_ellipsoids': lambda pl: ((POINTS, (1, 2, 3)), {}),
    'add_large_mesh': lambda pl: ((MESH,), {'cache': False}),
    'add_animated': lambda pl: ((everything._figure(),), {}),
    'add_photos': lambda pl: ((MESH, [pvibr.Photo('a', CAMERA, examples.mapfile)]), {}),
    'add_impostor': lambda pl: ((pl.add_mesh(MESH),), {}),
    'add_image_layers': lambda pl: (([pl.add_mesh(MESH)],), {}),
}
#: What is hardly ever right.
BAD = {
    'nan': np.nan,
    'inf': np.inf,
    'below 0': -1,
    'huge': 1e308,
    'no float': 10**400,
    'None': None,
    'True': True,
    'text': 'no such',
    'no text': '',
    'bytes': b'x',
    'object': object(),
    'class': int,
    'function': lambda: 0,
    'list': [],
    'lists': [[[]]],
    'dict': {},
    'set': {1},
    'pair': (1, 2),
    'no rows': np.zeros((0, 3)),
    'shape': np.zeros((2, 5, 7)),
    'complex': np.ones(3) * 1j,
    'objects': np.array([None, 'a'], object),
    'words': np.array(['a', 'b']),
    'NaNs': np.full((3, 3), np.nan),
    'no mesh': pv.PolyData(),
}
#: PyVista's own ``add_mesh`` raises the same for it.
BY_PYVISTA = {(name, 'use_transparency') for name in ('add_instances', 'add_animated')}
#: What errors call an argument that may be of several kinds.
ALSO_CALLED = {('add_animated', 'figure'): 'figure|path|meshes'}
#: Values of each argument that the quick tests try.
QUICK = 2


def arguments(name):
    """Return the names of the arguments of a method."""
    found = inspect.signature(getattr(IBRComponent, name)).parameters.values()
    return [p.name for p in found if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)][1:]


def tried(pl, name, argument, value):
    """Add with a bad value, draw it, and return what is wrong with that."""
    args, kwargs = CALLS[name](pl)
    names, before = arguments(name), [*pl.ibr.effects, *pl.renderer.actors.values()]
    given = dict(zip(names, args, strict=False)) | kwargs | {argument: value}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            getattr(pl.ibr, name)(**given)
            pl.render()
    except (TypeError, ValueError, KeyError, OSError, pvibr.PvibrError) as error:
        after = [*pl.ibr.effects, *pl.renderer.actors.values()]
        if after != before:
            return f'left {len(after) - len(before)} behind'
        called = ALSO_CALLED.get((name, argument), rf'\b{argument.rstrip("s")}')
        known = re.search(called, str(error)) or (name, argument) in BY_PYVISTA
        return '' if known else f'nameless: {error!r}'
    except Exception as error:
        return f'wrong: {error!r}'
    off = [row for row in pl.ibr.report().rows if row.state not in ('ran', 'skipped')]
    return f'drawn as {off[0].state}: {off[0].why}' if off else ''


def findings(name, choose):
    """Return what is wrong with the calls of a method with bad values that are chosen."""
    pl = pv.Plotter(window_size=(32, 32))
    pl.show(auto_close=False)
    found = {}
    with everything.lighter():
        for k, argument in enumerate(arguments(name)):
            for kind in choose(k):
                if wrong := tried(pl, name, argument, BAD[kind]):
                    found[argument, kind] = wrong[:200]
                pl.ibr.clear()
                pl.clear_actors()
    return found


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Let what takes a text for a folder write there."""
    monkeypatch.chdir(tmp_path)


def test_every_way_to_add_is_here():
    assert {name for name in dir(IBRComponent) if name.startswith('add_')} == {*CALLS}


@pytest.mark.parametrize('name', CALLS)
def test_some_bad_values(name):
    kinds = [*BAD]

    def chosen(k):
        return [*islice(kinds[7 * k % len(kinds) :] + kinds, QUICK)]

    assert not findings(name, chosen)


@pytest.mark.stress
@pytest.mark.parametrize('name', CALLS)
def test_all_bad_values(name):
    assert not findings(name, lambda k: BAD)
