import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Skeleton, Track
from pvibr.cli.app import main
from pvibr.cli.play import _Keys

SIZE = ('--size', '64x48')


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    """A ball that rises, or turns."""
    path = tmp_path_factory.mktemp('play') / 'ball.glb'
    rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 9, 0]])])
    turn = Clip('turn', [Track(0, 'translation', [0, 2], [[0, 0, 0], [0, 0, 1]])])
    still = Skeleton([-1], [np.eye(4)])
    Figure([FigureMesh(pv.Sphere(), node=0, look={'color': 'red'})], still, [rise, turn]).save(
        path
    )
    return str(path)


def height(picture):
    """Where the ball is in a picture: its middle row, 0 at the top."""
    differs = np.abs(np.asarray(picture, int) - np.asarray(picture, int)[0, 0]).max(-1) > 20
    return np.argwhere(differs)[:, 0].mean()


def test_a_frame_is_the_picture_of_its_time(file, tmp_path, capsys):
    heights = []
    for time in ('0', '0.9'):
        out = tmp_path / f'{time}.png'
        assert main(['play', file, '--time', time, '-o', str(out), *SIZE]) == 0
        picture = iio.imread(out)
        assert picture.shape[:2] == (48, 64)
        heights.append(height(picture))
    assert heights[1] < heights[0] - 10
    said = capsys.readouterr().out
    assert 'rise*' in said
    assert 'turn' in said


@pytest.mark.parametrize(('speed', 'n_frames'), [('1', 5), ('-2', 2)])
def test_a_movie_is_once_the_clip(file, tmp_path, speed, n_frames):
    movie = tmp_path / 'ball.gif'
    assert main(['play', file, '--movie', str(movie), '--fps', '5', '--speed', speed, *SIZE]) == 0
    frames = iio.imread(movie)
    assert len(frames) == n_frames
    steps = np.diff([height(frame) for frame in frames[1:]])
    assert (steps * float(speed) < 0).all()  # up is a lower row
    assert [p.name for p in tmp_path.iterdir()] == ['ball.gif']


def test_a_movie_in_mp4_has_even_sides(file, tmp_path, capfd):
    ffmpeg = pytest.importorskip('imageio_ffmpeg')
    movie = tmp_path / 'ball.mp4'
    tokens = ['--seconds', '0.3', '--fps', '10', '--size', '63x47', '--clip', '1']
    assert main(['play', file, '--movie', str(movie), *tokens]) == 0
    assert ffmpeg.count_frames_and_secs(movie)[0] == 3
    assert 'WARNING' not in capfd.readouterr().err  # the writer would have resized it


def test_a_movie_that_fails_leaves_what_was_there(file, tmp_path, monkeypatch, capsys):
    movie = tmp_path / 'ball.gif'
    movie.write_text('before')

    def full(*_, **__):
        raise OSError('disk full')

    monkeypatch.setattr('pvibr.capture.movies._write_gif', full)
    assert main(['play', file, '--movie', str(movie), *SIZE]) == 2
    assert 'disk full' in capsys.readouterr().err
    assert movie.read_text() == 'before'
    monkeypatch.undo()
    assert main(['play', file, '--movie', str(movie), *SIZE]) == 0
    assert [p.name for p in tmp_path.iterdir()] == ['ball.gif']


@pytest.mark.parametrize(
    ('tokens', 'named'),
    [
        (['--time', '0', '--clip', 'fly'], "'rise', 'turn'"),
        (['--time', '0', '--clip', '7'], "'rise', 'turn'"),
        (['--movie', 'a.xyz'], '.mp4'),
        (['--movie', 'a.gif', '--time', '1'], 'one of them'),
        (['-o', 'a.xyz'], '.png'),
        (['-o', 'nowhere/a.png'], 'nowhere'),
        (['--time', 'nan'], 'finite'),
        (['--speed', '0'], 'other than 0'),
        (['--fps', '0'], 'positive'),
        (['--seconds', '-1'], 'positive'),
        (['--skinning', 'x'], 'dual'),
    ],
)
def test_bad_arguments(file, capsys, tokens, named):
    assert main(['play', file, *tokens]) == 2
    assert named in capsys.readouterr().err


def test_bad_files(tmp_path, capsys):
    assert main(['play', str(tmp_path / 'nothing.glb')]) == 2
    assert 'nothing.glb' in capsys.readouterr().err
    still, text = tmp_path / 'still.glb', tmp_path / 'text.glb'
    Figure([FigureMesh(pv.Cube().triangulate())]).save(still)
    text.write_text('no glTF')
    assert main(['play', str(still), '--movie', str(tmp_path / 'a.gif')]) == 2
    assert 'moves' in capsys.readouterr().err
    assert main(['play', str(text), '--time', '0']) == 2
    assert capsys.readouterr().err.count('\n') == 1


def test_keys_pause_and_change_the_clip(file):
    pl = pv.Plotter(window_size=(32, 32))
    actor = pl.ibr.add_animated(file)
    keys = _Keys(pl, actor.figure, actor, actor.figure.clips[0], 1.0)
    keys.pause()
    assert pl.ibr.playing
    keys.pause()
    assert not pl.ibr.playing
    keys.next()
    pl.ibr.time = 1.0
    assert actor.center[2] == pytest.approx(0.5, abs=1e-3)
