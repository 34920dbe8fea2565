"""Opacities of points and cells, and transfer functions of scalars."""

import numpy as np
import pytest

from tests.large.looks import OVER, drawn, pictures
from tests.large.surfaces import terrain
from tests.pictures import off, shot


def faded(on_cells=False):
    """Return the terrain with scalars and opacities that fall from left to right."""
    mesh = terrain().copy()
    if on_cells:
        mesh.cell_data['height of cells'] = mesh.cell_centers().points[:, 2]
        mesh.cell_data['seen'] = 1 - mesh.cell_centers().points[:, 0]
    else:
        mesh.point_data['seen'] = 1 - mesh.points[:, 0]
    return mesh


@pytest.mark.parametrize('max_error', [0, 1])
@pytest.mark.parametrize(
    'opacity', ['linear', 'sigmoid_r', [0.0, 0.2, 1.0], 'seen', 'array', 0.4], ids=str
)
def test_as_add_mesh_has_it(opacity, max_error):
    mesh = faded()
    if opacity == 'array':
        opacity = np.asarray(mesh['seen'])
    look = {'scalars': 'height', 'lighting': False, 'opacity': opacity, 'max_error': max_error}
    found, truth, _ = pictures(mesh, **look)
    assert off(found, truth).mean() < (2 if max_error == 0 else 4)
    plain, _, _ = pictures(mesh, **look | {'opacity': 1.0})
    assert off(found, plain).mean() > 20


@pytest.mark.parametrize('opacity', ['seen', 'linear'])
def test_of_cells(opacity):
    look = {'scalars': 'height of cells', 'lighting': False, 'opacity': opacity, 'max_error': 0}
    found, truth, _ = pictures(faded(on_cells=True), **look)
    assert off(found, truth).mean() < 2


def test_colours_and_other_scalars():
    mesh = faded()
    colors = np.tile(np.uint8([200, 100, 0]), (mesh.n_points, 1))
    pl, _ = drawn(mesh, scalars=colors, rgb=True, opacity='seen', lighting=False)
    before = shot(pl)
    row = before[150, 60:260, 2]
    assert row[-1] > row[0] + 60, 'the background is seen on the right'


def test_other_scalars_keep_them():
    mesh = faded()
    pl, thing = drawn(mesh, scalars='height', opacity='seen', lighting=False)
    before = shot(pl)
    thing.set_scalars('pattern')
    assert off(shot(pl), before).mean() > 5
    opaque, _ = drawn(mesh, scalars='pattern', lighting=False)
    assert off(shot(pl), shot(opaque))[:, 200:].mean() > 20


@pytest.mark.parametrize(
    ('look', 'message'),
    [
        ({'opacity': 'linear', 'color': 'tan'}, 'without scalars'),
        ({'opacity': 'seen', 'scalars': 'height of cells'}, 'of cells'),
        ({'opacity': 'nothing', 'scalars': 'height'}, 'nothing'),
        ({'opacity': 1.5}, 'opacity must be'),
        ({'opacity': 'height', 'scalars': 'height'}, 'from 0 to 1'),
    ],
    ids=['no scalars', 'other kind', 'unknown', 'beyond', 'array beyond'],
)
def test_refused(look, message):
    mesh = faded()
    mesh.cell_data['height of cells'] = np.arange(mesh.n_cells)
    with pytest.raises(ValueError, match=message):
        drawn(mesh, view=OVER, **look)
