"""The dock, by keys, clicks and wheels of Qt."""

import os

import numpy as np
import pytest

import pvibr
from tests.refusals import refused

os.environ.setdefault('QT_QPA_PLATFORM', 'offscreen')
for needed in ('PySide6.QtWidgets', 'PySide6.QtTest', 'qtpy'):
    pytest.importorskip(needed, reason="needs pip install 'pvibr[qt]'", exc_type=ImportError)
from PySide6 import QtCore, QtGui, QtWidgets  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

KEY, LEFT = QtCore.Qt.Key, QtCore.Qt.MouseButton.LeftButton


@pytest.fixture(scope='module')
def app():
    return QtWidgets.QApplication.instance() or QtWidgets.QApplication([])


@pytest.fixture
def window(app):
    window = QtWidgets.QMainWindow()
    window.resize(900, 900)
    window.show()
    yield window
    window.close()
    window.deleteLater()
    app.sendPostedEvents(None, QtCore.QEvent.Type.DeferredDelete)


@pytest.fixture
def dock(pl, window, app):
    from pvibr_widgets.qt import qt_dock

    dock = qt_dock(pl, window)
    app.processEvents()
    return dock


def controls(dock, name, group=0):
    return next(v.controls for v in dock.groups[group].rows if v.row.name == name)


def button(dock, name):
    found = [b for b in dock.findChildren(QtWidgets.QAbstractButton) if b.accessibleName() == name]
    assert found, name
    return found[0]


def click(widget):
    """Click into the middle, as people do."""
    QTest.mouseClick(widget, LEFT)


def write(field, text):
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, text)
    QTest.keyClick(field, KEY.Key_Return)


def test_a_slider_moved_by_keys_is_in_the_picture(dock, pl):
    before = pl.screenshot(return_img=True)
    slider = controls(dock, 'intensity')['slider']
    slider.setFocus()
    for _ in range(5):
        QTest.keyClick(slider, KEY.Key_PageUp)
    assert pl.ibr.effects[0].intensity == 3.0
    assert controls(dock, 'intensity')['text'].text() == '3'
    assert np.abs(pl.screenshot(return_img=True).astype(int) - before).max() > 10


