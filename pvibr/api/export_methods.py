"""Export to browsers and files: methods of ``plotter.ibr``."""

from __future__ import annotations

from pvibr.core.plotters import renderers_of
from pvibr.core.signatures import explicit, takes
from pvibr.export.web_report import WebReport
from pvibr.export.web_report import web_report as report_on


def web_report(self, backend='client') -> WebReport:
    """Report what a browser shows of all subplots, and what :meth:`to_plain_plotter` adds.

    Parameters
    ----------
    backend : str
        That of ``pl.show(jupyter_backend=...)``: 'client', 'html', 'trame' (while the page
        renders by itself), 'server', 'static' or 'none'; or 'vtksz', 'wasm', 'gltf'; or
        'page', that of :meth:`export_html` and :meth:`show_web`.

    Returns
    -------
    pvibr.export.web_report.WebReport
        Prints as a table; ``as_dict()`` for programs.

    Raises
    ------
    ValueError
        If there is no such backend.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]])
    >>> _ = pl.ibr.add(pvibr.Bloom())
    >>> print(pl.ibr.web_report('html'))
    effect   with 'html'               as what, or why not
    Spheres  after to_plain_plotter()  meshes
    Bloom    lost                      works on frames, and a browser draws its own
    >>> pl.close()
    """
    if isinstance(backend, str) and backend == 'page':
        from pvibr.api.page_methods import page_report

        return page_report(self._plotter, self._subplots())
    return report_on({n: p.effects for n, p in self._subplots().items()}, backend)


def to_plain_plotter(self, *, triangles=1_000_000, texture=1024, detail=1 / 1024):
    """Return a plotter of plain actors that shows the same, for browsers and files.

    Projected images and shadows become colours or textures, figures are frozen in their
    pose, instances become meshes and billboard clouds, billboards quads, outlines lines. A
    warning names what is lost; see :meth:`web_report`.

    Parameters
    ----------
    triangles : int
        Most triangles of all things in a subplot, and of a surface that is subdivided where
        its colours change.
    texture : int
        Texels along a side of textures of projected images, for surfaces with texture
        coordinates or with xatlas installed (``pip install pvibr[uv]``); 0 stores point
        colours instead.
    detail : float
        Shortest edge of subdivided surfaces, as a fraction of the scene's diagonal.

    Returns
    -------
    pyvista.Plotter
        A new plotter with the same subplots, cameras, lights, backgrounds and size. The
        original is unchanged.

    Raises
    ------
    TypeError, ValueError
        If a number is not allowed.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]], color='red')
    >>> plain = pl.ibr.to_plain_plotter(triangles=500)
    >>> sum(actor.mapper.dataset.n_cells for actor in plain.actors.values()) <= 500
    True
    >>> plain.close()
    >>> pl.close()
    """
    from pvibr.export.plain_plotter import to_plain_plotter
    from pvibr.substitutes.billboard_cloud import billboard_cloud

    self._check_open()
    self.wait()
    self._show()
    window = self.pipeline.window
    if window is not None and not window.GetNeverRendered():
        self._screenshots.draw()  # whose clipping range is that of the scene as it is now
    options = {'triangles': triangles, 'texture': texture, 'detail': detail}
    return to_plain_plotter(self._plotter, self._pipelines, billboard_cloud, **options)


@explicit
@takes(options=to_plain_plotter)
def export_glb(self, path, **options):
    """Write the active subplot as binary glTF: meshes, colours, textures and the camera.

    glTF has no backgrounds, volumes or text; these are dropped. Unlike PyVista's
    ``export_gltf``, the file has alpha cut-outs, unlit surfaces, filtered textures, and
    vertex colours that other programs read.

    Parameters
    ----------
    path : str or pathlib.Path
        File name ending in ``.glb``.
    **options
        See :meth:`to_plain_plotter`.

    Raises
    ------
    TypeError, ValueError
        If a number or the name is not allowed; nothing is written.
    OSError
        If the file cannot be written; the existing file is unchanged.

    Warns
    -----
    PvibrWarning
        If the camera's window centre, which glTF lacks, moves the view by more than 0.01 pixels.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]], color='red')
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.ibr.export_glb(pathlib.Path(folder) / 'balls.glb', triangles=1000)
    ...     print(*[p.name for p in pathlib.Path(folder).iterdir()])
    balls.glb
    >>> pl.close()
    """
    from pvibr.export.glb import export_glb

    number = renderers_of(self._plotter).index(self._plotter.renderer)
    export_glb(path, number, lambda: self.to_plain_plotter(**options))
