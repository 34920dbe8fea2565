"""In windows another process builds large meshes, while a draft is drawn."""

import time

import numpy as np
import pytest

from pvibr.core.errors import PvibrWarning
from pvibr.instances.cache import AtlasCache
from pvibr.large import large_mesh as module
from pvibr.large.build import build_hierarchy
from pvibr.large.build_job import BuildJob
from pvibr.large.draft import build_draft
from pvibr.large.sources import source_of
from tests.large.surfaces import folded, terrain
from tests.large.test_large_mesh import LOOK, OVER, SIZE, drawn
from tests.pictures import off, place, plotter, read, shot


def test_draft_first_then_the_mesh(monkeypatch, tmp_path):
    monkeypatch.setattr(module, '_SMALL', 1000)
    monkeypatch.setattr(module, 'build_draft', lambda mesh: build_draft(mesh, 4000))
    pl = plotter(SIZE)
    look = LOOK | {'max_error': 0.5, 'detail': 'none'}
    thing = pl.ibr.add_large_mesh(terrain(), wait=False, cache=tmp_path, **look)
    place(pl, **OVER)
    pl.show(auto_close=False)
    assert thing.is_draft
    draft = pl.ibr.report()
    picture = shot(pl)  # waits
    assert 'draft' in str(draft)
    assert not thing.is_draft
    assert not thing.unfinished
    assert thing.refined
    _, built = drawn(max_error=0.5)
    assert (off(picture, shot(pl)) == 0).all()
    assert thing.report()['triangles'] == built.report()['triangles']
    again = pl.ibr.add_large_mesh(terrain(), wait=False, cache=tmp_path, **LOOK)
    assert not again.is_draft, 'it was in the cache'


def test_finer_draft_between(monkeypatch):
    """Before the hierarchy is there, the mesh itself is drawn where it is near."""
    monkeypatch.setattr(module, '_SMALL', 1000)
    monkeypatch.setattr(module, 'build_draft', lambda mesh: build_draft(mesh, 500))
    program = (
        'import time, pvibr.large.build_job as module; module.FIRST_POINTS = 500; '
        'module.build_hierarchy = lambda *_, **__: time.sleep(600); module.main()'
    )
    monkeypatch.setattr('pvibr.core.child_processes._PROGRAM', program)
    pl = plotter(SIZE)
    thing = pl.ibr.add_large_mesh(terrain(), wait=False, cache=False, **LOOK)
    place(pl, **OVER)
    pl.show(auto_close=False)
    rough, rough_count = read(pl.render_window), thing.report()['triangles']
    assert not thing.unfinished
    while not thing.unfinished:
        time.sleep(0.02)
    pl.render_window.Render()
    assert thing.is_draft
    assert not thing.unfinished
    assert thing.report()['triangles'] > 5 * rough_count
    fine = read(pl.render_window)
    plain = plotter(SIZE)
    plain.add_mesh(terrain(), **{k: v for k, v in LOOK.items() if k != 'detail'})
    truth = shot(place(plain, **OVER))
    assert off(fine, truth).mean() < 0.2 * off(rough, truth).mean()
    pl.close()


def test_failed_process_is_told_and_replaced(monkeypatch):
    monkeypatch.setattr(module, '_SMALL', 1000)
    monkeypatch.setattr('pvibr.core.child_processes._PROGRAM', 'raise SystemExit("no memory")')
    pl = plotter(SIZE)
    thing = pl.ibr.add_large_mesh(folded(40), wait=False, cache=False, color='white')
    thing._job.wait()
    with pytest.warns(PvibrWarning, match='no memory'):
        pl.show(auto_close=False)
    assert not thing.is_draft


@pytest.mark.parametrize(
    'leave', [lambda pl, thing: pl.ibr.remove(thing), lambda pl, _: pl.close()]
)
def test_no_process_stays_behind(monkeypatch, tmp_path, leave):
    monkeypatch.setattr(module, '_SMALL', 1000)
    monkeypatch.setattr('pvibr.core.child_processes._PROGRAM', 'import time; time.sleep(600)')
    pl = plotter(SIZE)
    mesh = terrain().copy()
    thing = pl.ibr.add_large_mesh(mesh, wait=False, cache=tmp_path, **LOOK)
    pl.show(auto_close=False)
    process = thing._job._work.child
    assert process.poll() is None
    leave(pl, thing)
    assert process.poll() is not None
    monkeypatch.undo()
    mesh.points[:] = 0.0  # the key is of what was added
    place(again := plotter(SIZE), **OVER).ibr.add(thing)
    again.ibr.wait()
    again.show(auto_close=False)
    assert thing.refined, 'it starts again where it is added again'
    assert thing.bounds[1] > 0.9
    assert not plotter(SIZE).ibr.add_large_mesh(terrain(), wait=False, cache=tmp_path).is_draft


@pytest.mark.parametrize('cause', ['subprocess.Popen', 'tempfile.TemporaryFile'])
def test_without_a_process_it_is_built_here(monkeypatch, cause):
    def full(*args, **kwargs):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(module, '_SMALL', 1000)
    monkeypatch.setattr(cause, full)
    pl = plotter(SIZE)
    thing = pl.ibr.add_large_mesh(terrain(), wait=False, cache=False, **LOOK)
    with pytest.warns(PvibrWarning, match='No space left'):
        pl.show(auto_close=False)
    assert thing.refined


def test_process_ends_with_its_parent(monkeypatch):
    program = (
        'import time, pvibr.large.build_job as module; '
        'module.build_hierarchy = lambda *_, **__: time.sleep(600); module.main()'
    )
    monkeypatch.setattr('pvibr.core.child_processes._PROGRAM', program)
    job = BuildJob(source_of(terrain()).mesh, 'key', None)
    job.start()
    child = job._work.child
    job._work._thread.join(1)
    child.stdin.close()  # as where the parent was killed
    assert child.wait() == 1
    job.stop()


def test_large_hierarchies_come_without_the_cache(tmp_path):
    """What is larger than the cache may be, and what has none."""
    mesh = source_of(terrain()).mesh
    for cache in (None, AtlasCache(tmp_path, 1000)):
        job = BuildJob(mesh, 'a' * 40, cache)
        assert job.wait()
        np.testing.assert_array_equal(job.newest('it').triangles, build_hierarchy(mesh).triangles)
    assert list(tmp_path.iterdir()) == []
