"""Files where a disk is full, a process is killed or another one writes: whole, or as before."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.instances import cache as cache_module
from pvibr.instances.cache import AtlasCache
from tests.browser import everything
from tests.figures.makers import bending, worm
from tests.pictures import plotter, shot

RINGS = everything.RINGS


def scene(count):
    """Return a plotter of a number of balls."""
    pl = plotter((40, 30))
    pl.add_mesh(pv.Cone())
    pl.ibr.add_spheres(RINGS[:count], 0.4, color='navy')
    pl.ibr.add(pvibr.Vignette(intensity=count / 10))
    return pl


def ball(count):
    return pv.Sphere(theta_resolution=20 + count, phi_resolution=20)


def written(writer):
    """Return a writer of a scene, which is closed afterwards."""

    def write(path, count):
        pl = scene(count)
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', pvibr.PvibrWarning)  # of what a page lacks
            writer(pl.ibr, path)
        pl.close()

    return write


#: All that writes a file where users say; the content follows a number.
WRITERS = {
    'a.json': written(lambda ibr, path: ibr.save_state(path)),
    'a.glb': written(lambda ibr, path: ibr.export_glb(path)),
    'a.html': written(lambda ibr, path: ibr.export_html(path)),
    'a.png': written(lambda ibr, path: ibr.screenshot(path)),
    'a.gif': written(lambda ibr, path: ibr.movie(path, frames=2, progress=False)),
    'a.pvl': lambda path, count: ball(count).ibr.large(path, progress=False),
    'figure.glb': lambda path, count: worm(clips=count * [bending()]).save(path),
}
#: What a movie and a hierarchy leave to go on from, and locks.
LEFT = {'.a.gif.frames', 'a.pvl.build', '.a.pvl.lock'}


@contextmanager
def full_disk(size):
    """Let files be of a size at most: writing fails in the middle, in C as in Python."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


def left_in(folder):
    return {path.name for path in folder.iterdir()} - LEFT


@pytest.mark.parametrize('name', WRITERS)
def test_full_disk(name, tmp_path):
    path = tmp_path / name
    WRITERS[name](path, 3)
    before = path.read_bytes()
    with full_disk(len(before) // 2), pytest.raises(OSError, match=name):
        WRITERS[name](path, 5)
    assert path.read_bytes() == before
    assert left_in(tmp_path) == {name}
    WRITERS[name](path, 5)
    assert path.read_bytes() != before


KILLED = """
import os, signal, sys
from pathlib import Path
import pyvista as pv
pv.OFF_SCREEN = True
from tests.stress.test_file_faults import WRITERS
if sys.argv[1] == 'killed':
    os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
for name in sys.argv[3:]:
    for count in range(3, 6 if sys.argv[1] == 'often' else 4):
        WRITERS[name](Path(sys.argv[2], name), count)
"""


def ended(count, *command):
    """Return the statuses of processes that run at once, and what they said last."""
    command = [sys.executable, '-c', *map(str, command)]
    running = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(count)]
    said = [process.communicate(timeout=400)[1][-2000:] for process in running]
    return [process.returncode for process in running], said


@pytest.mark.slow
@pytest.mark.parametrize('name', WRITERS)
def test_killed_while_writing(name, tmp_path):
    """The old file stays; a hidden temporary one is left, and the same call works."""
    path = tmp_path / name
    WRITERS[name](path, 4)
    before = path.read_bytes()
    statuses, said = ended(1, KILLED, 'killed', tmp_path, name)
    assert statuses == [-signal.SIGKILL], said
    assert path.read_bytes() == before
    assert all(left.startswith('.') for left in left_in(tmp_path) - {name})
    WRITERS[name](path, 5)
    assert path.read_bytes() != before


@pytest.mark.slow
def test_two_processes_write_the_same_files(tmp_path):
    names = [name for name in WRITERS if name != 'a.gif']  # its frames are of one process
    statuses, said = ended(2, KILLED, 'often', tmp_path, *names)
    assert statuses == [0, 0], said
    again = tmp_path / 'again'
    again.mkdir()
    for name in names:
        WRITERS[name](again / name, 5)
        if name != 'a.html':  # whose numbers are random
            assert (tmp_path / name).read_bytes() == (again / name).read_bytes(), name
    assert left_in(tmp_path) == {*names, 'again'}


