"""Other threads and forked processes: what is documented works there, the rest raises."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.plotter_component import IBRComponent
from tests.pictures import plotter, shot

#: What its docstring says that any thread may read.
READ = {'time', 'playing', 'quality', 'buffer_objects', 'interactive_frame_ms'}
#: Arguments of the methods that need some.
ARGUMENTS = {
    'add': [pvibr.Bloom()],
    'add_animated': [pv.Sphere()],
    'add_billboards': [[(0, 0, 0)], np.zeros((4, 4, 3), np.uint8)],
    'add_cylinders': [[(0, 0, 0)], [(0, 0, 1)]],
    'add_ellipsoids': [[(0, 0, 0)], (1, 2, 3)],
    'add_image_layers': [[]],
    'add_impostor': [pv.Sphere()],
    'add_instances': [pv.Sphere(), [(0, 0, 0)]],
    'add_large_mesh': [pv.Sphere()],
    'add_photos': [pv.Sphere(), []],
    'add_spheres': [[(0, 0, 0)]],
    'buffer': ['depth'],
    'distribute': [pv.Sphere()],
    'export_glb': ['no such/a.glb'],
    'export_html': ['no such/a.html'],
    'fly_to': [pv.Camera()],
    'load_state': ['a.json'],
    'load_state_text': ['{}'],
    'look': ['studio'],
    'movie': ['no such/a.gif', 1.0],
    'on_close': [print],
    'pick': [10, 10],
    'remove': ['Spheres'],
    'restore': [{}],
    'save_state': ['no such/a.json'],
}
METHODS = [name for name in dir(IBRComponent) if callable(getattr(IBRComponent, name))]
# Closing is for every thread: interpreters end in another.
METHODS = [name for name in METHODS if not name.startswith('_') and name != 'close']
VALUES = [
    name
    for name in dir(IBRComponent)
    if name not in (*METHODS, 'close') and not name.startswith('_')
]


@pytest.fixture
def pl(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pl = plotter()
    pl.ibr.add_spheres([(0, 0, 0), (1, 0, 0)])
    pl.ibr.save_state('a.json')
    pl.show(auto_close=False)
    return pl


def elsewhere(function, *arguments):
    """Return what a function returns in another thread."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function, *arguments).result(60)


@pytest.mark.parametrize('name', METHODS)
def test_methods_raise_in_another_thread(pl, name):
    before, contents = shot(pl), pl.ibr.effects
    with pytest.raises(pvibr.ThreadError, match=r'the thread that uses its plotter, MainThread'):
        elsewhere(getattr(pl.ibr, name), *ARGUMENTS.get(name, []))
    assert pl.ibr.effects == contents
    np.testing.assert_array_equal(shot(pl), before)


@pytest.mark.parametrize('name', VALUES)
def test_values_are_read_or_raise(pl, name):
    if name in READ:
        assert elsewhere(getattr, pl.ibr, name) == getattr(pl.ibr, name)
    else:
        with pytest.raises(pvibr.ThreadError):
            elsewhere(getattr, pl.ibr, name)


def test_settings_are_set_from_any_thread(pl):
    before = shot(pl)
    bloom = pl.ibr.add(pvibr.Vignette(intensity=0.0))
    elsewhere(setattr, bloom, 'intensity', 1.0)
    elsewhere(setattr, pl.ibr, 'interactive_frame_ms', 50.0)
    assert np.abs(shot(pl) - before).max() > 20


def test_other_changes_raise(pl):
    thing = pl.ibr.effects[0]
    for function, *arguments in (
        (setattr, thing, 'position', (0.0, 1.0, 0.0)),
        (setattr, thing, 'scalars', [1.0, 2.0]),
        (setattr, pl.ibr, 'time', 1.0),
        (thing.remove,),
    ):
        with pytest.raises(pvibr.ThreadError):
            elsewhere(function, *arguments)
    assert thing.position == (0.0, 0.0, 0.0)
    assert thing in pl.ibr


def test_plotter_of_another_thread():
    """One that is made, drawn and closed in a thread is like any; also if that has ended."""

    def work():
        pl = plotter()
        pl.ibr.add_spheres([(0, 0, 0)])
        pl.show(auto_close=False)
        found = shot(pl)
        pl.close()
        return found

    found = elsewhere(work)
    np.testing.assert_array_equal(found, work())


def test_first_frame_decides():
    pl = plotter()
    pl.ibr.add_spheres([(0, 0, 0)])

    def work():
        pl.show(auto_close=False)
        found = shot(pl)
        pl.ibr.add(pvibr.Bloom())
        pl.close()
        return found

    assert elsewhere(work).std() > 1


def test_meshes_are_baked_while_another_thread_draws(pl):
    """Each has a window of its own."""
    points = np.random.default_rng(0).normal(size=(50, 3))

    def work():
        other = plotter()
        other.ibr.add_instances(pv.Cone(resolution=24), points, bake=True)
        other.show(auto_close=False)
        found = shot(other)
        other.close()
        return found

    expected, before = work(), shot(pl)
    with ThreadPoolExecutor(1) as pool:
        found = pool.submit(work)
        for _ in range(20):
            np.testing.assert_array_equal(shot(pl), before)
    np.testing.assert_array_equal(found.result(60), expected)


FORKS = """
import os, signal, sys
import pyvista as pv, pvibr
pl = pv.Plotter(off_screen=True, window_size=(40, 30))
pl.ibr.add_spheres([(0, 0, 0)])
pl.show(auto_close=False)
if sys.argv[1] == 'closed':
    pl.close()
pid = os.fork()
if not pid:
    signal.alarm(30)
    try:
        if sys.argv[1] != 'same':
            pl = pv.Plotter(off_screen=True, window_size=(40, 30))
        pl.ibr.add_spheres([(1, 0, 0)])
        pl.show(auto_close=False)
        os._exit(0)
    except pvibr.ThreadError as error:
        os._exit(5 if 'spawn' in str(error) else 6)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='processes are not forked')
@pytest.mark.parametrize(('how', 'status'), [('same', 5), ('new', 5), ('closed', 0)])
def test_fork_after_drawing(how, status):
    """The driver's threads are not in the child, which would wait for them for ever."""
    done = subprocess.run([sys.executable, '-c', FORKS, how], check=False, timeout=100)
    assert done.returncode == status
