"""Programs drawn as one do what they do one after the other."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl import fused
from tests.pictures import shown


def plotter(**options):
    pl = pv.Plotter(window_size=(120, 90), **options)
    pl.add_mesh(pv.Sphere(), color='tan')
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 4), np.uint8)
    for effect in (
        pvibr.ImageOverlay(image, opacity=0.6),
        pvibr.ImageOverlay(image, mode='multiply'),
        pvibr.NightVision(intensity=0.6),
        pvibr.Vignette(),
        pvibr.Flash(at=-0.1),
        pvibr.Iris(opening=0.6),
    ):
        pl.ibr.add(effect)
    return pl


def pictures(pl):
    return shown(pl), pl.screenshot(transparent_background=True).astype(int)


@pytest.fixture
def draw_sizes(monkeypatch):
    """The number of programs in each draw."""
    sizes, draw = [], fused.Fused._draw

    def counted(self, picture, points, *to):
        sizes.append(len(points))
        return draw(self, picture, points, *to)

    monkeypatch.setattr(fused.Fused, '_draw', counted)
    return sizes


@pytest.mark.parametrize('high', [False, True])
def test_as_one_and_one_after_the_other(high, draw_sizes, monkeypatch):
    pl = plotter()
    if high:
        pl.ibr.add(pvibr.ToneMapping(curve='aces'))
        pl.ibr.add(pvibr.Bloom(threshold=0.3))
    together = pictures(pl)
    assert set(draw_sizes) == {8 if high else 6}

    def one_by_one(self, picture, points, to=None):
        for point in points[:-1]:
            self._draw(picture, [point])
        return self._draw(picture, points[-1:], to)

    monkeypatch.setattr(fused.Fused, 'draw', one_by_one)
    for one, other in zip(together, pictures(pl), strict=True):
        assert np.abs(one - other).max() <= 1
    assert together[0].std() > 10


def test_what_has_many_textures_is_drawn_in_parts(draw_sizes):
    pl = plotter()
    images = np.random.default_rng(1).integers(0, 256, (9, 8, 8, 4), np.uint8)
    for image in images:
        pl.ibr.add(pvibr.ImageOverlay(image, opacity=0.3))
    pl.show(auto_close=False)
    assert max(draw_sizes) < 15
    assert len(draw_sizes) > 1


def test_names_do_not_meet():
    text = """// main is said here
uniform sampler2D color;
uniform vec2 size;
const float size_of = 1.0;
float much(vec2 at) { return size_of * length(at * size); }
void main() { if (much(uv) < 0.5) discard; gl_FragData[0] = texture(color, uv); }
"""
    found = fused.fuse([fused.Pointwise('a', text, {}, {}), fused.Pointwise('b', text, {}, {})])
    for name in ('size', 'size_of', 'much', 'main'):
        assert f'{name}_0' in found
        assert f'{name}_1' in found
    assert found.count('uniform sampler2D color') == 1
    assert 'discard' not in found


@pytest.mark.parametrize('tones', [False, True])
def test_light_in_a_part_of_the_picture_is_added_there_alone(tones, monkeypatch):
    """As a lamp's is: the same picture to a step, whether that is in a pass over all or not."""
    pl = pv.Plotter(off_screen=True, window_size=(120, 90))
    pl.set_background('#203040')
    pl.add_mesh(pv.Sphere(radius=0.03, center=(-0.4, 0.3, 0)), color='white', lighting=False)
    pl.add_mesh(pv.Cube(center=(0.3, -0.2, 0), x_length=0.4), color='tan', specular=0)
    if tones:
        pl.ibr.add(pvibr.ToneMapping())
    pl.ibr.add(pvibr.Bloom(0.9, levels=1))
    pl.camera_position = 'xy'
    found, local = [], fused._is_local
    for there in (local, lambda *_: False):
        asked = []
        monkeypatch.setattr(
            fused,
            '_is_local',
            lambda *a, there=there, asked=asked: asked.append(there(*a)) or asked[-1],
        )
        pl.show(auto_close=False) if not found else pl.render()
        found.append((pl.screenshot().astype(int), any(asked)))
    assert [was for _, was in found] == [True, False]
    assert np.abs(found[0][0] - found[1][0]).max() <= 1
    assert found[0][0].std() > 5
