"""Movies: each frame of its own moment, broken off and resumed, whole or not at all."""

import json
from decimal import Decimal

import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.animation import Clip, FigureMesh, Skeleton, Track
from pvibr.capture.movies import Film
from tests.makers import full_disk
from tests.refusals import refused


@pytest.fixture
def pl():
    plotter = pv.Plotter(off_screen=True, window_size=(64, 48))
    plotter.add_mesh(pv.Cone(), color='red')
    plotter.camera_position = [(0, -5, 1), (0, 0, 0), (0, 0, 1)]
    return plotter


def turner(pl, until=None):
    """Turn the camera by the time; break off after so many frames."""
    calls = []

    def turn(time):
        if len(calls) == until:
            raise KeyboardInterrupt
        calls.append(time)
        pl.camera_position = [(5 * np.sin(time), -5 * np.cos(time), 1), (0, 0, 0), (0, 0, 1)]

    return turn, calls


@pytest.mark.parametrize('name', ['a.gif', 'a.mp4', 'a.webm', 'frames'])
def test_a_broken_movie_goes_on_where_it_stopped(pl, tmp_path, name):
    ffmpeg = pytest.importorskip('imageio_ffmpeg')
    whole, broken = tmp_path / 'whole' / name, tmp_path / 'broken' / name
    whole.parent.mkdir()
    broken.parent.mkdir()
    turn, calls = turner(pl)
    before, pl.ibr.time = pl.camera_position, 3.0
    assert pl.ibr.movie(whole, 1, fps=6, each=turn, speed=2) == whole
    np.testing.assert_allclose(calls, 3 + np.arange(6) / 3)
    assert (pl.ibr.time, pl.camera_position) == (3.0, before)
    turn, _ = turner(pl, until=4)
    with pytest.raises(KeyboardInterrupt, match=r'Frames are stored in .*resumes'):
        pl.ibr.movie(broken, 1, fps=6, each=turn, speed=2)
    assert (pl.ibr.time, pl.camera_position) == (3.0, before)
    assert not broken.is_file()
    turn, calls = turner(pl)
    pl.ibr.movie(broken, 1, fps=6, each=turn, speed=2)
    np.testing.assert_allclose(calls, 3 + np.arange(4, 6) / 3)
    left = sorted(p.name for p in broken.parent.iterdir())
    assert left == [name]
    if name == 'frames':
        names = [f'{k}.png' for k in range(6)]
        assert sorted(p.name for p in whole.iterdir()) == names
        for k in names:
            assert (whole / k).read_bytes() == (broken / k).read_bytes()
        assert len({(whole / k).read_bytes() for k in names}) == 6
    else:
        if name.endswith('gif'):
            assert len(iio.imread(whole)) == 6
        else:
            assert ffmpeg.count_frames_and_secs(whole)[0] == 6
        assert whole.read_bytes() == broken.read_bytes()


@pytest.mark.parametrize('what', ['camera', 'state', 'fps', 'start', 'resume', 'size'])
def test_another_movie_begins_anew(pl, tmp_path, what):
    bloom = pl.ibr.add(pvibr.Bloom())
    turn, _ = turner(pl, until=2)
    with pytest.raises(KeyboardInterrupt):
        pl.ibr.movie(tmp_path / 'a.gif', 1, fps=4, each=turn)
    settings = {'fps': 4}
    if what == 'camera':
        pl.camera.zoom(1.1)
    elif what == 'state':
        bloom.intensity = 0.7
    elif what == 'size':
        pl.window_size = (48, 48)
    else:
        settings[what] = {'fps': 8, 'start': 1.0, 'resume': False}[what]
    turn, calls = turner(pl)
    pl.ibr.movie(tmp_path / 'a.gif', 1, each=turn, **settings)
    assert len(calls) == settings['fps']


def test_broken_frames_are_drawn_again(pl, tmp_path):
    turn, _ = turner(pl, until=3)
    with pytest.raises(KeyboardInterrupt):
        pl.ibr.movie(tmp_path / 'a', 1, fps=4, each=turn)
    (tmp_path / 'a' / '1.png').write_bytes((tmp_path / 'a' / '1.png').read_bytes()[:60])
    turn, calls = turner(pl)
    pl.ibr.movie(tmp_path / 'a', 1, fps=4, each=turn)
    np.testing.assert_allclose(calls, [0.25, 0.75])


