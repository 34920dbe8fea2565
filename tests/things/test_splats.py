"""Gaussian points look as in a plain plotter where the scene is drawn into floats."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import place, plotter, shot

SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'
BLACK = np.zeros((4, 4, 3), np.uint8)
BESIDE = {
    'floats': lambda: [pvibr.ShaderEffect(SAME, needs_hdr=True)],
    'behind': lambda: [pvibr.Backdrop(BLACK, opacity=1e-9)],
    'both': lambda: [pvibr.Sky(opacity=1e-9), pvibr.ShaderEffect(SAME, needs_hdr=True)],
}


def pictures(effects, look, samples):
    """Return the first picture and one of more points."""
    pl = plotter((90, 70))
    pl.render_window.SetMultiSamples(samples)
    pl.set_background('steelblue')
    points = np.random.default_rng(7).normal(0, 0.4, (200, 3))
    look = {'style': 'points_gaussian', 'color': 'blue', 'point_size': 25, **look}
    look |= {'render_points_as_spheres': True, 'opacity': 0.5}
    pl.add_mesh(pv.PolyData(points), **look)
    for effect in effects:
        pl.ibr.add(effect)
    place(pl, (0, -6, 1))
    pl.show(auto_close=False)
    found = [shot(pl)]
    pl.add_mesh(pv.PolyData(points * 0.5 + 0.3), name='more', **look)
    place(pl, (0, -6, 1))
    found.append(shot(pl))
    pl.close()
    return np.array(found)


@pytest.mark.parametrize(
    ('name', 'look', 'samples'),
    [
        ('floats', {'emissive': True}, 0),
        ('behind', {'emissive': True, 'color': 'orange'}, 0),
        ('both', {'emissive': True}, 4),
        ('floats', {'emissive': False}, 0),
    ],
)
def test_gaussian_points_are_those_of_a_plain_plotter(name, look, samples):
    off = pictures([], look, samples)
    on = pictures(BESIDE[name](), look, samples)
    assert np.ptp(off[0], axis=(0, 1)).max() > 60
    assert np.abs(on - off).max() <= 3
