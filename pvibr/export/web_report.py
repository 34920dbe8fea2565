"""What a browser shows of a scene that it renders itself, and a warning of what is missing."""

from __future__ import annotations

import weakref
from dataclasses import asdict, dataclass

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.observers import weakly
from pvibr.core.plotters import put_inner, trame_viewer
from pvibr.maths.arguments import check_one_of

#: Backends that show images rendered here, and those that send the scene as data.
PICTURES = ('static', 'server', 'none')
DATA = ('client', 'html', 'trame', 'vtksz', 'wasm', 'gltf')
_NAME = 'pvibr: told when the scene is read'


@dataclass(frozen=True)
class WebRow:
    """What a browser shows of one effect or thing."""

    effect: str
    state: str
    what: str
    subplot: int = 0


@dataclass(frozen=True)
class WebReport:
    """What a browser shows of a plotter; prints as a table."""

    backend: str
    rows: list[WebRow]

    @property
    def missing(self) -> list[WebRow]:
        """Rows of what is shown only in a plain plotter, or not at all."""
        return [row for row in self.rows if row.state in ('baked', 'lost')]

    def as_dict(self) -> dict:
        """Return the report as JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        many = len({row.subplot for row in self.rows}) > 1
        cells = [('effect', f'with {self.backend!r}', 'as what, or why not')]
        for row in self.rows:
            name = f'{row.subplot}: {row.effect}' if many else row.effect
            state = 'after to_plain_plotter()' if row.state == 'baked' else row.state
            cells.append((name, state, row.what))
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = ['  '.join(map(str.ljust, row, widths)).rstrip() for row in cells]
        return '\n'.join(lines)


def web_report(subplots, backend) -> WebReport:
    """Return what a browser shows."""
    check_one_of('backend', backend, PICTURES + DATA)
    rows = [
        _row(effect, number, backend)
        for number, effects in sorted(subplots.items())
        for effect in effects
    ]
    return WebReport(backend, rows)


def _row(effect, subplot, backend):
    off = effect.why_neutral if effect.enabled else 'enabled is False'
    if off:
        return WebRow(effect.name, 'off', off, subplot)
    if backend in PICTURES:
        return WebRow(effect.name, 'shown', 'in pictures that are drawn here', subplot)
    state, what = effect.web
    return WebRow(effect.name, state, what, subplot)


class Watch:
    """Calls a method when a renderer's scene is read as data, by an exporter or for a browser."""

    def __init__(self, renderer, tell):
        self.renderer = renderer
        self._source = _vtk.vtkProgrammableSource()
        self._drawing: set = set()
        self._source.SetExecuteMethod(_teller(weakref.WeakMethod(tell), self._drawing))
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(self._source.GetOutputPort())
        mapper.StaticOn()  # reading bounds must not execute the source
        self.prop = _vtk.vtkActor()
        self.prop.SetMapper(mapper)
        self.prop.SetObjectName(_NAME)
        self.prop.UseBoundsOff()
        self.prop.PickableOff()
        self._observers: list[int] = []

    def set(self, there):
        """Start or stop watching."""
        if there and not self._observers:
            put_inner(self.renderer, self.prop)
            show = _shows(self.prop, self._source, self._drawing)
            self._observers = [
                self.renderer.AddObserver('StartEvent', lambda *_: show(False)),
                self.renderer.AddObserver('EndEvent', lambda *_: show(True)),
            ]
        elif not there and self._observers:
            self.renderer.RemoveViewProp(self.prop)
            for observer in self._observers:
                self.renderer.RemoveObserver(observer)
            self._observers = []


def _teller(tell, drawing):
    def read():
        told = tell()
        # VTK's shadow passes also read invisible props.
        if told is not None and not drawing:
            told()

    return read


def _shows(prop, source, drawing):
    def show(there):
        prop.SetVisibility(there)
        if there:
            drawing.clear()
            source.Modified()  # so that the next reader executes it
        else:
            drawing.add(True)

    return show


class HandOver:
    """Warns, once, of what is missing when a plotter's scene is read as data."""

    def __init__(self, plotter, report):
        self._plotter, self._report = plotter, report
        self._told: list = []
        self._viewer: object = None
        self._stopped = False

    def stop(self):
        """Warn no more."""
        self._stopped = True

    def warn(self):
        """Warn unless a page of trame shows images that are rendered here, for now."""
        if self._stopped:
            return
        viewer = trame_viewer(self._plotter)
        if viewer is not None and viewer.server.state[viewer.SERVER_RENDERING]:
            self._follow(viewer)
            return
        report = self._report()
        if report.missing and report.missing != self._told:
            self._told = report.missing
            warn_missing(report)

    def _follow(self, viewer):
        """Be called when a page switches between images and data."""
        if viewer is self._viewer:
            return
        self._viewer, warn = viewer, weakly(self.warn)
        viewer.server.state.change(viewer.SERVER_RENDERING)(lambda **_: warn())


def warn_missing(report):
    """Warn of what a browser will not show."""
    named = '; '.join(f'{r.effect} ({r.what})' for r in report.missing if r.state == 'lost')
    baked = ', '.join(r.effect for r in report.missing if r.state == 'baked')
    parts = ['The scene is sent as data, without what pvibr renders']
    if baked:
        parts.append(f'pl.ibr.to_plain_plotter() returns a plotter that has {baked}')
    if named:
        parts.append(f'Not available: {named}')
    parts.append("With jupyter_backend='server' a page shows everything; see pl.ibr.web_report()")
    warn('. '.join(parts) + '.')
