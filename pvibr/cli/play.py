"""``pvibr play``: an animated file in a window, as a movie or as an image."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pyvista as pv
from rich.console import Console
from rich.table import Table

from pvibr.capture.montage import check_image, save
from pvibr.capture.movies import MOVIES
from pvibr.capture.offscreen import SKY
from pvibr.figures.as_figure import as_figure

#: Times of a clip that are entirely in view.
MOMENTS = 12
#: Size of the view relative to the figure.
MARGIN = 1.05
#: Seconds of the cross-fade between clips.
FADE = 0.3


def main(file, *, clip, movie, time, out, fps, size, speed, seconds, skinning):
    """Play a file: in a window, or off screen if a movie or an image is requested."""
    _check(movie, time, out)
    figure = as_figure(file)
    clip = _clip_of(figure, clip)
    console = Console()
    if figure.clips:
        console.print(_clips(figure, clip))
    if movie is None and time is None and out is None:
        _show(figure, clip, file, size, speed, skinning)
        return
    if movie is not None:
        size = [n + n % 2 for n in size]  # as most codecs want them
    plotter, actor = _stage(figure, clip, file, size, skinning, off_screen=True)
    if movie is not None:
        actor.play(clip, speed=speed)
        plotter.ibr.movie(movie, _length(figure, clip, speed, seconds), fps=fps, progress=True)
    else:
        movie = out or f'{Path(file).stem}.png'
        plotter.ibr.time = time or 0.0
        save(movie, plotter.screenshot(None, return_img=True))
    plotter.close()
    console.print(f'wrote {movie}')


def _check(movie, time, out):
    if movie is not None and (time is not None or out is not None):
        raise ValueError('--movie writes a movie, --time and -o one image: give one of them.')
    if out is not None:
        check_image(out)
    if movie is None:
        return
    ending = Path(movie).suffix.lower()
    if ending not in MOVIES:
        raise ValueError(f'--movie is {str(movie)!r}; it must end in one of {", ".join(MOVIES)}.')


def _clip_of(figure, name):
    """Return a clip by name, or by number if no clip has that name."""
    names = {clip.name for clip in figure.clips}
    if name is not None and name not in names and name.isdecimal():
        name = int(name)
    return figure.clip(name)


def _clips(figure, chosen):
    table = Table('clip', 'seconds', title=f'{figure.name}: {len(figure.clips)} clips')
    for clip in figure.clips:
        mark = '*' if clip is chosen else ''
        table.add_row(f'{clip.name}{mark}', f'{clip.duration:.2f}')
    return table


def _length(figure, clip, speed, seconds):
    """Return the duration of a movie: by default that of the clip."""
    if seconds is not None:
        return seconds
    if clip is None or not clip.duration:
        raise ValueError(
            f'nothing in {figure.name or "the file"} moves: give --seconds, or --time 0.'
        )
    return clip.duration / abs(speed)


def _stage(figure, clip, file, size, skinning, *, off_screen):
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), title=str(file))
    plotter.set_background(SKY)  # type: ignore[arg-type]
    plotter.enable_anti_aliasing('msaa')
    actor = plotter.ibr.add_animated(figure, clip=clip, skinning=skinning)
    stands = Path(file).suffix.lower() in ('.glb', '.gltf')
    _look(plotter, _box(figure, clip), (0, 1, 0) if stands else (0, 0, 1))
    return plotter, actor


def _box(figure, clip):
    """Return the corners of the bounding box of a clip, shape (8, 3)."""
    duration = 0.0 if clip is None else clip.duration
    times = np.linspace(0, duration, MOMENTS if duration else 1)
    bounds = np.array([figure.mesh(t, clip).bounds for t in times]).reshape(-1, 3, 2)
    ends = np.stack([bounds[..., 0].min(0), bounds[..., 1].max(0)], 1)
    return np.array(list(product(*ends)))


def _look(plotter, corners, up):
    """Look at a box from the front, slightly from the left and above."""
    up = np.array(up, float)
    fore = np.array([0, 0, 1.0]) if up[1] else np.array([0, -1.0, 0])
    way = fore + 0.6 * np.cross(up, fore) + 0.35 * up
    way /= np.linalg.norm(way)
    right = np.cross(up, way) / np.linalg.norm(np.cross(up, way))
    middle = corners.mean(0)
    across, above, near = np.stack([right, np.cross(way, right), way]) @ (corners - middle).T
    width, height = plotter.window_size
    tangent = np.tan(np.radians(plotter.camera.view_angle) / 2)
    reach = np.maximum(abs(across) * height / width, abs(above)) * MARGIN / tangent
    eye = middle + (near + reach).max() * way
    plotter.camera_position = [tuple(eye), tuple(middle), tuple(up)]
    plotter.reset_camera_clipping_range()


def _show(figure, clip, file, size, speed, skinning):
    plotter, actor = _stage(figure, clip, file, size, skinning, off_screen=False)
    actor.play(clip, speed=speed)
    following = _Keys(plotter, figure, actor, clip, speed)
    plotter.add_key_event('space', following.pause)
    if len(figure.clips) > 1:
        plotter.add_key_event('n', following.next)
    keys = 'space: pause' + ('   n: next clip' if len(figure.clips) > 1 else '') + '   q: close'
    plotter.add_text(keys, font_size=8, color='black')
    plotter.ibr.play()
    plotter.show()


class _Keys:
    """Actions of keys in the window."""

    def __init__(self, plotter, figure, actor, clip, speed):
        self.plotter, self.figure, self.actor = plotter, figure, actor
        self.clip, self.speed = clip, speed

    def pause(self):
        ibr = self.plotter.ibr
        if ibr.playing:
            ibr.stop()
        else:
            ibr.play()

    def next(self):
        clips = self.figure.clips
        self.clip = clips[(clips.index(self.clip) + 1) % len(clips)]
        self.actor.play(self.clip, speed=self.speed, fade=FADE)
