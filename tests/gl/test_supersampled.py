"""Annotations under SSAA: with an effect that does nothing they are as without it, to the bit."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import plotter, shot, shown

SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'
HALF = 'vec4 effect(vec2 uv) { vec4 c = color_at(uv); return vec4(c.rgb * .5, c.a); }'


def scene(seed, size=(180, 130), **options):
    """Return a plotter under SSAA with labels, text and bar over a silhouette."""
    pl, rng = plotter(size, **options), np.random.default_rng(seed)
    pl.set_background('w')
    ball = pv.Sphere()
    ball['height'] = ball.points[:, 2]
    for place in range(len(pl.renderers)):
        pl.subplot(0, place)
        pl.add_mesh(ball.copy(), scalars='height', cmap='bwr', scalar_bar_args={'title': 'b'})
        points = rng.normal(size=(4, 3))
        points *= rng.uniform(0.4, 0.6, (4, 1)) / np.linalg.norm(points, axis=1)[:, None]
        # VTK alone shows labels that may be hidden in every second frame only.
        names = ['one', 'two', 'III', '4']
        pl.add_point_labels(points, names, font_size=14, always_visible=True)
        pl.add_text('text', font_size=9)
    pl.enable_anti_aliasing('ssaa')
    return pl


@pytest.mark.parametrize('kind', ['one', 'row', 'clear'])
def test_annotations_stay_to_the_bit(kind):
    def picture(effect, seed):
        pl = scene(seed, shape=(1, 2)) if kind == 'row' else scene(seed, (181, 97))
        if effect:
            pl.ibr.add(pvibr.ShaderEffect(SAME))
        shown(pl)
        return shot(pl, transparent_background=kind == 'clear')

    for seed in (1, 6):
        plain, on = picture(False, seed), picture(True, seed)
        assert plain.min() < 60
        np.testing.assert_array_equal(on[..., :3], plain[..., :3])
        # Alpha is that of both, each filtered alone: apart where edges of both share a pixel.
        assert np.abs(on - plain).mean() < 0.1


def test_annotations_lie_over_what_an_effect_makes():
    pl = scene(3)
    plain = shown(pl)
    half = pl.ibr.add(pvibr.ShaderEffect(HALF))
    dark = shot(pl)
    flat = [p for p in pl.renderer.GetViewProps() if p.GetBounds() is None]
    for prop in flat:
        prop.VisibilityOff()
    below = shot(pl)
    half.enabled = False
    bare = shot(pl)
    assert np.abs(below - bare / 2).max() <= 1
    away = np.ones(plain.shape[:2], bool)
    for y, x in np.argwhere((plain != bare).any(2)):
        away[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3] = False
    assert 0.2 < away.mean() < 0.9
    assert np.abs(dark - below)[away].max() <= 1
    assert ((plain < 20).all(2) & (dark > 20).any(2)).sum() == 0  # black letters stay so
    pl.ibr.clear()
    pl.disable_anti_aliasing()
    assert not any(p.GetObjectName().startswith('pvibr') for p in pl.renderer.GetViewProps())