def test_a_note_that_is_no_json_is_not_believed(tmp_path):
    film = Film(tmp_path / 'a.gif', count=1, fps=1, marks={}, resume=True)
    film.missing()
    (film.folder / 'movie.json').write_text('{')
    again = Film(tmp_path / 'a.gif', count=1, fps=1, marks={}, resume=True)
    assert again.missing() == [0]
    assert json.loads((film.folder / 'movie.json').read_text()) == {'count': 1, 'fps': 1}


def test_a_full_disk_keeps_the_frames_and_the_old_movie(pl, tmp_path, monkeypatch):
    movie = tmp_path / 'a.gif'
    movie.write_text('before')
    with monkeypatch.context() as patch:
        patch.setattr('pvibr.capture.movies._write_gif', full_disk)
        with pytest.raises(OSError, match=r'the disk is full.*Frames are stored'):
            pl.ibr.movie(movie, 0.5, fps=4, each=turner(pl)[0])
    assert movie.read_text() == 'before'
    turn, calls = turner(pl)
    pl.ibr.movie(movie, 0.5, fps=4, each=turn)
    assert calls == []
    assert len(iio.imread(movie)) == 2


def test_what_moves_is_filmed_at_its_time(pl, tmp_path):
    clip = Clip('up', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 9]])])
    ball = FigureMesh(pv.Sphere(radius=0.2), node=0)
    figure = pvibr.Figure([ball], Skeleton([-1], [np.eye(4)]), [clip])
    actor = pl.ibr.add_animated(figure, clip='up')
    heights = []
    pl.ibr.movie(tmp_path / 'a', 1, fps=4, each=lambda _: heights.append(actor.center[2]))
    np.testing.assert_allclose(heights, [0, 2.25, 4.5, 6.75], atol=1e-3)


@pytest.mark.parametrize(
    'wrong',
    [
        {'seconds': 0},
        {'seconds': np.nan},
        {'fps': -1},
        {'start': np.inf},
        {'speed': np.nan},
        {'samples': 0},
        {'samples': 2.5},
        {'shutter': -0.1, 'samples': 4},
        {'shutter': np.nan, 'samples': 4},
        {'shutter': 0.5},
        {'fps': Decimal('nan')},
        {'start': np.full(5, 1.0)},
        {'speed': 1j},
        {'seconds': 1e300},
        {'each': 3.0},
        {'resume': np.zeros(0)},
        {'progress': 'no'},
        {'path': ''},
        {'path': 3.0},
        {'path': 'no/such/folder/a.gif'},
    ],
)
def test_wrong_arguments_are_named(pl, tmp_path, wrong):
    arguments = {'path': tmp_path / 'a.gif', 'seconds': 1} | wrong
    with pytest.raises((ValueError, TypeError, OSError), match=rf'\b{next(iter(wrong))}\b'):
        pl.ibr.movie(**arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ('arguments', 'error'),
    [
        ({}, TypeError),
        ({'seconds': 1, 'frames': 3}, TypeError),
        ({'frames': 0}, ValueError),
        ({'frames': 2.5}, ValueError),
        ({'frames': 2**70}, ValueError),
        ({'frames': '2'}, TypeError),
    ],
)
def test_seconds_or_frames(pl, tmp_path, arguments, error):
    refused('frames', pl.ibr.movie, tmp_path / 'a.gif', kind=error, **arguments)
    assert list(tmp_path.iterdir()) == []


def test_gifs_have_the_rate_and_colors_of_each_frame(pl, tmp_path):
    def color(time):
        pl.set_background([1, 0.3 + time, 0], top=[0, 0.2, time])

    pl.window_size = 120, 90
    pl.ibr.movie(tmp_path / 'frames', frames=4, fps=10, each=color)
    pl.ibr.movie(tmp_path / 'a.gif', frames=4, fps=10, each=color)
    frames = iio.imread(tmp_path / 'a.gif').astype(float)
    assert iio.immeta(tmp_path / 'a.gif')['duration'] == 100
    assert len(frames) == 4
    for k, frame in enumerate(frames):
        truth = iio.imread(tmp_path / 'frames' / f'{k}.png').astype(float)[..., :3]
        blocks = [p.reshape(9, 10, 12, 10, 3).mean((1, 3)) for p in (frame, truth)]
        assert np.abs(blocks[0] - blocks[1]).max() < 3  # dithered: right in the mean


