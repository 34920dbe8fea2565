"""Picking by the mouse as PyVista's pickers do: by a button or a key, marked, with a message."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from tests.pictures import pixel_of

SIZE = (150, 110)
PLACES = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.3]])


@pytest.fixture
def pl():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    pl.ibr.add_spheres(PLACES, 0.5, reset_camera=False)
    pl.camera_position = [(0, -6, 0), (0, 0, 0), (0, 0, 1)]
    pl.render()
    return pl


def send(pl, event, pixel, key=''):
    pl.iren.interactor.SetEventInformation(*pixel, 0, 0, chr(0), 0, key)
    pl.iren.interactor.InvokeEvent(event)
    pl.iren.interactor.InvokeEvent(event.replace('Press', 'Release'))


EVENTS = {
    'left': ({'left_clicking': True}, ('LeftButtonPressEvent',)),
    'right': ({}, ('RightButtonPressEvent',)),
    'key': ({}, ('KeyPressEvent', 'p')),
}


@pytest.mark.parametrize('event', EVENTS)
def test_what_is_hit_is_told_and_marked(pl, event):
    how, (name, *key) = EVENTS[event]
    found = []
    pl.ibr.enable_picking(found.append, color='red', **how)
    other = 'RightButtonPressEvent' if event == 'left' else 'LeftButtonPressEvent'
    send(pl, other, pixel_of(pl, PLACES[1]))
    assert not found
    send(pl, name, pixel_of(pl, PLACES[1]), *key)
    assert [hit.index for hit in found] == [1]
    mark = pl.actors['_pvibr_picked']
    assert mark.bounds == pytest.approx((0.5, 1.5, -0.5, 0.5, -0.2, 0.8), abs=0.02)
    assert mark.prop.style == 'Wireframe'
    assert mark.prop.color == 'red'
    send(pl, name, (2, 2), *key)
    assert len(found) == 1
    assert '_pvibr_picked' not in pl.actors
    send(pl, name, pixel_of(pl, PLACES[0]), *key)
    assert [hit.index for hit in found] == [1, 0]
    pl.ibr.disable_picking()
    send(pl, name, pixel_of(pl, PLACES[0]), *key)
    assert len(found) == 2
    assert not [name for name in pl.actors if 'pvibr' in name]


def shown(pl):
    return pl.actors['_pvibr_picking_message'].GetText(2)


def test_message_mark_and_picker_as_asked(pl):
    found = []
    pl.ibr.enable_picking(show_message='Which one?', font_size=9)
    assert shown(pl) == 'Which one?'
    pl.ibr.enable_picking(lambda *got: found.append(got), show=False, use_picker=True)
    assert 'Right-click' in shown(pl)
    send(pl, 'RightButtonPressEvent', pixel_of(pl, PLACES[1]))
    ((hit, picker),) = found  # the first is replaced
    assert picker.GetPickPosition() == pytest.approx(hit.point, abs=0.02)
    assert '_pvibr_picked' not in pl.actors
    pl.ibr.enable_picking(show_message=False)
    assert '_pvibr_picking_message' not in pl.actors
    with pytest.raises(
        TypeError, match="callback must be a function of the hit or None, got 'print'"
    ):
        pl.ibr.enable_picking('print')


@pytest.mark.parametrize(
    'wrong',
    [
        {'left_clicking': np.zeros(0)},
        {'show': 'no'},
        {'show_message': 3.5},
        {'use_picker': None},
        {'style': np.zeros((4, 3))},
        {'color': 'no color'},
        {'line_width': -1},
        {'font_size': 1j},
    ],
)
def test_wrong_arguments_are_named_and_change_nothing(pl, wrong):
    pl.ibr.enable_picking(show_message='Which one?')
    with pytest.raises((TypeError, ValueError), match=rf'\b{next(iter(wrong))}\b'):
        pl.ibr.enable_picking(**wrong)
    assert shown(pl) == 'Which one?'


def test_actors_behind_an_impostor_are_marked():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    ball = pl.add_mesh(pv.Sphere())
    ball.position = (0.3, 0, 0)
    pl.ibr.add_impostor(ball)
    pl.camera_position = [(0, -6, 0), (0, 0, 0), (0, 0, 1)]
    pl.render()
    found = []
    pl.ibr.enable_picking(found.append)
    send(pl, 'RightButtonPressEvent', pixel_of(pl, (0.3, 0, 0)))
    assert found[0].actor is ball
    assert pl.actors['_pvibr_picked'].bounds == pytest.approx(ball.bounds)


def test_the_subplot_under_the_mouse_is_picked():
    pl = pv.Plotter(off_screen=True, window_size=(200, 100), shape=(1, 2))
    for column in range(2):
        pl.subplot(0, column)
        pl.ibr.add_spheres([[0.0, 0.0, 0.0]] * (column + 1), 0.5, name=f'balls {column}')
    pl.render()
    found = []
    pl.ibr.enable_picking(found.append)
    pl.subplot(0, 1)
    send(pl, 'RightButtonPressEvent', (50, 50))
    assert len(found) == 1
    assert '_pvibr_picked' in pl.renderers[0].actors
    assert pl.renderer is pl.renderers[1]
