"""What a frame asks of the GPU and of Python, beside what it asked when this was written.

A number that rises is a cost that was added: find out for what, or say so here.
"""

import sys

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.counts import Counts
from tests.figures.makers import bending, worm
from tests.pictures import place

BALL = pv.Sphere(theta_resolution=24, phi_resolution=20)
RNG_SEED = 4


def scattered(count, spread=50.0):
    rng = np.random.default_rng(RNG_SEED)
    return rng.uniform(-spread, spread, (count, 3)) * (1, 1, 0.1)


def instances(pl):
    pl.ibr.add_instances(BALL, scattered(10_000), bake=True)


def sets(pl):
    for k in range(5):
        pl.ibr.add_instances(BALL, np.add(scattered(100), (0, 0, k)), bake=True)


def crowd(pl):
    places = scattered(40, 12.0)
    crowd = pl.ibr.add_animated(worm(clips=[bending()]), places, show_scalar_bar=False)
    crowd.times = np.linspace(0, 2, 40)
    crowd.force_level = 'mesh'


def impostors(pl):
    actors = [pl.add_mesh(BALL.translate(at)) for at in scattered(30, 12.0)]
    pl.ibr.add_impostor(actors, only_if_faster=False)


def spheres(pl):
    pl.ibr.add_spheres(scattered(5_000), 0.5)


def with_effect(name, **settings):
    def fill(pl):
        for at in scattered(10, 12.0):
            pl.add_mesh(BALL.translate(at), color='white', specular=1.0)
        pl.ibr.add(getattr(pvibr, name)(**settings))

    return fill


SCENES = {
    'instances': (instances, Counts(3, 3, 3, 163_840)),
    'sets': (sets, Counts(14, 3, 3, 163_840)),
    'crowd': (crowd, Counts(21, 2, 0, 81_920)),
    'impostors': (impostors, Counts(1, 1, 1, 10_240)),
    'spheres': (spheres, Counts(3, 3, 3, 49_152)),
    'bloom': (with_effect('Bloom', threshold=0.5), Counts(10, 4, 14, 0)),
    'tone mapping': (with_effect('ToneMapping', auto=True), Counts(3, 3, 0, 0)),
    'outline': (with_effect('Outline'), Counts(5, 5, 0, 0)),
    'occlusion': (with_effect('AmbientOcclusion'), Counts(2, 2, 0, 0)),
    'depth of field': (with_effect('DepthOfField'), Counts(5, 5, 2, 0)),
    'hard shadows': (with_effect('Shadows', method='hard'), Counts(0, 0, 0, 0)),
    'soft shadows': (with_effect('Shadows', method='pcss'), Counts(0, 0, 0, 0)),
}


@pytest.mark.parametrize('name', SCENES)
def test_a_moving_camera(name, monkeypatch):
    monkeypatch.setenv('PVIBR_DRIVER', 'hardware')
    fill, expected = SCENES[name]
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    fill(pl)
    place(pl, (90, -80, 40) if name in ('instances', 'sets', 'spheres') else (30, -28, 15))
    pl.show(auto_close=False)
    for _ in range(4):
        pl.camera.Azimuth(0.5)
        pl.ibr.time += 0.05
        pl.render()
    counts = pl.ibr.report().counts
    for what, value in vars(counts).items():
        assert value <= getattr(expected, what), (what, str(counts))


@pytest.mark.parametrize('name', ['instances', 'impostors', 'spheres', 'crowd'])
def test_nothing_moves(name):
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    SCENES[name][0](pl)
    place(pl, (30, -28, 15))
    pl.show(auto_close=False)
    for _ in range(3):
        pl.render()
    counts = pl.ibr.report().counts
    assert counts.draws >= 1
    assert (counts.uploaded_bytes, counts.waits) == (0, 0), str(counts)
    assert counts.uniforms <= 6  # those in which draws of one program differ


def python_calls(draw) -> int:
    """Return the calls of functions and built-ins, which no machine changes."""
    count = 0

    def note(_frame, event, _argument):
        nonlocal count
        count += event in ('call', 'c_call')

    sys.setprofile(note)
    try:
        draw()
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize(
    ('name', 'moving', 'still'),
    [('instances', 900, 440), ('sets', 3_200, 1_560), ('crowd', 1_940, 740)],
)
def test_python_calls(name, moving, still, monkeypatch):
    monkeypatch.setenv('PVIBR_DRIVER', 'hardware')
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    SCENES[name][0](pl)
    place(pl, (30, -28, 15) if name == 'crowd' else (90, -80, 40))
    pl.show(auto_close=False)

    def move():
        pl.camera.Azimuth(0.5)
        pl.ibr.time += 0.05
        pl.render()

    for _ in range(5):
        move()
    assert python_calls(move) <= moving
    for _ in range(3):
        pl.render()
    assert python_calls(pl.render) <= still


def test_counts_are_those_of_the_last_frame():
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    spheres(pl)
    pl.show(auto_close=False)
    for _ in range(2):
        pl.camera.Azimuth(1.0)
        pl.render()
        first, text = pl.ibr.report().counts, str(pl.ibr.report())
    assert f'last frame: {first.draws} draws' in text
    pl.camera.Azimuth(1.0)
    pl.render()
    assert pl.ibr.report().counts == first
    assert pl.ibr.report().as_dict()['counts'] == vars(first)
