"""Receivers at the edges of triangles: no dots in creases, at lit edges and along silhouettes.

Some of a pixel's samples may lie in a triangle whose edges the pixel's middle is beyond.
"""

import numpy as np
import pytest
import pyvista as pv
from numpy.lib.stride_tricks import sliding_window_view

import pvibr
from tests.makers import MATT, lamp
from tests.pictures import off, place, shot, shown

pytestmark = pytest.mark.sampled

SAMPLES = (0, 4, 8)
METHODS = ('hard', 'pcf', 'pcss', 'volume')
#: Pixels along a side of one pixel in the supersampled truth.
FACTOR = 4


def plotter(size, samples):
    pl = pv.Plotter(off_screen=True, window_size=size, lighting='none')
    pl.render_window.SetMultiSamples(samples)
    pl.set_background('black')
    return pl


# -- shadows where no light is missing ----------------------------------------------------------


def room(pl, middle=(0, 0, 0), **looks):
    """Put a lamp into a box, and the eye into one of its corners."""
    mesh = pv.Cube(center=middle, x_length=6, y_length=6, z_length=6)
    pl.add_mesh(mesh, **MATT | looks)
    pl.add_light(lamp(np.add(middle, (0.3, -0.2, 0.1)), cone=180))
    place(pl, np.add(middle, (2.8, -2.8, 2.6)), np.add(middle, (-1, 1, -1)), angle=80)


def corner(pl, **light):
    """Light three walls that share no points, from in front of all of them."""
    for axis in np.eye(3):
        wall = pv.Plane(center=3 - 3 * axis, direction=axis, i_size=6, j_size=6)
        pl.add_mesh(wall, **MATT)
    pl.add_light(lamp((4.5, 4.2, 5.1), (1, 1, 1), **light))
    place(pl, (5.5, 5, 5.7), (1, 1, 1), angle=60)


LIT = {
    'a lamp in a room': room,
    'with edges shown': lambda pl: room(pl, show_edges=True),
    'far from the origin': lambda pl: room(pl, (2e4, -1e4, 3e4)),
    'a spot in a corner': lambda pl: corner(pl, cone=60),
    'the sun in a corner': corner,
}


@pytest.mark.parametrize('samples', SAMPLES)
@pytest.mark.parametrize('scene', LIT)
def test_no_shadows_in_creases(scene, samples):
    """What a light sees of planes that meet is lit up to the crease."""
    pl = plotter((150, 150), samples)
    LIT[scene](pl)
    plain = shown(pl)
    assert (plain > 20).mean() > 0.5
    shadows = pl.ibr.add(pvibr.Shadows())
    for method in METHODS:
        shadows.method = method
        assert (off(shot(pl), plain) > 1).sum() == 0, method


# -- beside the supersampled truth --------------------------------------------------------------


def boxes(pl, looks):
    """Stack turned boxes on a floor."""
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), **looks)
    floor = 0.0
    for k, (width, height) in enumerate([(2.4, 0.6), (1.6, 0.8), (0.9, 0.5)]):
        middle = 0.1 * k, -0.07 * k, floor + height / 2
        box = pv.Cube(center=middle, x_length=width, y_length=width, z_length=height)
        pl.add_mesh(box.rotate_z(17 * k, point=(0, 0, 0)), **looks)
        floor += height
    place(pl, (5, -4, 4.5), (0, 0, 0.8), angle=30)


def dots(pictures):
    """Count pixels beyond all that the truth shows in them and next to them."""
    picture, truth = pictures
    around = np.pad(truth, ((1, 1), (1, 1), (0, 0)), mode='edge')
    side = FACTOR + 2
    windows = sliding_window_view(around, (side, side), axis=(0, 1))[::FACTOR, ::FACTOR]
    beyond = np.maximum(windows.min((-1, -2)) - picture, picture - windows.max((-1, -2)))
    return int((beyond.max(-1) > 6).sum())


