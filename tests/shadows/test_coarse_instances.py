"""Cards that are coarser while the view moves do not shadow themselves."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.capture.adaptive_quality import AdaptiveQuality
from pvibr.instances.levels import make_model
from tests.instances.scenes import quick
from tests.makers import MATT


def fir():
    """Return cones on a trunk, which light from the side grazes."""
    cones = [
        pv.Cone(center=(0, 0, 0.18 * k), direction=(0, 0, 1), height=0.22, radius=r, resolution=30)
        for k, r in enumerate((0.42, 0.34, 0.26, 0.18))
    ]
    return pv.merge([pv.Cylinder(direction=(0, 0, 1), radius=0.06, height=0.6), *cones])


def rock():
    """Return a bumpy ball, which nearly touches those beside it."""
    ball = pv.Icosphere(nsub=4)
    waves = np.random.default_rng(6).normal(0, 2.5, (12, 3))
    ball.points *= 1 + 0.06 * np.sin(ball.points @ waves.T).sum(1, keepdims=True)
    return ball.scale(0.8)


@pytest.mark.parametrize(('make', 'gaps'), [(fir, (3.1, 1.9)), (rock, (2.1, 1.9))])
def test_lit_sides_stay_lit_at_a_lower_quality(monkeypatch, make, gaps):
    quick(monkeypatch)
    level = 'flat'
    monkeypatch.setitem(make_model.__kwdefaults__, 'tile', 32)
    quality = [1.0]
    monkeypatch.setattr(AdaptiveQuality, 'quality', lambda _self, _renderer: quality[0])
    pl = pv.Plotter(off_screen=True, window_size=(240, 180), lighting='none')
    pl.set_background('blue')
    pl.add_light(pv.Light(position=(5, -2, 2.0), light_type='scene light'))
    x, y = np.meshgrid(*np.outer(gaps, np.arange(-3, 4)))
    places = np.c_[(x + 0.37 * y).ravel(), y.ravel(), np.full(x.size, 0.5)]
    mesh = make().extract_surface(algorithm=None)
    firs = pl.ibr.add_instances(mesh, places, cache=False, bake=True, force_level=level, **MATT)
    shadows = pl.ibr.add(pvibr.Shadows())
    pl.camera_position = [(-3, -30, 15), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)

    def lit(force, how):
        firs.force_level, quality[0] = force, how
        found = []
        for shadows.enabled in (True, False):
            pl.camera.Modified()
            pl.render()
            found.append(pl.screenshot(return_img=True).astype(float))
        seen = (found[1][..., 2] < 200) & (found[1][..., 0] > 60)
        return (found[0][..., 0] / np.maximum(found[1][..., 0], 1))[seen]

    def dark(lit):
        return (lit < 0.5).mean()

    true, coarse = lit('mesh', 1.0), lit(level, 0.25)
    assert true.size > 500
    assert dark(true) < 0.08
    assert dark(coarse) < dark(true) + 0.005
    roof = pv.Plane(center=(15, -6, 6.5), direction=(5, -2, 2), i_size=40, j_size=40)
    pl.add_mesh(roof, color='black')
    assert dark(lit(level, 0.25)) > 0.98
