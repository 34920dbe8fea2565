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