def test_a_slider_dragged_by_mouse_moves_the_setting(dock, pl):
    slider = controls(dock, 'spread')['slider']
    middle = QtCore.QPoint(slider.width() // 2, slider.height() // 2)
    QTest.mousePress(slider, LEFT, pos=middle)
    QTest.mouseMove(slider, QtCore.QPoint(slider.width() - 2, middle.y()))
    QTest.mouseRelease(slider, LEFT, pos=QtCore.QPoint(slider.width() - 2, middle.y()))
    assert pl.ibr.effects[0].spread > 0.9


def test_a_text_is_taken_or_said(dock, pl, app):
    bloom, field = pl.ibr.effects[0], controls(dock, 'threshold')['text']
    write(field, '7.5')
    assert (bloom.threshold, controls(dock, 'threshold')['slider'].value()) == (7.5, 200)
    write(field, '-1')
    assert (bloom.threshold, field.text()) == (7.5, '7.5')
    said = [label.text() for label in dock.findChildren(QtWidgets.QLabel) if label.isVisible()]
    assert any('Bloom.threshold must be a float in [0, inf)' in text for text in said)
    write(field, '0.25')
    app.processEvents()
    said = [label.text() for label in dock.findChildren(QtWidgets.QLabel) if label.isVisible()]
    assert not any('must be' in text for text in said)


def test_settings_of_the_plotter_itself(dock, pl):
    write(dock.rows[0].controls['text'], '50')
    assert pl.ibr.interactive_frame_ms == 50.0


def test_leaving_a_field_changes_nothing(dock, pl):
    pl.ibr.effects[0].threshold = 1 / 3
    revision = pl.ibr.effects[0].revision
    field = controls(dock, 'threshold')['text']
    dock.model.refresh()
    field.setFocus()
    QTest.keyClick(field, KEY.Key_Tab)
    assert pl.ibr.effects[0].revision == revision


def test_switches_choices_and_ticks(dock, pl):
    bloom = pl.ibr.effects[0]
    click(controls(dock, 'background')['switch'])
    assert bloom.background
    choice = controls(dock, 'blend')['choice']
    choice.setFocus()
    QTest.keyClick(choice, KEY.Key_Down)
    assert bloom.blend == 'screen'
    levels = controls(dock, 'levels')
    assert levels['derived'].isChecked()
    QTest.keyClick(levels['derived'], KEY.Key_Space)
    assert bloom.levels == int(levels['text'].text())
    click(levels['reset'])
    assert bloom.levels is None


def test_colours_are_picked_beside_everything_else(dock, pl, app):
    vignette = pl.ibr.add(pvibr.Vignette())
    pl.render()
    app.processEvents()
    write(controls(dock, 'color', 1)['text'], '#ff0000')
    assert vignette.color == (1.0, 0.0, 0.0)
    click(controls(dock, 'color', 1)['color'])
    palette = dock.findChild(QtWidgets.QColorDialog)
    assert not palette.isModal()
    palette.setCurrentColor(QtGui.QColor('#0000ff'))
    assert vignette.color == (0.0, 0.0, 1.0)
    click(button(dock, 'Vignette on'))
    assert not vignette.enabled
    palette.close()


def test_the_dock_follows_code(dock, pl):
    bloom = pl.ibr.effects[0]
    bloom.spread = 0.125
    pl.render()
    assert controls(dock, 'spread')['text'].text() == '0.125'
    pl.ibr.add(pvibr.Vignette())
    pl.render()
    assert [box.group.title for box in dock.groups] == ['Bloom', 'Vignette']
    pl.ibr.clear()
    pl.render()
    dock.model.refresh()
    assert dock.groups == []


def test_removed_by_a_click(dock, pl, app):
    click(button(dock, 'remove Bloom'))
    app.processEvents()
    assert pl.ibr.effects == ()
    assert dock.groups == []


def test_presets_are_applied_kept_and_forgotten(dock, pl):
    bloom, box = pl.ibr.effects[0], dock.groups[0]
    box.preset.setEditText('strong')
    click(button(dock, 'Apply preset of Bloom'))
    assert bloom.intensity == 2.0
    write(box.preset.lineEdit(), 'mine')
    click(button(dock, 'Keep preset of Bloom'))
    bloom.intensity = 0.1
    box.preset.setEditText('mine')
    click(button(dock, 'Apply preset of Bloom'))
    assert bloom.intensity == 2.0
    assert box.preset.findText('mine') > 0
    click(button(dock, 'Forget preset of Bloom'))
    assert box.preset.findText('mine') < 0
    click(button(dock, 'Reset all'))
    assert bloom.intensity == 1.0


def test_python_and_files(dock, pl, app, tmp_path):
    click(button(dock, 'Copy as Python'))
    assert 'pvibr.Bloom(threshold=0.5)' in app.clipboard().text()
    write(dock.path, str(tmp_path / 'a.json'))
    click(button(dock, 'Save'))
    pl.ibr.effects[0].threshold = 0.9
    click(button(dock, 'Load'))
    assert pl.ibr.effects[0].threshold == 0.5


def test_every_control_has_a_name_a_place_in_the_order_of_tabs_and_room(dock, pl, app):
    pl.ibr.add(pvibr.DepthOfField())
    pl.ibr.add(pvibr.Vignette())
    pl.render()
    app.processEvents()
    for box in dock.groups:
        for view in box.rows:
            for key, control in view.controls.items():
                assert view.row.label in control.accessibleName() or key == 'reset'
                assert control.accessibleName()
                assert control.focusPolicy() & QtCore.Qt.FocusPolicy.TabFocus
                assert control.height() >= 24
                assert control.toolTip() == view.row.help


def test_tab_goes_through_the_whole_panel_and_out(dock, window, app):
    controls(dock, 'intensity')['slider'].setFocus()
    app.processEvents()
    first, seen = window.focusWidget(), []
    for _ in range(200):
        QTest.keyClick(window.focusWidget(), KEY.Key_Tab)
        seen.append(window.focusWidget())
        if seen[-1] is first:
            break
    assert seen[-1] is first
    assert controls(dock, 'firefly_reduction')['slider'] in seen
    assert len(set(map(id, seen))) > 30


def test_wheels_scroll_the_panel_and_change_no_setting(dock, pl, app):
    slider = controls(dock, 'spread')['slider']
    dock.path.setFocus()
    where = QtCore.QPointF(5, 5)
    wheel = QtGui.QWheelEvent(
        where,
        slider.mapToGlobal(where),
        QtCore.QPoint(),
        QtCore.QPoint(0, 120),
        QtCore.Qt.MouseButton.NoButton,
        QtCore.Qt.KeyboardModifier.NoModifier,
        QtCore.Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    app.sendEvent(slider, wheel)
    assert pl.ibr.effects[0].spread == 0.5


def test_help_is_shown_without_hovering(dock, app):
    text = controls(dock, 'spread')['slider'].toolTip()
    shown = lambda: [w for w in dock.findChildren(QtWidgets.QLabel) if w.text() == text]  # noqa: E731
    assert not any(w.isVisible() for w in shown())
    click(next(b for b in dock.findChildren(QtWidgets.QCheckBox) if b.text() == 'Help'))
    assert any(w.isVisible() for w in shown())


def test_groups_fold_and_many_begin_folded(dock, pl, app):
    box = dock.groups[0]
    assert box.rows[0].isVisible()
    click(box.title)
    assert not box.rows[0].isVisible()
    for k in range(4):
        pl.ibr.add(pvibr.Flash(duration=1.0 + k))
    pl.render()
    app.processEvents()
    assert len(dock.groups) == 5
    assert not any(b.rows[0].isVisible() for b in dock.groups)


def test_a_closed_plotter_empties_the_dock(dock, pl, app):
    pl.close()
    assert dock.groups == []
    assert 'the plotter is closed' in [w.text() for w in dock.findChildren(QtWidgets.QLabel)]


def test_bad_windows_and_sides(pl, window):
    from pvibr_widgets.qt import qt_dock

    refused('must be the QMainWindow', qt_dock, pl, kind=TypeError)
    refused('must be left or right', qt_dock, pl, window, side='up')
