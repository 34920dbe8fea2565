"""The bench of billboards: what it draws, and that it runs."""

import numpy as np
import pytest

from benchmarks import main
from benchmarks.billboards import BENCH, sprites
from benchmarks.common.harness import Results


def test_a_far_cut_out_covers_what_it_should():
    image = sprites.foliage()
    share = (image[..., 3] >= 128).mean()
    assert abs(sprites.covered(image, 75, 'kept') / share - 1) < 0.1
    assert sprites.covered(image, 37, 'plain') < 0.8 * share


def test_results_are_a_plot(tmp_path):
    plant = {'flip': 0.1, 'iou': 0.9, 'ms': 3.0, 'triangles': 2, 'texels': 9}
    points = {
        'sprites': {'cut-outs': [(10, 1.0), (100, 2.0)]},
        'spheres': {'spheres': [(10, 1.0)]},
        'coverage': {'kept': [(32, 1.0)], 'plain': [(32, 0.5)]},
        'plants': {'billboard': plant},
    }
    BENCH.write('billboards', Results('a driver', {}, [], points), tmp_path)
    assert (tmp_path / 'bench_billboards.png').stat().st_size > 1000


def test_discs_are_round():
    image = sprites.disc(32)
    assert (image == image[::-1]).all()
    assert (image == image.swapaxes(0, 1)).all()
    assert np.ptp(image[..., 3]) == 255


@pytest.mark.bench
def test_quick_bench_runs(tmp_path):
    rows = main('billboards', out=tmp_path, quick=True).rows
    assert len(rows) > 30
    assert {file.suffix for file in tmp_path.iterdir()} == {'.json', '.png', '.txt'}
