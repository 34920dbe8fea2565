"""Pictures of any size: where tiles lie, and that nobody sees where."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

import pvibr
from pvibr.capture import tiled_screenshot as large
from pvibr.capture.tiled_screenshot import spans
from pvibr.core.passes import margins
from tests.refusals import refused

SIZE = (150, 100)


@given(st.integers(1, 60), st.integers(1, 20), st.integers(0, 30))
def test_tiles_give_each_pixel_once_and_not_from_their_ends(tile, scale, margin):
    margin = min(margin, int(0.4 * tile))
    whole = tile * scale
    done = 0
    for begin, first, last in spans(whole, tile, margin):
        assert first == done
        assert 0 <= begin <= whole - tile
        assert first - begin >= margin or begin == 0
        assert begin + tile - last >= margin or begin + tile == whole
        assert last > first
        done = last
    assert done == whole


def scene(size, times=1, **options):
    pl = pv.Plotter(off_screen=True, window_size=size, **options)
    rng = np.random.default_rng(1)
    for k in range(2 if options else 1):
        if options:
            pl.subplot(0, k)
        for center in rng.uniform(-1, 1, (9, 3)) * [1, 4, 1]:
            pl.add_mesh(pv.Sphere(radius=0.3, center=center), color=rng.uniform(0, 1, 3))
        pl.camera_position = [(0, -9, 2), (0, 0, 0), (0, 0, 1)]
        pl.camera.SetWindowCenter(0.2, 0.1)
        if k:
            pl.camera.parallel_projection = True
            pl.camera.parallel_scale = 2
        pl.ibr.add(pvibr.DepthOfField(radius=0.3, distance=9.0))
        pl.ibr.add(pvibr.Outline(width=1.5 * times))
    return pl


@pytest.mark.slow
@pytest.mark.parametrize('options', [{}, {'shape': (1, 2)}], ids=['one', 'two'])
def test_a_large_picture_is_that_of_a_large_window(options):
    small, big = scene(SIZE, **options), scene([4 * n for n in SIZE], 4, **options)
    before = small.camera_position, small.camera.view_angle
    expected = np.asarray(big.screenshot(return_img=True), int)
    found = small.ibr.screenshot(scale=4).astype(int)
    off = np.abs(found - expected).max(-1)
    assert (off > 12).sum() <= 5  # where a sample lies on an edge, rounding decides
    assert off.mean() < 0.05
    # VTK's own tiles have seams: a lens knows nothing beyond their borders.
    seams = np.abs(np.asarray(small.screenshot(scale=4, return_img=True), int) - expected).max()
    assert seams > 2 * off.max()
    assert (small.camera_position, small.camera.view_angle) == before
    np.testing.assert_array_equal(
        small.ibr.screenshot(), np.asarray(small.screenshot(return_img=True))
    )


def test_linked_subplots_have_tiles_of_their_own():
    def shot(pl, take):
        for k in (0, 1):
            pl.subplot(0, k)
            pl.add_mesh(pv.Cone(), color='red' if k else 'blue')
        pl.link_views()
        pl.camera_position = [(0, -9, 2), (0, 0, 0), (0, 0, 1)]
        return take(pl).astype(int)

    small = pv.Plotter(off_screen=True, window_size=SIZE, shape=(1, 2), border=False)
    big = pv.Plotter(off_screen=True, window_size=(300, 200), shape=(1, 2), border=False)
    found = shot(small, lambda pl: pl.ibr.screenshot(scale=2))
    expected = shot(big, lambda pl: np.asarray(pl.screenshot(return_img=True)))
    assert np.abs(found - expected).max() <= 2


def test_tiles_overlap_by_what_effects_of_the_last_subplot_look_at():
    def shot(size, **how):
        pl = pv.Plotter(off_screen=True, window_size=size, shape=(1, 2), border=False)
        pl.subplot(0, 1)
        for k in range(5):
            ball = pv.Sphere(center=(k / 2 - 1, k - 2, k / 4), radius=0.4)
            pl.add_mesh(ball, color='wheat', lighting=False)
        pl.camera_position = [(0, -7, 2), (0, 0, 0), (0, 0, 1)]
        pl.ibr.add(pvibr.DepthOfField(radius=0.05, distance=7.0))
        found = np.asarray(pl.ibr.screenshot(**how)).astype(int)
        pl.close()
        return found

    off = np.abs(shot(SIZE, scale=2) - shot((300, 200)))
    assert (off.max(-1) > 12).mean() < 0.004


@pytest.mark.parametrize('port', [(0.5, 0, 0.5, 1), (0.5, 0.5, 1, 0.5), (0.5, 0, 0.502, 1)])
def test_subplots_without_pixels_are_left_out(port):
    pl = pv.Plotter(off_screen=True, window_size=(96, 64), shape=(1, 2), border=False)
    pl.subplot(0, 1)
    pl.ibr.add_instances(pv.Cube(), [[0, 0, 0], [1, 0, 0]])
    pl.ibr.add(pvibr.DepthOfField(radius=0.05))
    pl.renderer.SetViewport(*port)
    assert margins(pl.renderer, (0, 0)) == (1.0, 1.0)
    assert pl.ibr.screenshot(scale=2).shape == (128, 192, 3)
    assert pl.ibr.pick(70, 30) is None


@pytest.mark.parametrize(
    ('size', 'window'),
    [
        ((333, 222), SIZE),
        ((17000, 40), (1600, 24)),  # wider than textures may be
        ((40, 3000), (24, 400)),
        ((10, 10), SIZE),
        ((1, 1), SIZE),
    ],
)
def test_any_size(size, window):
    pl = pv.Plotter(off_screen=True, window_size=window)
    pl.add_mesh(pv.Sphere(), color='red')
    pl.ibr.add(pvibr.Vignette())
    found = pl.ibr.screenshot(window_size=size)
    assert found.shape == (size[1], size[0], 3)
    assert tuple(pl.window_size) == window


def test_transparent_backgrounds():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    pl.add_mesh(pv.Sphere(), color='red', lighting=False)
    found = pl.ibr.screenshot(scale=2, transparent_background=True)
    assert found.shape == (200, 300, 4)
    assert found[0, 0, 3] == 0
    assert found[100, 150].tolist() == [255, 0, 0, 255]
    assert pl.ibr.screenshot().shape == (100, 150, 3)


def test_files_are_written_whole(tmp_path):
    pl = pv.Plotter(off_screen=True, window_size=(20, 10))
    pl.add_mesh(pv.Sphere())
    file = tmp_path / 'a.png'
    with pytest.raises(FileNotFoundError, match=r"filename = .*: there is no folder '.*new'"):
        pl.ibr.screenshot(tmp_path / 'new' / 'a.png')
    assert pl.ibr.screenshot(file, scale=2, return_img=False) is None
    assert pv.read(file).dimensions == (40, 20, 1)
    refused('unknown file extension', pl.ibr.screenshot, file.with_suffix('.xyz'))
    assert [p.name for p in file.parent.iterdir()] == ['a.png']


@pytest.mark.parametrize(
    'wrong',
    [
        {'scale': 0},
        {'scale': 1.5},
        {'scale': True},
        {'window_size': (0, 5)},
        {'window_size': (5,)},
        {'window_size': (5.5, 5)},
        {'window_size': 7},
        {'scale': 2, 'window_size': (5, 5)},
    ],
)
def test_wrong_sizes_are_named(wrong):
    pl = pv.Plotter(off_screen=True, window_size=(20, 10))
    refused(next(iter(wrong)), pl.ibr.screenshot, **wrong)
    pl.close()
    with pytest.raises(pvibr.ClosedError):
        pl.ibr.screenshot()


@pytest.mark.parametrize(('radius', 'expected'), [(None, 8), (1.0, 18), (2.5, 33), (90.0, 40)])
def test_tiles_overlap_by_what_ambient_occlusion_looks_at(radius, expected):
    pl = pv.Plotter(off_screen=True, window_size=(200, 100))
    pl.add_mesh(pv.Sphere())
    pl.camera_position = 'xy'
    pl.enable_parallel_projection()
    pl.parallel_scale = 5  # ten pixels a unit
    if radius:
        pl.enable_ssao(radius=radius)
    pl.render()
    found = large._margins(pl.render_window, {pl.renderer: pl.camera}, [], (200, 100), 1)
    assert found[1] == expected


def test_what_is_not_in_a_tile_is_not_drawn(capfd):
    pl = pv.Plotter(off_screen=True, window_size=(61, 40), shape=(1, 2))
    for k in (0, 1):
        pl.subplot(0, k)
        pl.add_mesh(pv.Sphere())
        pl.enable_eye_dome_lighting()
    pl.renderers[0].DrawOff()
    pl.ibr.screenshot(scale=3)
    assert 'incomplete' not in ''.join(capfd.readouterr())
    assert [renderer.GetDraw() for renderer in pl.renderers] == [0, 1]


@pytest.mark.sampled
@pytest.mark.parametrize(
    'how',
    [{'scale': 4}, {'window_size': (90, 130)}, {'transparent_background': True}, {'scale': 1}],
    ids=str,
)
def test_what_follows_is_the_scene_as_before(how):
    pl = scene(SIZE)
    pl.ibr.add_spheres(np.random.default_rng(5).uniform(-2, 2, (40, 3)), 0.2)
    pl.show(auto_close=False)
    before, rows = pl.screenshot(return_img=True), details(pl)
    pl.ibr.screenshot(**how)
    assert details(pl) == rows
    assert (pl.screenshot(return_img=True) == before).all()
    pl.render()
    assert (pl.screenshot(return_img=True) == before).all()


def details(pl):
    return [(row.effect, row.state, row.details) for row in pl.ibr.report().rows]
