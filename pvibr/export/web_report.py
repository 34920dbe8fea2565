"""Reports on what browsers show of a scene that they render, and warnings of what is missing."""

from __future__ import annotations

import weakref
from dataclasses import asdict, dataclass

from pvibr.core import _vtk
from pvibr.core.arguments import check_one_of
from pvibr.core.errors import warn
from pvibr.core.observers import weakly
from pvibr.core.plotters import put_inner, trame_viewer

#: Backends that show images rendered here; those that send the scene as data.
PICTURES = ('static', 'server', 'none')
DATA = ('client', 'html', 'trame', 'vtksz', 'wasm', 'gltf')
_NAME = 'pvibr: detects that the scene is read'


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
        """Rows that only a plain plotter shows, or none."""
        return [row for row in self.rows if row.state in ('baked', 'lost')]

    def as_dict(self) -> dict:
        """Return the report as JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        has_subplots = len({row.subplot for row in self.rows}) > 1
        table_rows = [('effect', f'with {self.backend!r}', 'as what, or why not')]
        for row in self.rows:
            name = f'{row.subplot}: {row.effect}' if has_subplots else row.effect
            state = 'after to_plain_plotter()' if row.state == 'baked' else row.state
            table_rows.append((name, state, row.what))
        column_widths = [max(map(len, column)) for column in zip(*table_rows, strict=True)]
        lines = ['  '.join(map(str.ljust, row, column_widths)).rstrip() for row in table_rows]
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
    why_off = effect.why_neutral if effect.enabled else 'enabled is False'
    if why_off:
        return WebRow(effect.name, 'off', why_off, subplot)
    if backend in PICTURES:
        return WebRow(effect.name, 'shown', 'in pictures that are drawn here', subplot)
    state, what = effect.web
    return WebRow(effect.name, state, what, subplot)


class Watch:
    """Calls a method when a renderer's scene is read as data, by an exporter or a browser."""

    def __init__(self, renderer, on_read):
        self.renderer = renderer
        self._source = _vtk.vtkProgrammableSource()
        self._drawing: set = set()
        self._source.SetExecuteMethod(_teller(weakref.WeakMethod(on_read), self._drawing))
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(self._source.GetOutputPort())
        mapper.StaticOn()  # reading bounds must not execute the source
        self.prop = _vtk.vtkActor()
        self.prop.SetMapper(mapper)
        self.prop.SetObjectName(_NAME)
        self.prop.UseBoundsOff()
        self.prop.PickableOff()
        self._observers: list[int] = []

    def set(self, is_watching):
        """Start or stop watching."""
        if is_watching and not self._observers:
            put_inner(self.renderer, self.prop)
            show = _shows(self.prop, self._source, self._drawing)
            self._observers = [
                self.renderer.AddObserver('StartEvent', lambda *_: show(False)),
                self.renderer.AddObserver('EndEvent', lambda *_: show(True)),
            ]
        elif not is_watching and self._observers:
            self.renderer.RemoveViewProp(self.prop)
            for observer in self._observers:
                self.renderer.RemoveObserver(observer)
            self._observers = []


def _teller(weak_on_read, drawing):
    def read():
        on_read = weak_on_read()
        # VTK's shadow passes read invisible props too.
        if on_read is not None and not drawing:
            on_read()

    return read


def _shows(prop, source, drawing):
    def show(is_visible):
        prop.SetVisibility(is_visible)
        if is_visible:
            drawing.clear()
            source.Modified()  # so that the next reader executes it
        else:
            drawing.add(True)

    return show


class HandOver:
    """Warns once about what is missing when a plotter's scene is read as data."""

    def __init__(self, plotter, web_report):
        self._plotter, self._web_report = plotter, web_report
        self._warned_rows: list = []
        self._viewer: object = None
        self._stopped = False

    def stop(self):
        """Stop warning."""
        self._stopped = True

    def warn(self):
        """Warn, unless a trame page currently shows images rendered here."""
        if self._stopped:
            return
        viewer = trame_viewer(self._plotter)
        if viewer is not None and viewer.server.state[viewer.SERVER_RENDERING]:
            self._follow(viewer)
            return
        report = self._web_report()
        if report.missing and report.missing != self._warned_rows:
            self._warned_rows = report.missing
            warn_missing(report)

    def _follow(self, viewer):
        """Warn when a page switches from images to data."""
        if viewer is self._viewer:
            return
        self._viewer, warn = viewer, weakly(self.warn)
        viewer.server.state.change(viewer.SERVER_RENDERING)(lambda **_: warn())


def warn_missing(report):
    """Warn about what a browser will not show."""
    lost_names = '; '.join(f'{r.effect} ({r.what})' for r in report.missing if r.state == 'lost')
    baked_names = ', '.join(r.effect for r in report.missing if r.state == 'baked')
    parts = ['The scene is sent as data, without what pvibr renders']
    if baked_names:
        parts.append(f'pl.ibr.to_plain_plotter() returns a plotter that has {baked_names}')
    if lost_names:
        parts.append(f'Not available: {lost_names}')
    parts.append("With jupyter_backend='server' a page shows everything; see pl.ibr.web_report()")
    warn('. '.join(parts) + '.')
