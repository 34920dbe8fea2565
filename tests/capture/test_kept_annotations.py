"""Captures leave annotations as they were, to the bit."""

import numpy as np
import pytest
import pyvista as pv

CAPTURES = {
    'scale': {'scale': 3},
    'size': {'window_size': (210, 330)},
    'large': {'window_size': (700, 500)},
    'transparent': {'transparent_background': True},
    'samples': {'samples': 2, 'scale': 2},
}
ANNOTATIONS = {
    'bar': lambda pl: pl.add_scalar_bar('Height'),
    'vertical bar': lambda pl: pl.add_scalar_bar('Height', vertical=True),
    'axes at origin': lambda pl: pl.add_axes_at_origin(),
    'axes': lambda pl: pl.add_axes(),
    'text': lambda pl: pl.add_text('Hello', position=(20, 20)),
    'corner': lambda pl: pl.add_text('Hello'),
    'labels': lambda pl: pl.add_point_labels(0.6 * np.eye(3), ['a', 'b', 'c']),
    'legend': lambda pl: pl.add_legend([['a', 'r'], ['b', 'b']]),
    'grid': lambda pl: pl.show_grid(),
    'chart': lambda pl: pl.add_chart(pv.Chart2D(size=(0.5, 0.5), loc=(0.4, 0.4))),
}


def shot(pl):
    return np.array(pl.screenshot(return_img=True))


@pytest.mark.parametrize('shape', [(1, 1), (1, 2)], ids=str)
@pytest.mark.parametrize('name', ANNOTATIONS)
def test_annotations_are_as_before(name, shape):
    pl = pv.Plotter(off_screen=True, window_size=(300, 200), shape=shape)
    pl.subplot(0, shape[1] - 1)
    ball = pv.Sphere()
    pl.add_mesh(ball, scalars=ball.points[:, 2], show_scalar_bar=False)
    ANNOTATIONS[name](pl)
    pl.show(auto_close=False)
    pl.render()
    before = shot(pl)
    for options in CAPTURES.values():
        pl.ibr.screenshot(**options)
        np.testing.assert_array_equal(shot(pl), before, err_msg=str(options))
    pl.render()
    np.testing.assert_array_equal(shot(pl), before)
    pl.close()