def test_other_endings_are_named(pl, tmp_path):
    refused(r'a\.xyz', pl.ibr.movie, tmp_path / 'a.xyz', 1)


def test_a_bar_counts_frames(pl, tmp_path, capsys):
    pl.ibr.movie(tmp_path / 'a.gif', 0.5, fps=4, progress=True)
    assert 'writing' in capsys.readouterr().err
    pl.ibr.movie(tmp_path / 'a.gif', 0.5, fps=4)
    assert capsys.readouterr().err == ''


@pytest.mark.parametrize('first', [False, True])
def test_a_plotter_closed_on_the_way_is_an_error(pl, tmp_path, first):
    def close(time):
        if time >= (0.0 if first else 0.3):
            pl.close()

    pl.ibr.add(pvibr.Outline())
    with pytest.raises(pvibr.ClosedError, match='closed'):
        pl.ibr.movie(tmp_path / 'frames', 1, fps=6, each=close)
    assert len(list((tmp_path / 'frames').glob('*.png'))) == (0 if first else 2)


def test_a_path_by_azimuth_is_the_same_again(pl, tmp_path):
    def turn(time):
        pl.camera.azimuth = 90 * time
        pl.camera.elevation = 20 * time

    pl.camera.azimuth = 10
    for name in ('one', 'two'):
        pl.ibr.movie(tmp_path / name, 1, fps=4, each=turn)
        assert (pl.camera.azimuth, pl.camera.elevation) == (10, 0)
    for k in range(4):
        one, two = (iio.imread(tmp_path / name / f'{k}.png') for name in ('one', 'two'))
        assert (one == two).all()


def test_a_window_shows_the_scene_as_before_a_movie(pl, tmp_path):
    pl.show(auto_close=False)
    before = pl.screenshot(return_img=True)
    turn, _ = turner(pl)
    pl.ibr.movie(tmp_path / 'frames', 1, fps=3, each=turn)
    assert (pl.screenshot(return_img=True) == before).all()


@pytest.mark.parametrize('shutter', [0.0, 0.5, 1.0])
def test_what_moves_is_blurred_while_the_shutter_is_open(tmp_path, shutter):
    """A square of 16 pixels that goes 24 to the right in each frame."""
    pl = pv.Plotter(off_screen=True, window_size=(96, 16))
    pl.set_background('black')
    square = pl.add_mesh(pv.Plane(i_size=16, j_size=99), color='white', lighting=False)
    pl.camera_position = [(0, 0, 10), (0, 0, 0), (0, 1, 0)]
    pl.camera.parallel_projection, pl.camera.parallel_scale = True, 8

    def move(time):
        square.position = (24 * time - 30, 0, 0)

    pl.ibr.movie(tmp_path / 'frames', frames=3, fps=1, each=move, samples=64, shutter=shutter)
    x = np.arange(96) + 0.5 - 48
    for k in range(3):
        row = iio.imread(tmp_path / 'frames' / f'{k}.png')[8, :, 0] / 255.0
        opened = np.linspace(0, shutter, 400)[:, None]
        expected = (np.abs(x - 24 * (k + opened) + 30) < 8).mean(0)
        assert np.abs(row - expected).max() < 0.05
        assert abs(row.sum() - 16) < 0.2
    assert pl.ibr.time == 0


# imageio leaves the pipes of the ffmpeg that reads to Python's collector.
@pytest.mark.filterwarnings('ignore::pytest.PytestUnraisableExceptionWarning')
@pytest.mark.filterwarnings('ignore::ResourceWarning')
@pytest.mark.parametrize('ending', ['.mp4', '.mov', '.mkv', '.webm', '.avi', '.gif'])
@pytest.mark.parametrize('size', [(401, 301), (1, 1), (7, 2)], ids=str)
def test_odd_sizes_are_not_cut(tmp_path, size, ending):
    pytest.importorskip('imageio_ffmpeg')
    pl = pv.Plotter(off_screen=True, window_size=size)
    pl.set_background('red')
    path = pl.ibr.movie(tmp_path / f'a{ending}', frames=1)
    plugin = 'pillow' if ending == '.gif' else 'FFMPEG'
    frame = np.asarray(iio.imread(path, plugin=plugin))[0]
    expected = size if ending == '.gif' else tuple(n + n % 2 for n in size)
    assert frame.shape[1::-1] == expected
    assert np.abs(frame.astype(int) - [255, 0, 0]).max() < 20
