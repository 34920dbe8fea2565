"""Bakes in another process: drafts at once, the same pictures in the end, and no process left."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest
import pyvista as pv

from pvibr import attach, deterministic
from pvibr.core import _vtk, child_processes
from pvibr.core.errors import PvibrWarning
from pvibr.instances import bake_queue, drafts, levels
from pvibr.instances.bake_jobs import do_job, write_job
from pvibr.instances.bake_queue import QUEUE, State, can_run
from pvibr.instances.cache import AtlasCache
from pvibr.instances.levels import plan_of
from pvibr.meshes.parts import as_parts

GRID = {'theta_resolution': 40, 'phi_resolution': 40}
QUICK = 'import pytest; from tests.instances.scenes import quick; quick(pytest.MonkeyPatch())'
LONG = 120.0  # seconds after which a bake counts as hung


def lumpy(seed=0):
    """A mesh that no other test bakes, light enough to bake in a second."""
    mesh = pv.Sphere(**GRID)
    rng = np.random.default_rng(seed)
    mesh.points *= 1 + 0.3 * np.sin(mesh.points @ rng.normal(size=(3, 1)) * 5)
    return mesh


def places(count=3000):
    return np.random.default_rng(1).uniform(-20, 20, (count, 3))


def blocks(image):
    """Means of 10 x 10 pixels."""
    return image.reshape(18, 10, 24, 10, 3).mean((1, 3))


@pytest.fixture
def held(monkeypatch):
    """No job begins."""
    monkeypatch.setattr(bake_queue.BakeQueue, '_idle_child', lambda _self: None)


@pytest.fixture(autouse=True)
def quick_bakes(monkeypatch):
    """Small images, and errors measured in the child as they are here."""
    monkeypatch.setattr(levels, '_GRID', (4, 16))
    program = child_processes._PROGRAM
    monkeypatch.setattr(child_processes, '_PROGRAM', f'{QUICK}; {program}')


@pytest.fixture(autouse=True)
def no_child_is_left():
    yield
    QUEUE.poll()
    assert not any(job.state is State.RUNNING for job in QUEUE._jobs.values())


def field(tmp_path, *, wait=False, mesh=None, positions=None, **options):
    plotter = pv.Plotter(off_screen=True, window_size=(240, 180))
    options = {'cache': tmp_path, 'color': 'tan', 'progress': False} | options
    balls = plotter.ibr.add_instances(
        lumpy() if mesh is None else mesh,
        places() if positions is None else positions,
        wait=wait,
        **options,
    )
    plotter.camera_position = [(60, 30, 20), (0, 0, 0), (0, 0, 1)]
    return plotter, balls


def test_pictures_are_those_of_a_bake_that_was_waited_for(tmp_path):
    plotter, balls = field(tmp_path / 'background')
    assert balls.pending
    background = plotter.screenshot()
    assert not balls.pending
    plotter.close()
    plotter, balls = field(tmp_path / 'here', wait=True)
    assert not balls.pending
    assert np.array_equal(plotter.screenshot(), background)
    plotter.close()


def test_a_draft_is_drawn_at_once(tmp_path, held, monkeypatch):
    monkeypatch.setattr(drafts, '_LIGHT_SET', 1000)
    plotter, balls = field(tmp_path)
    plotter.show(auto_close=False)
    draft, text = plotter.image, balls.report()['atlas 0']
    assert 'being baked' in text
    assert balls.report()['triangles of meshes'] < 0.2 * len(balls) * balls.item_mesh(0).n_cells
    meshes = pv.Plotter(off_screen=True, window_size=(240, 180))
    glyphs = pv.PolyData(places()).glyph(geom=lumpy(), scale=False, orient=False)
    meshes.add_mesh(glyphs, color='tan')
    meshes.camera_position = plotter.camera_position
    exact = meshes.screenshot()
    assert np.abs(blocks(exact) - blocks(draft)).mean() < 4  # of 255
    assert np.ptp(blocks(exact)) > 100
    meshes.close()
    plotter.close()


def test_simplified_meshes_replace_random_triangles(tmp_path, held, monkeypatch):
    monkeypatch.setattr(drafts, '_LIGHT_SET', 1000)
    mesh = pv.Sphere(theta_resolution=80, phi_resolution=80)
    plotter, balls = field(
        tmp_path, mesh=mesh, positions=[[1.2 * k, 0, 0] for k in range(4)], bake=True
    )
    plotter.camera_position = 'xy'
    plotter.camera.zoom(1.4)
    plotter.show(auto_close=False)
    assert len(balls._models.drafts()[0].levels) > 1
    random_picture = plotter_picture(plotter)
    job = balls._models.drafts()[0].job
    write_job(job.plan, job.folder / 'bake.job')
    do_job(job.folder / 'bake.job', print, lambda file: job.hear({'levels': str(file)}))
    simplified_picture = plotter_picture(plotter)
    assert balls.pending
    balls.force_level = 'mesh'
    exact = plotter_picture(plotter)
    errors = [np.abs(p - exact).mean() for p in (random_picture, simplified_picture)]
    assert errors[1] < 0.2 * errors[0]
    plotter.close()


@pytest.mark.parametrize('content', [b'', b'pvibrA01' + bytes(200)], ids=['empty', 'damaged'])
def test_levels_that_cannot_be_read_change_nothing(tmp_path, held, monkeypatch, content):
    monkeypatch.setattr(drafts, '_LIGHT_SET', 1000)
    plotter, balls = field(tmp_path)
    plotter.show(auto_close=False)
    job, levels_before = balls._models.drafts()[0].job, balls._models.drafts()[0].levels
    file = tmp_path / 'levels'
    file.write_bytes(content)
    job.hear({'levels': str(file)})
    plotter.render()
    assert balls.pending
    assert balls._models.drafts()[0].levels == levels_before
    plotter.close()


def plotter_picture(plotter):
    """The next frame, without waiting."""
    plotter.render()
    return np.array(plotter.image, float)


def test_small_sets_are_their_meshes_until_then(tmp_path, held):
    mesh = lumpy()
    plotter, balls = field(tmp_path, mesh=mesh, positions=places(300))
    assert balls.pending
    plotter.show(auto_close=False)
    draft = plotter.image
    balls.force_level = 'mesh'
    plotter.render()
    assert np.array_equal(plotter.image, draft)
    plotter.close()


def test_waiting_has_a_limit(tmp_path, held, monkeypatch):
    plotter, balls = field(tmp_path)
    assert not plotter.ibr.wait(0.1)
    assert not balls.wait(0)
    assert balls.pending
    with pytest.raises(ValueError, match='timeout'):
        plotter.ibr.wait(-1)
    monkeypatch.undo()
    assert plotter.ibr.wait(LONG)
    assert not balls.pending
    assert 'views of' in balls.report()['atlas 0']
    plotter.close()


def running_child():
    deadline = time.monotonic() + LONG
    while time.monotonic() < deadline:
        QUEUE.poll()
        busy = [child for child in QUEUE._children if not child.is_idle]
        if busy:
            return busy[0]._process._process
        time.sleep(0.01)
    raise TimeoutError


def test_a_child_that_dies_is_replaced_by_a_bake_here(tmp_path):
    plotter, balls = field(tmp_path)
    running_child().kill()
    with pytest.warns(PvibrWarning, match='bake in another process failed'):
        assert plotter.ibr.wait(LONG)
    assert 'views of' in balls.report()['atlas 0']
    plotter.close()


def test_closing_ends_the_child(tmp_path):
    plotter, _ = field(tmp_path)
    child = running_child()
    plotter.close()
    assert child.wait(10) != 0
    assert not list(tmp_path.glob('*.atlas'))


def test_an_interrupt_ends_the_child_and_another_wait_goes_on(tmp_path, monkeypatch):
    plotter, balls = field(tmp_path)
    child = running_child()

    def interrupt(_seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr(time, 'sleep', interrupt)
    with pytest.raises(KeyboardInterrupt):
        plotter.ibr.wait()
    monkeypatch.undo()
    assert child.wait(10) != 0
    plotter.show(auto_close=False)
    assert not balls.pending
    assert 'stopped' in balls.report()['atlas 0']
    frames = []
    plotter.add_on_render_callback(frames.append)
    assert plotter.ibr.wait(LONG)
    assert 'views of' in balls.report()['atlas 0']
    assert frames  # with images
    plotter.close()


def test_sets_and_plotters_share_a_bake(tmp_path):
    fields = [field(tmp_path) for _ in range(2)]
    jobs = {draft.job for _, balls in fields for draft in balls._models.drafts().values()}
    assert len(jobs) == 1
    jobs.clear()
    fields[0][0].close()
    assert fields[1][0].ibr.wait(LONG)
    fields[1][0].close()


def test_removed_and_added_again(tmp_path):
    plotter, balls = field(tmp_path)
    child = running_child()
    plotter.ibr.remove(balls)
    assert child.wait(10) != 0
    plotter.ibr.add(balls)
    assert balls.pending
    assert plotter.ibr.wait(LONG)
    plotter.close()


def test_a_mesh_that_changes_is_baked_as_it_is_then(tmp_path):
    mesh = lumpy()
    plotter, balls = field(tmp_path, mesh=mesh)
    mesh.points = mesh.points * [1, 1, 3]
    plotter.show(auto_close=False)
    assert balls.pending
    changed = plotter.screenshot()
    plotter.close()
    plotter, _ = field(tmp_path, wait=True, mesh=mesh)
    assert np.array_equal(plotter.screenshot(), changed)
    plotter.close()


def test_a_colour_that_changes_is_baked_as_it_is_then(tmp_path):
    plotter, balls = field(tmp_path)
    balls.prop.color = 'red'
    balls.prop.specular = 0.5
    changed = plotter.screenshot()
    plotter.close()
    plotter, balls = field(tmp_path, wait=True, color='red', specular=0.5)
    assert np.array_equal(plotter.screenshot(), changed)
    plotter.close()


def test_drafts_are_picked_recoloured_and_hidden(tmp_path, held, monkeypatch):
    monkeypatch.setattr(drafts, '_LIGHT_SET', 1000)
    plotter, balls = field(tmp_path)
    plotter.show(auto_close=False)
    ids = plotter.ibr.buffer('id')
    assert (ids >= 0).any()
    row, column = np.argwhere(ids[..., 0] >= 0 if ids.ndim > 2 else ids >= 0)[0]
    hit = balls.pick(int(column), int(len(ids) - 1 - row))
    assert hit is None or 0 <= hit.index < len(balls)
    balls.colors = np.tile(np.array([[255, 0, 0]], np.uint8), (len(balls), 1))
    plotter.render()
    reds = plotter.image.reshape(-1, 3).astype(int)
    assert (reds[:, 0] - reds[:, 1]).max() > 80
    balls.visible = np.zeros(len(balls), bool)
    plotter.render()
    assert np.ptp(plotter.image.reshape(-1, 3), axis=0).max() == 0
    assert balls.bounds is not None
    plotter.close()


def test_new_meshes_of_an_update_are_baked_in_the_background(tmp_path):
    plotter = pv.Plotter(off_screen=True, window_size=(240, 180))
    options = {'cache': tmp_path, 'progress': False, 'wait': False}
    index = np.zeros(3000, int)
    balls = plotter.ibr.add_instances([lumpy(0), lumpy(2)], places(), index=index, **options)
    assert plotter.ibr.wait(LONG)
    balls.update(index=np.arange(3000) % 2)
    assert balls.pending
    plotter.screenshot()
    assert not balls.pending
    assert all(atlas.errors for atlas in balls.atlases)
    plotter.close()


def test_deterministic_pictures_wait(tmp_path):
    with deterministic():
        plotter, balls = field(tmp_path / 'a')
        assert not balls.pending
        plotter.close()
    plotter, balls = field(tmp_path / 'b')
    with deterministic():
        plotter.show(auto_close=False)
        assert not balls.pending
    plotter.close()


def test_without_a_cache(tmp_path):
    plotter, balls = field(tmp_path, cache=False)
    assert plotter.ibr.wait(LONG)
    assert balls.atlases[0].errors
    assert not list(tmp_path.iterdir())
    plotter.close()


def test_a_cache_that_cannot_be_written(tmp_path):
    """The result comes all the same, and what the child was warned of is said."""
    (tmp_path / 'file').touch()
    plotter, balls = field(tmp_path, cache=tmp_path / 'file' / 'cache')
    with pytest.warns(PvibrWarning, match='cannot be written'):
        assert plotter.ibr.wait(LONG)
    assert balls.atlases[0].errors
    plotter.close()


@pytest.mark.parametrize('executable', ['', '/opt/viewer/bin/viewer'])
def test_without_a_python_to_start_the_bake_is_here(tmp_path, monkeypatch, executable):
    monkeypatch.setattr(sys, 'executable', executable)
    assert not can_run()
    plotter, balls = field(tmp_path)
    assert not balls.pending
    assert balls.atlases[0].errors
    plotter.close()


def test_a_child_that_cannot_be_started(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, 'executable', '/nowhere/python3')
    plotter, _balls = field(tmp_path)
    with pytest.warns(PvibrWarning, match='no process can be started'):
        assert plotter.ibr.wait(LONG)
    plotter.close()


def test_windows_draw_drafts_and_other_plotters_wait(tmp_path, held):
    for shown, is_pending in ({'off_screen': False}, True), ({'off_screen': True}, False):
        plotter = pv.Plotter(**shown)
        options = {'cache': tmp_path, 'progress': False}
        balls = plotter.ibr.add_instances(pv.Sphere(**GRID), places(), **options)
        assert balls.pending == is_pending
        plotter.close()


def test_a_hidden_window_without_a_plotter_waits(tmp_path, held):
    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.AddRenderer(renderer)
    ibr = attach(renderer)
    balls = ibr.add_instances(pv.Sphere(**GRID), places(), cache=tmp_path, progress=False)
    assert not balls.pending
    ibr.close()


def job_file(tmp_path, mesh=None):
    cache = tmp_path / 'cache'
    plan = plan_of(as_parts(lumpy() if mesh is None else mesh), cache=cache, views=4, tile=16)
    write_job(plan, tmp_path / 'bake.job')
    return plan, tmp_path / 'bake.job', cache


def test_a_job_is_done_once(tmp_path):
    plan, path, cache = job_file(tmp_path)
    fractions = []
    assert do_job(path, fractions.append) == cache
    assert fractions == sorted(fractions)
    assert plan.load() is not None
    fractions.clear()
    assert do_job(path, fractions.append) == cache
    assert not fractions


def test_damaged_jobs_raise(tmp_path):
    _, path, _ = job_file(tmp_path)
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(ValueError, match='altered'):
        do_job(path, None)


def test_a_job_of_another_mesh_raises(tmp_path):
    plan, path, _ = job_file(tmp_path)
    plan.parts = as_parts(pv.Cone())
    write_job(plan, path)
    with pytest.raises(ValueError, match='has changed'):
        do_job(path, None)


BAKE = """
import sys, time
from pathlib import Path
import pyvista as pv
from pvibr.instances import levels
from pvibr.meshes.parts import as_parts
baked = levels._baked
def counted(*args, **kwargs):
    print('baked', flush=True)
    return baked(*args, **kwargs)
levels._baked = counted
parts = as_parts(pv.Sphere(theta_resolution=50, phi_resolution=50))
levels.make_model(parts, cache=sys.argv[1], views=4, tile=16, progress=False)
"""


def test_two_processes_bake_a_mesh_once(tmp_path):
    command = [sys.executable, '-c', BAKE, str(tmp_path)]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    outputs = [process.communicate(timeout=LONG)[0] for process in processes]
    assert ''.join(outputs).count('baked') == 1
    assert [process.returncode for process in processes] == [0, 0]
    assert len(list(tmp_path.iterdir())) == 1  # no lock is left


def test_a_child_ends_with_its_parent(tmp_path):
    _, path, _ = job_file(tmp_path, pv.Sphere(theta_resolution=200, phi_resolution=200))
    code = 'from pvibr.instances.bake_child import main; main()'
    child = subprocess.Popen(
        [sys.executable, '-c', code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    print(json.dumps(str(path)), file=child.stdin, flush=True)
    child.stdin.close()
    assert child.wait(LONG) == 0
    assert AtlasCache(tmp_path / 'cache').nbytes() == 0
    child.stdout.close()
