"""A colour with alpha for each instance, against plain actors with an opacity each."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr

SIZE = 150, 120
CAMERA = [(9, 8, 7), (2, 2, 2), (0, 0, 1)]


def scene(seed=3, count=9):
    rng = np.random.default_rng(seed)
    rgba = rng.integers(0, 255, (count, 4)).astype(np.uint8)
    rgba[::2, 3] = 255
    return pv.Sphere(radius=0.6), rng.uniform(0, 4, (count, 3)), rgba


def shot(add):
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    things = add(pl)
    pl.camera_position = CAMERA
    picture = pl.screenshot().astype(float)
    return pl, things, picture


def plain(mesh, places, rgba, opacity=1.0):
    def add(pl):
        for place, (*color, alpha) in zip(places, rgba, strict=True):
            pl.add_mesh(
                mesh.translate(place, inplace=False), color=color, opacity=opacity * alpha / 255
            )

    return shot(add)[2]


@pytest.mark.parametrize(('seed', 'opacity'), [(3, 1.0), (11, 0.5)])
def test_as_plain_actors(seed, opacity):
    mesh, places, rgba = scene(seed)
    pl, things, ours = shot(
        lambda pl: pl.ibr.add_instances(mesh, places, colors=rgba, opacity=opacity)
    )
    theirs = plain(mesh, places, rgba, opacity)
    assert np.ptp(theirs) > 50
    assert np.abs(ours - theirs).max() <= 3
    np.testing.assert_array_equal(things.colors, rgba)
    pl.close()


def test_alpha_comes_and_goes():
    mesh, places, rgba = scene()
    pl, things, before = shot(lambda pl: pl.ibr.add_instances(mesh, places, colors=rgba[:, :3]))
    things.colors = rgba
    pl.render()
    assert np.abs(pl.screenshot() - plain(mesh, places, rgba)).max() <= 3
    rgba[1] = 10, 200, 30, 99
    things.update(ids=[1], colors=rgba[1:2])
    pl.render()
    assert np.abs(pl.screenshot() - plain(mesh, places, rgba)).max() <= 3
    things.colors = scene()[2][:, :3]
    assert things.colors.shape == (9, 3)
    pl.render()
    np.testing.assert_array_equal(pl.screenshot(), before)
    pl.close()


def test_others_name_what_they_have_instead():
    _, places, rgba = scene()
    images = np.full((8, 8, 3), 255, np.uint8)
    with pytest.raises(ValueError, match=r'colors\[\d\] must be opaque; set opacity'):
        pvibr.Billboards(places, images, size=1.0, colors=rgba)
    opaque = pvibr.Billboards(places, images, size=1.0, colors=rgba | [0, 0, 0, 255])
    assert opaque.colors.shape == (9, 3)
