"""Pages that draw by themselves: methods of ``plotter.ibr``."""

from __future__ import annotations

from pathlib import Path

from pvibr.api.export_methods import to_plain_plotter
from pvibr.capture.clock import checked_time
from pvibr.core._vtk import address
from pvibr.core.arguments import checked_whole
from pvibr.core.files import replacing, with_suffix
from pvibr.core.plotters import renderers_of
from pvibr.core.signatures import explicit, takes
from pvibr.export.web_report import WebReport, WebRow


def page_report(plotter, pipelines_by_subplot) -> WebReport:
    """Return what a page of pvibr draws of effects, and which props it does not draw."""
    from pvibr.web.scene import drawn_of, losses_of

    rows = []
    for number, renderer in enumerate(renderers_of(plotter)):
        pipeline = pipelines_by_subplot.get(number)
        effects = [] if pipeline is None else pipeline.effects
        drawn = drawn_of(effects)
        rows += [_row(effect, number, effect in drawn) for effect in effects]
        rows += [WebRow(name, 'lost', why, number) for name, why in losses_of(drawn)]
        rows += [WebRow(name, 'lost', why, number) for name, why in _missing(renderer, effects)]
    return WebReport('page', rows)


def _missing(renderer, effects) -> list:
    """Return names of props that belong to no effect and that a page does not draw, and why."""
    from pvibr.web.annotations import flat_props, why_no_annotation, widgets_missing
    from pvibr.web.scene import props_of, why_missing

    own_props = {address(prop) for e in effects for prop in (*e.props, *_actors(e))}
    reasons = [(name, why_missing(prop), prop) for name, prop in props_of(renderer)]
    reasons += [(name, why_no_annotation(prop), prop) for name, prop in flat_props(renderer)]
    missing = [(n, why) for n, why, prop in reasons if why and address(prop) not in own_props]
    return [*missing, *((name, 'pages do not draw it') for name in widgets_missing(renderer))]


def _actors(effect) -> list:
    return [*effect.actors(), *effect.picked()] if hasattr(effect, 'picked') else []


def _row(effect, subplot, is_drawn) -> WebRow:
    from pvibr.web.scene import what_of, why_baked

    why_off = effect.why_neutral if effect.enabled else 'enabled is False'
    if why_off:
        return WebRow(effect.name, 'off', why_off, subplot)
    if is_drawn:
        return WebRow(effect.name, 'shown', what_of(effect), subplot)
    state = 'lost' if effect.web[0] == 'lost' else 'shown'
    return WebRow(effect.name, state, why_baked(effect), subplot)


@explicit
@takes(options=to_plain_plotter)
def export_html(self, path, *, megabytes=None, time=None, **options):
    """Write all subplots as one file that draws them in any browser with WebGL 2.

    The file asks no host for anything. Meshes are lit by VTK's own shaders, instances keep their
    levels of detail, figures and crowds play, and a click says what it hits. Everything else
    that pvibr draws is baked into meshes as it is now; a warning names what is lost.
    ``pl.ibr.web_report('page')`` says which is which.

    Parameters
    ----------
    path : str or pathlib.Path
        File name ending in ``.html``.
    megabytes : float, optional
        Largest size of the file, MB of 10^6 bytes: clips get fewer frames, images of instances
        smaller tiles, then lower quality, which a warning says.
    time : float, optional
        Seconds of ``pl.ibr.time`` at which the page starts; default now.
    **options
        See :meth:`to_plain_plotter`.

    Raises
    ------
    TypeError, ValueError
        If a number or the name is not allowed, or the scene does not fit; nothing is written.
    OSError
        If the file cannot be written; the existing file is unchanged.

    Warns
    -----
    PvibrWarning
        If the page lacks something, or has smaller tiles.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> cones = pl.ibr.add_instances(pv.Cone(), [[0, 0, 0], [2, 0, 0]], cache=False)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.ibr.export_html(pathlib.Path(folder) / 'cones.html', megabytes=5)
    ...     print(*[p.name for p in pathlib.Path(folder).iterdir()])
    cones.html
    >>> pl.close()
    """
    path = with_suffix(path, '.html')
    text = _text(self, path.stem, megabytes, time, options)
    with replacing(path) as temporary_path:
        Path(temporary_path).write_text(text, encoding='utf-8')


@explicit
@takes(options=to_plain_plotter)
def show_web(self, *, height=480, megabytes=None, time=None, **options):
    """Return the page of :meth:`export_html` in a frame, which notebooks show.

    It needs no server, and stays in the notebook's file.

    Parameters
    ----------
    height : int
        Height of the frame, CSS pixels.
    megabytes, time : float, optional
        As in :meth:`export_html`.
    **options
        See :meth:`to_plain_plotter`.

    Returns
    -------
    pvibr.web.page_file.WebPage
        Shown as the last value of a cell; its ``text`` is that of the file.

    Raises
    ------
    TypeError, ValueError
        If a number is not allowed, or the scene does not fit.

    Warns
    -----
    PvibrWarning
        If the page lacks something, or has smaller tiles.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Cube())
    >>> page = pl.ibr.show_web(height=300)
    >>> page.text[:15]
    '<!doctype html>'
    >>> pl.close()
    """
    from pvibr.web.page_file import WebPage

    checked_whole('height', height, 1, 100_000)
    title = str(getattr(self._plotter, 'title', None) or 'Scene')
    return WebPage(_text(self, title, megabytes, time, options), int(height))


def _text(self, title, megabytes, time, options) -> str:
    """Return the page of a plotter that starts at a time."""
    if time is None:
        return _text_now(self, title, megabytes, options)
    time, before = checked_time(time), self.time
    self._show_time(time)
    try:
        return _text_now(self, title, megabytes, options)
    finally:
        self._show_time(before)


def _text_now(self, title, megabytes, options) -> str:
    """Return the page of a plotter as it is now."""
    from pvibr.export.plain_plotter import plain_copy, warn_of_losses
    from pvibr.substitutes.billboard_cloud import billboard_cloud
    from pvibr.web.page_file import page_text
    from pvibr.web.scene import drawn_of, scene_of

    self._check_open()
    self.wait()
    self._show()
    if self._every_pipeline() and self.pipeline.window is not None:
        self._screenshots.draw()  # instances place themselves, and lights follow the camera
    drawn = {number: drawn_of(p.effects) for number, p in self._subplots().items()}
    without = [effect for effects in drawn.values() for effect in effects]
    plain, dropped = plain_copy(
        self._plotter,
        self._pipelines,
        billboard_cloud,
        without=without,
        **to_plain_plotter.__kwdefaults__ | options,
    )
    try:
        scene = scene_of(self._plotter, plain, drawn, self.time)
        text = page_text(scene, title, megabytes)
    finally:
        plain.close()
    warn_of_losses(page_report(self._plotter, self._subplots()), dropped, 'page')
    return text
