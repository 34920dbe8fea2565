import json
import sys

import imageio.v3 as iio
import imageio_ffmpeg
import numpy as np
import pytest

from pvibr.cli import demo
from pvibr.instances.levels import make_model
from pvibr.scenes.landscape import landscape

pytestmark = pytest.mark.slow
SIZE = (160, 96)


@pytest.fixture(autouse=True)
def light_trees(monkeypatch, small_trees, tmp_path_factory):
    """Trees that bake quickly, into an empty cache: what the commands do is the same."""
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path_factory.mktemp('cache')))
    monkeypatch.setattr(demo, 'landscape', lambda n: landscape(n, triangles=6_000))
    monkeypatch.setitem(make_model.__kwdefaults__, 'views', 8)


def test_demo_writes_pictures_and_numbers(tmp_path, capsys):
    demo.main(out=tmp_path, count=40, frames=3, size=SIZE)
    names = {'off.png', 'on.png', 'error.png', 'demo.png', 'demo.json'}
    assert {file.name for file in tmp_path.iterdir()} == names
    off, on = (iio.imread(tmp_path / f'{name}.png') for name in ('off', 'on'))
    assert off.shape == on.shape == (SIZE[1], SIZE[0], 3)
    assert np.abs(off.astype(float) - on).mean() < 8
    numbers = json.loads((tmp_path / 'demo.json').read_text())
    assert numbers['instances'] == 40
    ways = {'pvibr', 'VTK glyphs', 'VTK glyphs, culling + LOD'}
    assert ways == set(numbers['milliseconds'])
    assert ways - {'pvibr'} == set(numbers['speed_up'])
    for by_samples in numbers['milliseconds'].values():
        assert list(by_samples) == ['8', '0']  # defaults first
        assert all(set(ms) == {'CPU', 'wall'} for ms in by_samples.values())
    assert len(numbers['error']) == 4
    for name, error in numbers['error'].items():
        assert 0 <= error['flip'] < 0.2
        assert ('iou' in error) is name.endswith(' 0 samples')
        assert 0 < error.get('iou', 1) <= 1
    assert set(numbers['first_frame']) == {'empty cache', 'images in the cache'}
    said = capsys.readouterr().out
    assert 'FLIP' in said
    assert 'pvibr' in said
    # What is not extrapolated is not said to be.
    assert 'extrapolated' not in said


def test_a_movie_has_its_frames(tmp_path):
    file = tmp_path / 'walk.mp4'
    demo.main(out=tmp_path, count=20, frames=4, size=SIZE, movie=file)
    assert imageio_ffmpeg.count_frames_and_secs(str(file))[0] == 4
    assert not (tmp_path / 'demo.json').exists()


def test_a_movie_without_its_extra_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'imageio_ffmpeg', None)
    with pytest.raises(ImportError, match=r'pvibr\[movie\]'):
        demo.main(out=tmp_path, count=20, movie=tmp_path / 'walk.mp4')
