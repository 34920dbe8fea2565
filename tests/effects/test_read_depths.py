"""Effects say whether they read depth: only then instances draw that of their surfaces."""

import numpy as np
import pytest
import pyvista as pv

import pvibr

IDENTITY = 'vec4 effect(vec2 uv) { return color_at(uv); }'
DISTANT = 'vec4 effect(vec2 uv) { return color_at(uv) * min(depth_at(uv), 1.0); }'


class Fade(pvibr.Effect):
    """An effect as users write it."""

    def render(self, frame, picture):
        """Draw nothing."""


def field(monkeypatch):
    monkeypatch.setattr('pvibr.instances.levels._GRID', (8, 32))
    pl = pv.Plotter(off_screen=True, window_size=(160, 120))
    pl.disable_anti_aliasing()
    grid = np.stack(np.meshgrid(*[np.arange(6)] * 3), -1).reshape(-1, 3)
    balls = pl.ibr.add_instances(pv.Sphere(), 0.9 * grid, bake=True, force_level='parallax')
    pl.show(auto_close=False)
    return pl, balls


@pytest.mark.parametrize(
    ('effect', 'reads_depth'),
    [
        (pvibr.Bloom(), False),
        (pvibr.ToneMapping(), False),
        (pvibr.Sky(), False),
        (pvibr.Vignette(), False),
        (pvibr.ShaderEffect(IDENTITY), False),
        (pvibr.ShaderEffect('// depth_at\n' + IDENTITY), False),
        (pvibr.ShaderEffect(DISTANT), True),
        (pvibr.Fog(), True),
        (pvibr.AmbientOcclusion(), True),
        (pvibr.DepthOfField(), True),
        (Fade(), True),
    ],
    ids=lambda value: getattr(value, 'name', None),
)
def test_depth_is_drawn_for_what_reads_it(monkeypatch, effect, reads_depth):
    pl, balls = field(monkeypatch)
    pl.ibr.add(effect)
    pl.render()
    assert all(group.cards.deep == reads_depth for group in balls.groups)
    pl.close()


def test_an_effect_that_reads_none_changes_nothing(monkeypatch):
    pl, _ = field(monkeypatch)
    before = pl.image
    pl.ibr.add(pvibr.ShaderEffect(IDENTITY))
    pl.render()
    assert np.array_equal(pl.image, before)
    pl.close()
