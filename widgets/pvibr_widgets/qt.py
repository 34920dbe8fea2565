"""The control panel as a dock of a Qt window."""

from __future__ import annotations

from typing import Any

from pvibr.core.errors import require
from pvibr_widgets.model import Model

QtCore: Any = require('qtpy.QtCore', 'qt', 'Docks in Qt windows')
QtGui: Any = require('qtpy.QtGui', 'qt', 'Docks in Qt windows')
QtWidgets: Any = require('qtpy.QtWidgets', 'qt', 'Docks in Qt windows')

_HEIGHT = 28  # pixels: controls are touch targets
_LABEL = 110
_FIXED = QtWidgets.QSizePolicy.Policy.Fixed
_WIDTHS = {'derived': 64, 'reset': 32}
_SIDES = {'left': 'LeftDockWidgetArea', 'right': 'RightDockWidgetArea'}


def qt_dock(plotter, window=None, *, side='right', presets=None):
    """Add a control panel to a Qt window, beside the plotter.

    Parameters
    ----------
    plotter : pyvistaqt.QtInteractor or pyvistaqt.BackgroundPlotter
        What is controlled; any other plotter where there is a `window`.
    window : QMainWindow, optional
        By default the one that the plotter is in.
    side : {'right', 'left'}
        Where in the window.
    presets : Presets, optional
        Presets; those of the user's file by default.

    Returns
    -------
    QDockWidget
        With the :class:`pvibr_widgets.model.Model` as its ``model``.

    Raises
    ------
    TypeError
        If there is no such window.
    ValueError
        If there is no such side.
    ImportError
        If there is no Qt.
    """
    if window is None:
        inside = hasattr(plotter, 'window') and callable(plotter.window)
        window = getattr(plotter, 'app_window', None) or (plotter.window() if inside else None)
    if not isinstance(window, QtWidgets.QMainWindow):
        raise TypeError(f'window = {window!r}: must be the QMainWindow that the dock is put into')
    if side not in _SIDES:
        raise ValueError(f'side = {side!r}: must be left or right')
    dock = Dock(Model(plotter, presets=presets), window)
    window.addDockWidget(getattr(QtCore.Qt.DockWidgetArea, _SIDES[side]), dock)
    return dock


