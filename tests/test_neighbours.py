"""pvibr beside PyVista's own features: each picture is as without pvibr, or as with meshes."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import plotter, shown

SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'


def chart():
    made = pv.Chart2D()
    made.line([0, 1], [1, 10])
    return made


def test_closed_plotters_end_as_soon_as_those_without_pvibr():
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.ShaderEffect(SAME))
    pl.show()
    plot, ibr = weakref.ref(pl), pl.ibr
    gc.disable()
    try:
        del pl
        assert plot() is None
    finally:
        gc.enable()
    assert repr(ibr) == '<plotter.ibr: closed>'
    with pytest.raises(pvibr.ClosedError):
        ibr.add(pvibr.Vignette())


def test_a_chart_may_be_shown_in_one_plotter_after_the_other():
    used, fresh = chart(), chart()

    def picture(chart, effect):
        pl = plotter()
        pl.add_chart(chart)
        gc.collect()  # a scene that ends takes itself from its charts, which crash without one
        if effect:
            pl.ibr.add(pvibr.ShaderEffect(SAME))
        return shown(pl), pl.close()

    for _ in range(2):
        picture(used, True)
    np.testing.assert_array_equal(picture(used, True)[0], picture(fresh, False)[0])


def thin_things(pl, seed):
    """Add points, lines and what is not lit, over a ground, and a light."""
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(3, 2, 6), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='w')
    rng = np.random.default_rng(seed)
    points = rng.uniform([-2.5, -2.5, 0.3], [2.5, 2.5, 1.0], (4, 12, 3))
    pl.add_mesh(points[0], style='points', color='red', point_size=6)
    pl.add_mesh(points[1], style='points_gaussian', color='green', point_size=9)
    pl.add_mesh(points[2], render_points_as_spheres=True, color='orange', point_size=9)
    unlit = {'render_points_as_spheres': True, 'lighting': False}
    pl.add_mesh(points[3], color='cyan', point_size=9, **unlit)
    pl.add_mesh(pv.lines_from_points(points[0]), color='blue', line_width=2)
    ball = pv.Sphere(center=(1, 0, 0.6), radius=0.5)
    pl.add_mesh(ball, color='yellow', lighting=False, smooth_shading=True)
    pl.add_mesh(ball.translate((0, 2, 0)), color='purple', style='wireframe')
    pl.camera_position = [(0, -7, 7), (0, 0, 0), (0, 0, 1)]
    return pl


@pytest.mark.parametrize('seed', [0, 5])
def test_ssao_darkens_what_shadows_draw_as_it_does_without_them(seed):
    def picture(ssao, shadows):
        pl = thin_things(plotter((200, 150)), seed)
        if ssao:
            pl.enable_ssao(radius=1)
        if shadows:
            pl.ibr.add(pvibr.Shadows())
        return shown(pl)

    plain, dark, occluded, both = (
        picture(ssao, shadows) for ssao in (False, True) for shadows in (False, True)
    )
    same = (plain == dark).all(2)
    assert 0.5 < same.mean() < 0.95
    assert np.abs(occluded - both)[same].max() <= 1
    np.testing.assert_allclose((dark * (occluded / np.maximum(plain, 1))), both, atol=4)
