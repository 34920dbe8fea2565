"""Rows of textures that the figures of a window share."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.figures import animated_actor
from pvibr.figures.pose_sheet import WIDTH, PoseSheet, RowPool
from pvibr.figures.posing import Posing
from pvibr.gl import Texture
from pvibr.gl.hidden_window import hidden_window
from tests.animation.conftest import refused
from tests.figures.makers import bend, growing, worm


def shown(figures, **look):
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    actors = [pl.ibr.add_animated(figure, **look) for figure in figures]
    pl.show(auto_close=False)
    return pl, actors


def check(actor):
    """Posed points as the GPU has them are those of the float64 reference."""
    for index, points, _ in actor.download_posed():
        expected, _ = actor.figure.posed(index, actor.pose, actor.skinning, actor.bulge)
        assert np.abs(points - expected).max() <= 1e-5 * np.ptp(expected, axis=0).max()


def test_rows_keep_their_texels_while_others_come_and_go():
    rng = np.random.default_rng(5)
    with hidden_window() as (window, _):
        rows, held = RowPool(window, ('a', 'b')), {}
        staging = Texture(window), Texture(window)
        for turn in range(60):
            if held and rng.random() < (0.3 if turn < 30 else 0.8):
                first = list(held)[rng.integers(len(held))]
                rows.give(first, len(held.pop(first)[0]))
            else:
                images = rng.random((2, rng.integers(1, 9), WIDTH, 4), np.float32)
                first = rows.take(images.shape[1])
                pairs = zip(staging, images, strict=True)
                rows.write(first, images.shape[1], [t.upload(image) for t, image in pairs])
                held[first] = images
            end = max((first + len(images[0]) for first, images in held.items()), default=0)
            assert end <= rows.height <= 4 * end
        for first, images in held.items():
            assert np.array_equal(rows.download(first, len(images[0])), images)
        for first, images in held.items():
            rows.give(first, len(images[0]))
        assert rows.nbytes == 0
        for texture in staging:
            texture.release()


def test_one_pass_poses_all_that_moved(monkeypatch):
    passes = []
    drawing = RowPool.drawing
    monkeypatch.setattr(RowPool, 'drawing', lambda rows: passes.append(rows) or drawing(rows))
    figures = [worm(k=k) for k in (1, 2, 3, 4, 5)] + [worm(n_morphs=2), growing()]
    pl, actors = shown(figures)
    assert len({actor._posing.gpu._sheet for actor in actors}) == 1
    for angle in (0.1, 0.4):
        for actor in actors[1:-1]:
            actor.pose = bend(actor.figure, angle)
        pl.ibr.time += 0.7
        passes.clear()
        pl.render()
        # Key frames are written elsewhere.
        assert passes.count(actors[0]._posing.gpu._sheet.posed) == 1
    for actor in actors:
        check(actor)
    passes.clear()
    pl.render()
    assert not passes
    pl.close()


def test_one_that_fails_does_not_stop_the_others(monkeypatch):
    draw, failures = animated_actor.draw_together, [RuntimeError('no memory')]

    def fails_once(passes):
        if failures:
            raise failures.pop()
        draw(passes)

    monkeypatch.setattr(animated_actor, 'draw_together', fails_once)
    with pytest.warns(UserWarning, match='no memory'):
        pl, actors = shown([worm(k=k) for k in (1, 2, 3)])
    assert [actor.enabled for actor in actors] == [False, True, True]
    for actor in actors[1:]:
        check(actor)
    pl.close()


def test_ways_of_skinning_side_by_side():
    figures = [worm(k=k) for k in (4, 5, 8, 1, 4, 4)]
    pl, actors = shown(figures)
    for i, actor in enumerate(actors):
        actor.pose = bend(actor.figure, 0.1 * i)
        actor.skinning, actor.bulge = ('dual', 'linear')[i % 2], (1.0, 0.5, 0.5)[i % 3]
    pl.render()
    for actor in actors:
        check(actor)
    pl.close()


def test_rows_of_removed_figures_are_used_again():
    pl, actors = shown([worm() for _ in range(6)])
    sheet = actors[0]._posing.gpu._sheet
    before = sheet.posed.height
    for i in (1, 4, 2):
        pl.remove_actor(actors[i])
        pl.render()
        actors[i] = pl.ibr.add_animated(worm(k=i), skinning='dual')
        actors[i].pose = bend(actors[i].figure, 0.2 * i)
        pl.render()
    assert sheet.posed.height == before
    for actor in actors:
        assert actor._posing.gpu._sheet is sheet
        check(actor)
    for actor in actors:
        pl.remove_actor(actor)
    pl.render()
    assert sheet.posed.nbytes == sheet.rest.nbytes == 0
    pl.close()


def test_another_sheet_where_one_is_full(monkeypatch):
    monkeypatch.setattr('pvibr.figures.pose_sheet.texture_limit', lambda _window: 16)
    pl, actors = shown([worm(k=k) for k in (1, 2, 3, 4, 5)])
    for actor in actors:
        actor.pose = bend(actor.figure, 0.3)
    pl.render()
    sheets = {actor._posing.gpu._sheet for actor in actors}
    assert len(sheets) > 1
    assert all(sheet.posed.height <= 16 for sheet in sheets)
    images = []
    for actor in actors:
        check(actor)
        for other in actors:
            other.visibility = other is actor
        pl.render()
        images.append(pl.screenshot(return_img=True))
        assert (images[-1] != images[-1][0, 0]).any()
    pl.close()


def test_windows_have_their_own_sheets():
    figure = worm()
    plots = [shown([figure]) for _ in range(2)]
    sheets = [actors[0]._posing.gpu._sheet for _, actors in plots]
    assert sheets[0] is not sheets[1]
    plots[0][0].close()
    pl, (actor,) = plots[1]
    actor.pose = bend(figure, 0.3)
    pl.render()
    check(actor)
    pl.close()


def test_subplots_share_a_sheet():
    pl = pv.Plotter(off_screen=True, window_size=(96, 48), shape=(1, 2))
    actors = []
    for i in range(2):
        pl.subplot(0, i)
        actors.append(pl.ibr.add_animated(worm(k=3 + i)))
        actors[-1].pose = bend(actors[-1].figure, 0.3)
    pl.show(auto_close=False)
    image = pl.screenshot(return_img=True)
    assert actors[0]._posing.gpu._sheet is actors[1]._posing.gpu._sheet
    for actor, half in zip(actors, np.split(image, 2, 1), strict=True):
        check(actor)
        assert (half != half[0, 0]).any()
    pl.close()


@pytest.mark.parametrize('successes', range(5))
def test_what_cannot_be_loaded_leaves_no_rows(successes, monkeypatch):
    """An upload that the driver refuses, of the first or of another texture or mesh."""
    pl, (actor,) = shown([worm()])
    rest = [mesh_actor.rest_mesh for mesh_actor in actor._posed] * 2
    pl.close()
    upload, left = Texture.upload, iter(range(successes))

    def refuse(self, array):
        if next(left, None) is None:
            raise RuntimeError('the driver refused')
        return upload(self, array)

    with hidden_window() as (window, _):
        sheet = PoseSheet(window)
        monkeypatch.setattr('pvibr.figures.posing.sheet_with_room', lambda *_: sheet)
        monkeypatch.setattr(Texture, 'upload', refuse)
        refused('the driver refused', Posing, window, rest, kind=RuntimeError)
        assert sheet.posed.height == sheet.rest.height == 0
        assert sheet.posed.nbytes == sheet.rest.nbytes == 0