class Dock(QtWidgets.QDockWidget):
    """A dock with a control panel."""

    def __init__(self, model, window):
        super().__init__('pvibr', window)
        self.model = model
        self.rows = [RowView(model, row, 'plotter') for row in model.own]
        self.groups: list[GroupBox] = []
        self.setObjectName('pvibr')
        self._message = _label('', 'message')
        self.path = QtWidgets.QLineEdit('pvibr.json')
        self._help = QtWidgets.QCheckBox('Help')
        self._groups = QtWidgets.QVBoxLayout()
        self._build()
        model.listen(self._changed)
        self.destroyed.connect(model.close)
        self._changed(True)

    def _build(self):
        page = QtWidgets.QWidget()
        layout = QtWidgets.QVBoxLayout(page)
        layout.addLayout(self._tools())
        layout.addLayout(self._file())
        layout.addWidget(self._message)
        for row in self.rows:
            layout.addWidget(row)
        layout.addLayout(self._groups)
        layout.addStretch()
        area = QtWidgets.QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(QtCore.Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setMinimumWidth(320)
        area.setWidget(page)
        self.setWidget(area)
        self._help.toggled.connect(lambda _: self._changed(False))
        self._help.setMinimumHeight(_HEIGHT)

    def _tools(self):
        do, model = self.model.do, self.model
        row = QtWidgets.QHBoxLayout()
        row.addWidget(_button('Copy as Python', lambda: do(self._copy)))
        row.addWidget(_button('Reset all', lambda: do(model.reset)))
        row.addWidget(self._help)
        row.addStretch()
        return row

    def _file(self):
        do, model = self.model.do, self.model
        row = QtWidgets.QHBoxLayout()
        label = QtWidgets.QLabel('File')
        label.setBuddy(self.path)
        row.addWidget(label)
        row.addWidget(_named(self.path, 'file of settings'))
        row.addWidget(_button('Save', lambda: do(model.save, self.path.text())))
        row.addWidget(_button('Load', lambda: do(model.load, self.path.text())))
        return row

    def _copy(self):
        QtWidgets.QApplication.clipboard().setText(self.model.code())
        self.model.message = 'copied'

    def _changed(self, rebuilt):
        if rebuilt:
            for box in self.groups:
                self._groups.removeWidget(box)
                box.hide()
                box.deleteLater()
            self.groups = [GroupBox(self.model, group) for group in self.model.groups]
            for box in self.groups:
                self._groups.addWidget(box)
        _say(self._message, self.model.message)
        for view in self.rows:
            view.update_value(self._help.isChecked())
        for box in self.groups:
            box.update_rows(self._help.isChecked())


class GroupBox(QtWidgets.QFrame):
    """An effect or a thing: its switch, presets and rows."""

    def __init__(self, model, group):
        super().__init__()
        self.setFrameShape(QtWidgets.QFrame.Shape.StyledPanel)
        self.group = group
        self._model = model
        self.title = _named(QtWidgets.QToolButton(), group.title)
        self._body = QtWidgets.QWidget()
        self._why = _label('', 'why it is off')
        self.enabled = _named(QtWidgets.QCheckBox('on'), f'{group.title} on')
        self.preset = _named(QtWidgets.QComboBox(), f'presets of {group.title}')
        self.preset.setEditable(True)
        outside, layout = QtWidgets.QVBoxLayout(self), QtWidgets.QVBoxLayout(self._body)
        outside.addLayout(self._head())
        outside.addWidget(self._why)
        outside.addWidget(self._body)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(self._sets())
        self.rows = [RowView(model, row, group.title) for row in group.rows]
        for row in self.rows:
            layout.addWidget(row)
        self._open(group.is_open)

    def _open(self, is_open):
        self.group.is_open = is_open
        arrow = QtCore.Qt.ArrowType.DownArrow if is_open else QtCore.Qt.ArrowType.RightArrow
        self.title.setArrowType(arrow)
        self.title.setChecked(is_open)
        self._body.setVisible(is_open)

    def _head(self):
        do, group = self._model.do, self.group
        row = QtWidgets.QHBoxLayout()
        self.title.setText(group.title)
        self.title.setCheckable(True)
        self.title.setAutoRaise(True)
        self.title.setMinimumHeight(_HEIGHT)
        self.title.setToolButtonStyle(QtCore.Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.title.clicked.connect(self._open)
        row.addWidget(self.title)
        row.addStretch()
        self.enabled.clicked.connect(lambda on: do(group.switch, on))
        self.enabled.setMinimumHeight(_HEIGHT)
        row.addWidget(self.enabled)
        row.addWidget(_button('Remove', lambda: do(group.remove), f'remove {group.title}'))
        return row

    def _sets(self):
        do, group, name = self._model.do, self.group, self.preset.currentText
        row = QtWidgets.QHBoxLayout()
        row.addWidget(self.preset, 1)
        for word, action in (
            ('Apply', group.apply),
            ('Keep', group.keep),
            ('Forget', group.forget),
        ):
            button = _button(word, lambda _=False, a=action: do(a, name()))
            row.addWidget(_named(button, f'{word} preset of {group.title}'))
        return row

    def update_rows(self, helps):
        """Update the widgets."""
        self.enabled.setChecked(self.group.enabled)
        _say(self._why, self.group.why)
        names, text = self._names(), self.preset.currentText()
        if names != [self.preset.itemText(i) for i in range(self.preset.count())]:
            self.preset.clear()
            self.preset.addItems(names)
            self.preset.setEditText(text or names[0])
        for row in self.rows:
            row.update_value(helps)

    def _names(self):
        try:
            return self.group.presets
        except (OSError, ValueError) as error:
            return [str(error)]


class RowView(QtWidgets.QWidget):
    """A setting: its label, control, check box and message."""

    def __init__(self, model, row, title):
        super().__init__()
        self.row, self._model = row, model
        self.controls: dict[str, Any] = {}
        self._help = _label(row.help, 'help')
        self._error = _label('', 'error')
        self._error.setStyleSheet('color: #b00020')
        line = QtWidgets.QHBoxLayout()
        line.setContentsMargins(0, 0, 0, 0)
        self._make(line, f'{title}: {row.label}')
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(line)
        layout.addWidget(self._help)
        layout.addWidget(self._error)

    def _make(self, line, name):
        label = QtWidgets.QLabel(self.row.label)
        label.setToolTip(self.row.help)
        label.setWordWrap(True)
        label.setFixedWidth(_LABEL)
        line.addWidget(label)
        for key, control in self._made():
            self.controls[key] = control
            control.setToolTip(self.row.help)
            control.setMinimumHeight(_HEIGHT)
            control.setFocusPolicy(QtCore.Qt.FocusPolicy.StrongFocus)
            control.installEventFilter(self)
            if key in _WIDTHS:
                control.setFixedWidth(_WIDTHS[key])
            line.addWidget(_named(control, f'{name} {key}' if key != 'switch' else name))
            if key == 'switch':  # a click beside the box would do nothing
                control.setSizePolicy(_FIXED, _FIXED)
                line.addStretch()
        label.setBuddy(next(iter(self.controls.values())))

    def _made(self):
        """Create the controls of the setting, in tab order."""
        row, do = self.row, self._model.do
        if row.kind == 'switch':
            switch = QtWidgets.QCheckBox('on')
            switch.clicked.connect(lambda on: do(row.set, on))
            yield 'switch', switch
        elif row.kind == 'choice':
            choice = QtWidgets.QComboBox()
            choice.addItems(row.choices)
            choice.activated.connect(lambda index: do(row.choose, index))
            yield 'choice', choice
        else:
            yield from self._written()
        if row.optional:
            derived = QtWidgets.QCheckBox('auto')
            derived.clicked.connect(lambda on: do(row.derive, on))
            yield 'derived', derived
        yield 'reset', _button('↺', lambda: do(row.reset))

    def _written(self):
        row, do = self.row, self._model.do
        if row.kind == 'number':
            slider = QtWidgets.QSlider(QtCore.Qt.Orientation.Horizontal)
            slider.valueChanged.connect(lambda stop: do(row.move, stop))
            yield 'slider', slider
        text = QtWidgets.QLineEdit()
        if row.kind == 'number':
            text.setFixedWidth(80)
        text.editingFinished.connect(self._wrote)
        yield 'text', text
        if row.kind == 'color':
            yield 'color', _button('Colour', self._pick)

    def _wrote(self):
        """Apply edited text; leaving an unedited field changes nothing."""
        text = self.controls['text'].text()
        if text != self._text():
            self._model.do(self.row.paint if self.row.kind == 'color' else self.row.write, text)

    def _text(self):
        return self.row.color if self.row.kind == 'color' else self.row.text

    def _pick(self):
        """Open a non-modal colour dialog."""
        palette = QtWidgets.QColorDialog(QtGui.QColor(self.row.color), self)
        palette.setAttribute(QtCore.Qt.WidgetAttribute.WA_DeleteOnClose)
        palette.currentColorChanged.connect(lambda c: self._model.do(self.row.paint, c.name()))
        palette.setModal(False)
        palette.show()

    def eventFilter(self, control, event):
        """Scroll the page with the wheel unless the control has the focus."""
        if event.type() == QtCore.QEvent.Type.Wheel and not control.hasFocus():
            event.ignore()
            return True
        return super().eventFilter(control, event)

    def update_value(self, helps):
        """Update the widgets."""
        row, get = self.row, self.controls.get
        for control in self.controls.values():
            control.blockSignals(True)
        if (slider := get('slider')) is not None:
            slider.setRange(0, row.scale.last)
            slider.setPageStep(max(row.scale.last // 10, 1))
            slider.setValue(row.stop)
            slider.setAccessibleDescription(f'{row.text or "auto"} {row.param.unit or ""}'.strip())
        if (text := get('text')) is not None:
            text.setText(self._text())
            text.setPlaceholderText('auto' if row.derived else '')
        if (switch := get('switch')) is not None:
            switch.setChecked(bool(row.value))
        if (choice := get('choice')) is not None:
            choice.setCurrentIndex(row.choice)
        if (derived := get('derived')) is not None:
            derived.setChecked(row.derived)
        for control in self.controls.values():
            control.blockSignals(False)
        self._help.setVisible(helps)
        _say(self._error, row.error)


def _label(text, name):
    label = QtWidgets.QLabel(text)
    label.setWordWrap(True)
    label.setVisible(bool(text))
    return _named(label, name)


def _say(label, text):
    label.setText(text)
    label.setVisible(bool(text))


def _button(text, clicked, name=None):
    button = QtWidgets.QPushButton(text)
    button.setMinimumHeight(_HEIGHT)
    button.setAutoDefault(False)
    button.clicked.connect(lambda *_: clicked())
    return _named(button, name or text)


def _named(widget, name):
    widget.setAccessibleName(name)
    return widget