def with_truth(draw):
    """Return a multisampled picture, and one of more pixels without samples."""
    pictures = []
    for factor, samples in ((1, 8), (FACTOR, 0)):
        pl = plotter((240 * factor, 180 * factor), samples)
        draw(pl)
        shown(pl)
        pictures.append(shot(pl))
        pl.close()
    return pictures


LIGHTS = {
    'sun behind': lambda: lamp((-3, -2, 6)),
    'sun in front': lambda: lamp((3, -3.5, 5)),
    'lamp behind': lambda: lamp((-3, -2, 6), cone=60),
}


@pytest.mark.parametrize('method', ['hard', 'pcf', 'pcss'])
@pytest.mark.parametrize('light', LIGHTS)
def test_shadows_of_boxes_that_touch(light, method):
    """The middle of a pixel of the floor may be within the box that stands on it."""

    def draw(pl):
        boxes(pl, MATT | {'ambient': 0.1})
        pl.add_light(LIGHTS[light]())
        pl.ibr.add(pvibr.Shadows(method=method))

    assert dots(with_truth(draw)) <= 1


# -- pictures from cameras ----------------------------------------------------------------------

GREEN = np.zeros((8, 8, 3))
GREEN[..., 1] = 1
ABOVE = pvibr.Orthographic.from_extent(-10.001, 10.001, -10.001, 10.001)


def hills(pl, looks):
    """Add hills that nothing hides from above, as wide as an orthophoto of them."""
    y, x = np.mgrid[-10:10:48j, -10:10:48j]
    heights = -0.5 * (1.2 + np.sin(1.3 * x)) * np.cos(1.7 * (y + 10))
    pl.add_mesh(pv.StructuredGrid(x, y, heights), **looks)
    place(pl, (3, -24, 5), angle=42)


def seen_from(position):
    view = pv.Camera()
    view.position, view.focal_point, view.up, view.view_angle = position, (0, 0, 0), (0, 1, 0), 70
    return view


PAINTED = {
    'above': lambda: pvibr.Projector(GREEN, ABOVE),
    'both sides': lambda: pvibr.Projector(GREEN, ABOVE, max_angle=180),
    'no occlusion': lambda: pvibr.Projector(GREEN, ABOVE, occlusion=False),
    'shaded': lambda: pvibr.Projector(GREEN, ABOVE, lit=True),
    'from a point': lambda: pvibr.Projector(GREEN, seen_from((0, 0, 30))),
    'two pictures': lambda: pvibr.Projector([GREEN, GREEN], [ABOVE, seen_from((2, 3, 25))]),
}
LOOKS = {
    'unlit': {'lighting': False},
    'lit': {},
    'smooth': {'smooth_shading': True},
    'edges': {'lighting': False, 'show_edges': True, 'edge_color': 'magenta'},
}


@pytest.mark.parametrize('samples', SAMPLES)
@pytest.mark.parametrize('looks', LOOKS)
def test_hills_are_painted_up_to_the_skyline(looks, samples):
    pl = plotter((200, 150), samples)
    pl.add_light(lamp((0, -10, 20)))
    hills(pl, {'color': 'magenta'} | LOOKS[looks])
    shown(pl)
    for name, make in PAINTED.items():
        projector = pl.ibr.add(make())
        picture = shot(pl)
        assert (picture[..., 1] > 20).mean() > 0.2, name
        assert (picture[..., 0] > 1).sum() <= 3, name  # crests in rounding of the depth map
        pl.ibr.remove(projector)


@pytest.mark.parametrize('position', [(3, -3.5, 5), (4, 4, 3)])
def test_pictures_on_boxes_that_touch(position):
    def draw(pl):
        boxes(pl, {'color': 'magenta', 'lighting': False})
        pl.ibr.add(pvibr.Projector(GREEN, seen_from(position), max_angle=180))

    assert dots(with_truth(draw)) <= 1