# -- caches ---------------------------------------------------------------------------------


def instances(pl, folder):
    pl.ibr.add_instances(pv.Cone(resolution=24), RINGS, color='green', bake=True, cache=folder)


def crowd(pl, folder):
    pl.ibr.add_animated(everything._figure(), RINGS, clip='rise', max_error=8, cache=folder)


def large_mesh(pl, folder):
    pl.ibr.add_large_mesh(ball(9), color='tan', cache=folder)


#: All that fills a cache: what is added, with its folder.
CACHES = {'instances': instances, 'crowd': crowd, 'large mesh': large_mesh}


def picture(kind, folder):
    """Return the picture of what a cache holds, and what was warned of."""
    pl = plotter((60, 40))
    with warnings.catch_warnings(record=True) as caught, everything.lighter():
        warnings.simplefilter('always', pvibr.PvibrWarning)
        CACHES[kind](pl, folder)
        pl.show(auto_close=False)
        found = shot(pl)
    pl.close()
    return found, [str(w.message) for w in caught]


def regions(raw):
    """Return the place of a byte in each region of an entry: head, table, each array."""
    length = int.from_bytes(raw[40:48], 'little')
    header = json.loads(raw[48 : 48 + length])
    places = {'magic': 3, 'digest': 20, 'length': 41, 'table': 48 + length // 3}
    for name, (dtype, shape, start) in header['arrays'].items():
        size = np.dtype(dtype).itemsize * int(np.prod(shape))
        if size:
            places[name] = 48 + length + start + size // 2
    return places


SLOW = [pytest.param(kind, marks=pytest.mark.slow) for kind in CACHES if kind != 'large mesh']


@pytest.fixture(scope='module', params=[*SLOW, 'large mesh'])
def filled(request, tmp_path_factory):
    """Return a kind, the folder of its cache, and its picture."""
    folder = tmp_path_factory.mktemp('cache')
    found, said = picture(request.param, folder)
    assert not said
    return request.param, folder, found


def only_entry(folder):
    (file,) = folder.glob('*.atlas')
    return file


def test_each_region_of_each_cache(filled):
    """A byte is changed there, or the file ends there: it is found, removed and told, once."""
    _, folder, _ = filled
    file = only_entry(folder)
    whole = file.read_bytes()
    for place in regions(whole).values():
        changed = bytearray(whole)
        changed[place] ^= 0x40
        for damaged in (changed, whole[:place]):
            file.write_bytes(damaged)
            with pytest.warns(pvibr.PvibrWarning, match='Removed the cached') as caught:
                assert AtlasCache(folder).get(file.stem) is None
            assert len(caught) == 1
            assert not file.exists()
    file.write_bytes(whole)


@pytest.mark.parametrize('cut', [False, True])
def test_damaged_cache_is_filled_again(filled, cut):
    kind, folder, expected = filled
    file = only_entry(folder)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] + (b'' if cut else bytes(len(whole) // 2)))
    found, said = picture(kind, folder)
    np.testing.assert_array_equal(found, expected)
    assert len(said) == 1
    assert 'will be baked again' in said[0]
    assert len(file.read_bytes()) == len(whole)


def test_full_disk_of_a_cache(filled, tmp_path, monkeypatch):
    kind, _, expected = filled
    monkeypatch.setattr(cache_module, '_given_up', set())
    with full_disk(4096):
        found, said = picture(kind, tmp_path)
    np.testing.assert_array_equal(found, expected)
    assert len(said) == 1
    assert 'PVIBR_CACHE' in said[0]
    assert not [path for path in tmp_path.iterdir() if path.suffix == '.atlas']


FILLS = """
import sys, warnings
from pathlib import Path
import pyvista as pv
pv.OFF_SCREEN = True
warnings.simplefilter('error')
from tests.stress.test_file_faults import picture
picture(sys.argv[1], Path(sys.argv[2]))
"""


@pytest.mark.slow
@pytest.mark.parametrize('kind', CACHES)
def test_two_processes_fill_a_cache(kind, tmp_path):
    statuses, said = ended(2, FILLS, kind, tmp_path)
    assert statuses == [0, 0], said
    assert [Path(file).suffix for file in tmp_path.iterdir()] == ['.atlas']
