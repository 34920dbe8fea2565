"""Subplots keep their own lights from frame to frame, with and without effects beside them."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr


@pytest.mark.parametrize('subplots', [(0,), (1,), (0, 1)])
def test_each_subplot_keeps_its_lights(subplots):
    pl = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(200, 100), lighting='none')
    for number, (x, color) in enumerate([(5, 'white'), (-5, 'red')]):
        pl.subplot(0, number)
        light = pv.Light(position=(x, 0, 5), focal_point=(0, 0, 0), color=color)
        pl.add_light(light, only_active=True)
        pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='white')
        if number in subplots:
            pl.ibr.add(pvibr.Fog(1000.0))
    pl.show(auto_close=False)
    for _ in range(3):
        left, right = np.split(pl.screenshot(return_img=True), 2, axis=1)
        assert left[50, 50, 1] > 100 > right[50, 50, 1]
        assert right[50, 50, 0] > 100
        pl.render()
    pl.close()
