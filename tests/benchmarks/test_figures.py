"""What the bench of figures measures: its figures, its peers, its table."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import figures, main
from benchmarks.figures import errors as figures_errors
from benchmarks.figures import models as figures_models
from benchmarks.figures import peers as figures_peers


def test_the_tube_moves_and_ends_where_it_began():
    figure = figures_models.tube(20, 12, 6)
    clip = figure.clips[0]
    start, middle, end = (
        figure.posed(0, figure.sample(t, loop=False))[0]
        for t in (0, clip.duration / 2, clip.duration)
    )
    np.testing.assert_allclose(start, end, atol=1e-12)
    assert np.abs(middle - start).max() > 1


def test_few_triangles_keep_all_vertices():
    whole, few = (figures_models.tube(20, 12, 6, every=every) for every in (1, 10))
    assert few.meshes[0].mesh.n_points == whole.meshes[0].mesh.n_points
    assert few.meshes[0].mesh.n_cells < whole.meshes[0].mesh.n_cells / 9


def test_a_tube_faces_outward():
    for figure in (figures_models.tube(20, 12, 6), figures_models.swelling(20, 12)):
        body = figure.meshes[0]
        normals = body.mesh.compute_normals(point_normals=False, consistent_normals=False)
        corners = body.points[body.mesh.regular_faces].mean(1)
        assert (np.asarray(normals['Normals'])[:, :2] * corners[:, :2]).sum(1).min() > 0


def test_numpy_poses_as_the_reference_does():
    figure = figures_models.tube(20, 12, 6)
    peer = figures_peers.NumpySkinning(figure.meshes[0])
    pose = figure.sample(0.7)
    peer.pose(figure.world(pose))
    points, normals = figure.posed(0, pose)
    np.testing.assert_allclose(peer.mesh.points, points, atol=1e-5)
    np.testing.assert_allclose(peer.mesh.point_data['Normals'], normals, atol=0.02)


def test_the_gpu_is_compared_with_float64():
    figure = figures_models.tube(20, 12, 6, offset=1e6)
    with figures_errors.shown(figure) as actor:
        actor.pose = figure.sample(0.4)
        actor.pipeline.window.Render()
        position, degrees = figures_errors.gpu_errors(actor)
        assert 0 < position < 1e-5
        assert 0 < degrees < 0.1
        # What is compared is what was drawn.
        figure.meshes[0].points[:] += 1.0
        assert figures_errors.gpu_errors(actor)[0] > 0.1


def test_vtk_reads_what_a_figure_writes(tmp_path):
    figure = figures_models.tube(20, 12, 6)
    figure.save(tmp_path / 'tube.glb')
    assert figures_peers.reader_error(tmp_path / 'tube.glb', figure, 5, 1) < 1e-5
    figure.meshes[0].points[:, 0] += 1.0
    assert figures_peers.reader_error(tmp_path / 'tube.glb', figure, 2, 1) > 0.05


@pytest.mark.parametrize(('degrees', 'left'), [(90, 0.5), (150, 0.067)])
def test_linear_blending_loses_its_cross_section(degrees, left):
    assert figures_errors.cross_section(degrees, 'linear') == pytest.approx(left, abs=1e-3)
    assert figures_errors.cross_section(degrees, 'dual') == pytest.approx(1)


@pytest.mark.bench
def test_quick_bench_runs(tmp_path):
    rows = main('figures', out=tmp_path, quick=True).rows
    assert len(rows) > 30
    found = json.loads((tmp_path / 'bench_figures.json').read_text())
    assert len(found['points']['poses']) == len(figures.BENCH.extent(quick=True).figures)
    assert (tmp_path / 'bench_figures.png').is_file()
