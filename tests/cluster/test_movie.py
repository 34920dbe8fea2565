"""Movies by workers: the same frames as here, whoever dies."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv

import pvibr
import pvibr.cluster
from pvibr.core.errors import PvibrError
from tests.cluster.scenes import ball

TIMES = [float(k) for k in range(20)]
SCRIPT = Path(__file__).with_name('long_movie.py')


@pytest.fixture
def notes(tmp_path):
    folder = tmp_path / 'notes'
    folder.mkdir()
    return folder


@pytest.fixture(scope='module')
def expected(tmp_path_factory):
    """The frames that one process draws."""
    notes = tmp_path_factory.mktemp('notes')
    with pvibr.deterministic():
        pl = ball()(notes)
        frames = []
        for moment in TIMES:
            pl.ibr.time = moment
            frames.append(pl.ibr.screenshot())
        pl.close()
    return np.array(frames)


def frames_of(folder):
    return np.array([iio.imread(file) for file in sorted(folder.glob('*.png'))])


def drawn(notes):
    return sorted(map(float, (notes / 'drawn').read_text().split()))


def test_the_same_bits_as_here(client, notes, tmp_path, expected):
    with pvibr.deterministic():
        path = pvibr.cluster.movie(ball(), TIMES, tmp_path / 'm', client=client, args=(notes,))
    np.testing.assert_array_equal(frames_of(path), expected)
    assert drawn(notes) == TIMES
    assert 1 <= len(list(notes.glob('made*'))) <= 2  # once by each worker that drew


def test_cameras(client, tmp_path):
    def make(color):
        pl = pv.Plotter(off_screen=True, window_size=(80, 60))
        pl.add_mesh(pv.Cone(), color=color)
        return pl

    camera = pv.Camera()
    camera.position, camera.parallel_projection, camera.parallel_scale = (0, 0, 4), True, 0.8
    angled = pv.Camera()
    angled.position, angled.view_angle = (4, 0, 1), 20
    cameras = [((3, 2, 1), (0, 0, 0), (0, 0, 1)), 'xy', camera, (1.5, angled), 2.0]
    path = tmp_path / 'movie.gif'
    kwargs = {'color': 'tan'}
    assert pvibr.cluster.movie(make, cameras, path, client=client, kwargs=kwargs) == path
    assert len(iio.imread(path)) == 5
    folder = pvibr.cluster.movie(make, cameras, tmp_path / 'm', client=client, kwargs=kwargs)
    pl = make('tan')
    for picture, show in zip(
        frames_of(folder)[:3],
        [
            lambda: setattr(pl, 'camera_position', cameras[0]),
            lambda: setattr(pl, 'camera_position', 'xy'),
            lambda: (setattr(pl, 'camera', camera), pl.renderer.ResetCameraClippingRange()),
        ],
        strict=True,
    ):
        show()
        assert np.abs(pl.ibr.screenshot().astype(int) - picture).max() <= 1


def test_a_worker_that_dies_loses_nothing(client, notes, tmp_path, expected):
    with pvibr.deterministic():
        path = pvibr.cluster.movie(
            ball(), TIMES, tmp_path / 'm', client=client, args=(notes, TIMES[7])
        )
    assert (notes / 'died').exists()
    np.testing.assert_array_equal(frames_of(path), expected)


def test_a_frame_that_fails_is_named_and_resumed(client, notes, tmp_path):
    kwargs = {'fails_at': 11.0}
    arguments = ball(), TIMES, tmp_path / 'm'
    options = {'client': client, 'args': (notes,), 'kwargs': kwargs}
    with pytest.raises(PvibrError, match='frame 11 failed: ZeroDivisionError') as caught:
        pvibr.cluster.movie(*arguments, **options)
    assert 'resumes' in str(caught.value)
    assert 'in follow' in str(caught.value)
    (notes / 'mended').touch()
    before = {f: f.stat().st_mtime_ns for f in (tmp_path / 'm').glob('*.png')}
    path = pvibr.cluster.movie(*arguments, **options)
    assert before
    assert before.items() <= {f: f.stat().st_mtime_ns for f in path.glob('*.png')}.items()
    assert len(frames_of(path)) == len(TIMES)


def test_a_scene_that_fails_says_why(client, tmp_path):
    def make():
        raise KeyError('no such dataset')

    with pytest.raises(PvibrError, match=r'make_scene failed: KeyError: .no such dataset'):
        pvibr.cluster.movie(make, [0.0], tmp_path / 'm', client=client)
    with pytest.raises(PvibrError, match=r'must return a pyvista\.Plotter, got int'):
        pvibr.cluster.movie(lambda: 3, [0.0], tmp_path / 'm', client=client)


def test_plotters_are_closed_at_the_end(client, notes, tmp_path):
    pvibr.cluster.movie(ball(), TIMES[:4], tmp_path / 'm', client=client, args=(notes,))

    def open_scenes():
        from pvibr.cluster import stages

        return stages.drawing(lambda: len(stages._stages))

    assert set(client.run(open_scenes).values()) == {0}


@pytest.mark.parametrize(
    ('changed', 'error', 'text'),
    [
        ({'make_scene': 'a.py'}, TypeError, 'make_scene must be a function'),
        ({'cameras_or_times': 3.0}, TypeError, 'cameras_or_times must be a sequence'),
        ({'cameras_or_times': []}, ValueError, 'at least one frame'),
        ({'cameras_or_times': [0.0, float('nan')]}, ValueError, r'cameras_or_times\[1\]'),
        ({'cameras_or_times': ['top']}, ValueError, r'cameras_or_times\[0\] must be one of xy'),
        ({'cameras_or_times': [np.zeros((2, 3))]}, ValueError, r'cameras_or_times\[0\]'),
        ({'path': 'a.doc'}, ValueError, 'path must end in'),
        ({'client': 3}, TypeError, 'client must be a distributed.Client, got int'),
        ({'args': 'a'}, TypeError, 'args must be a tuple'),
        ({'kwargs': [1]}, TypeError, 'kwargs must be a dict'),
        ({'args': (Path('/not/there.ply'),)}, FileNotFoundError, 'must be there for all workers'),
        ({'fps': 0}, ValueError, 'fps'),
        ({'samples': 0}, ValueError, 'samples'),
        ({'resume': 2}, TypeError, 'resume'),
    ],
)
def test_bad_input(client, tmp_path, changed, error, text):
    path = tmp_path / str(changed.pop('path', 'm'))
    arguments = {'make_scene': ball(), 'cameras_or_times': TIMES, 'client': client} | changed
    with pytest.raises(error, match=text):
        pvibr.cluster.movie(path=path, **arguments)
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_sent(client, tmp_path):
    pl = pv.Plotter(off_screen=True)
    with pytest.raises(TypeError, match=r'make_scene must be a function.* got Plotter'):
        pvibr.cluster.movie(pl, TIMES, tmp_path / 'm', client=client)
    with pytest.raises(TypeError, match=r'args cannot be sent to workers.*in make_scene'):
        pvibr.cluster.movie(ball(), TIMES, tmp_path / 'm', client=client, args=(pl,))
    with pytest.raises(TypeError, match=r'make_scene cannot be sent to workers'):
        pvibr.cluster.movie(lambda: pl, TIMES, tmp_path / 'm', client=client)
    assert not (tmp_path / 'm').exists()


def test_a_movie_goes_on_once_its_process_was_killed(tmp_path):
    folder = tmp_path / 'm'
    command = [sys.executable, str(SCRIPT), str(folder)]
    first = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list(folder.glob('[0-9]*.png'))) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    kept = {f: f.stat().st_mtime_ns for f in folder.glob('[0-9]*.png')}
    assert 3 <= len(kept) < 40
    subprocess.run(command, check=True, timeout=120)
    after = {f: f.stat().st_mtime_ns for f in folder.glob('[0-9]*.png')}
    assert len(after) == 40
    # One may have been half written.
    assert len(kept.items() & after.items()) >= len(kept) - 1
    assert not (folder / 'movie.json').exists()
