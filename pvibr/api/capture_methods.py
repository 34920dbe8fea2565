"""The clock, screenshots and movies: methods of ``plotter.ibr``."""

from __future__ import annotations

from pvibr.capture.movies import checked_count, record
from pvibr.core.params import checked_flag


def play(self, speed=1.0, loop=None, *, fps=None):
    """Start the animation clock of windows, notebooks and movies.

    Windows, and pages rendered on a server (``jupyter_backend='server'`` or ``'trame'``, trame
    applications), follow the wall clock from their first frame on. While a movie is open,
    each ``plotter.write_frame()`` advances the time by one frame. Off screen nothing else
    does: set `time`.

    Parameters
    ----------
    speed : float
        Animation seconds per second; negative plays backward.
    loop : float, optional
        Duration in seconds after which the animation restarts.
    fps : float, optional
        Frames per second of a movie; by default those with which it was opened.

    Raises
    ------
    TypeError, ValueError
        If an argument is not a number, or out of range.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    >>> pl.ibr.play(speed=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.open_gif(pathlib.Path(folder) / 'ball.gif', fps=10)
    ...     for _ in range(4):
    ...         pl.write_frame()
    ...     pl.close()
    >>> pl.ibr.time
    0.2
    """
    self._check_open()
    self._clock.start(self._time, speed=speed, loop=loop, fps=fps)


def stop(self):
    """Stop the animation clock at the current time."""
    self._thread.check()
    self._clock.stop()


def screenshot(
    self,
    filename=None,
    *,
    scale=None,
    window_size=None,
    transparent_background=None,
    return_img=True,
    samples=1,
):
    """Take a screenshot of any size, without seams in effects.

    Like ``plotter.screenshot``, but tiles of large images overlap by the reach of the
    effects. Light that spreads over the whole image, as in :class:`pvibr.Bloom`, is computed
    at the window's size.

    Parameters
    ----------
    filename : path, optional
        File to write; its suffix selects the format.
    scale : int, optional
        Magnification of the window. Lines, points and text keep their size in pixels, as with
        ``plotter.screenshot(scale=...)``.
    window_size : tuple of 2 int, optional
        Width and height of the image in pixels, instead of `scale`; meanwhile the window has
        this aspect ratio, at most at its present size.
    transparent_background : bool, optional
        Whether the background is transparent; by default as the theme says.
    return_img : bool
        Whether to return the image: (h, w, 3 or 4), uint8, top row first.
    samples : int
        Samples of each pixel, in place of the window's: the image is their mean, as
        :class:`pvibr.Accumulation` has it.

    Raises
    ------
    ValueError
        If a number is out of range, or both sizes are given.
    OSError
        If there is no such folder, or the file cannot be written; an existing file is kept.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> pl.ibr.screenshot(window_size=(150, 100)).shape
    (100, 150, 3)
    >>> smooth = pl.ibr.screenshot(samples=16)
    >>> pl.close()
    """
    self._check_open()
    return_img = checked_flag('return_img', return_img)
    self.wait()
    image = self._screenshots.take(
        scale, window_size, transparent_background, filename, samples=samples
    )
    return image if return_img else None


def movie(
    self,
    path,
    seconds=None,
    *,
    frames=None,
    fps=30.0,
    start=None,
    speed=1.0,
    each=None,
    resume=True,
    progress=None,
    samples=1,
    shutter=0.0,
):
    """Record a movie: each frame shows its own time, however long it takes to render.

    Frames are stored beside the movie until it is complete. After an error, a full disk or
    Ctrl-C, the same call resumes, in any process, if time, cameras, settings and window are
    the same; otherwise it starts over.

    Parameters
    ----------
    path : path
        A movie (``.mp4``, ``.mov``, ``.mkv``, ``.webm``, ``.avi``: the extra ``movie``), a
        ``.gif``, or a folder of PNG files. Videos have even sides: an odd one gets one column
        or row more, a repeat of its last.
    seconds : float, optional
        Duration of the movie.
    frames : int, optional
        Number of frames, instead of `seconds`.
    fps : float
        Frames per second.
    start : float, optional
        Animation time of the first frame, in seconds; by default :attr:`time`.
    speed : float
        Animation seconds per second; negative plays backward.
    each : callable, optional
        Called with the time before each frame, for example to move the camera. A frame must
        depend on its time alone.
    resume : bool
        Whether to reuse frames of an earlier call.
    progress : bool, optional
        Whether to show a progress bar on standard error; by default on terminals.
    samples : int
        Samples of each pixel, as for :meth:`screenshot`.
    shutter : float
        Fraction of a frame's time over which its samples are spread, for motion blur; 0.5 is
        that of most film cameras.

    Returns
    -------
    pathlib.Path
        The movie or the folder. Time and cameras are restored.

    Raises
    ------
    TypeError, ValueError
        If an argument or the suffix is not allowed.
    ImportError
        If the extra ``movie`` is needed and not installed.
    OSError
        If the folder does not exist, or a file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    >>> _ = pl.add_mesh(pv.Cone())
    >>> def turn(time):
    ...     pl.view_isometric()
    ...     pl.camera.azimuth = 90 * time
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.ibr.movie(pathlib.Path(folder) / 'cone.gif', 0.5, fps=8, each=turn).name
    'cone.gif'
    >>> pl.close()
    """
    self._check_open()
    count = checked_count(seconds, frames, fps)
    timing = {'fps': float(fps), 'start': start, 'speed': speed}
    options = {'each': each, 'resume': resume, 'progress': progress}
    options |= {'samples': samples, 'shutter': shutter}
    self.wait()
    return record(self, self._screenshots, path, count, **timing, **options)
