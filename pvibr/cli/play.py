"""``pvibr play``: an animated file in a window, a movie or an image."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pyvista as pv
from rich.console import Console
from rich.table import Table

from pvibr.capture.montage import check_image, save
from pvibr.capture.movies import MOVIES
from pvibr.figures.as_figure import as_figure
from pvibr.scenes.stage import SKY

#: Times at which a clip is kept in view.
MOMENTS = 12
#: Size of the view over that of the figure.
MARGIN = 1.05
#: Duration of the cross-fade between clips, seconds.
FADE = 0.3


def main(file, *, clip, movie, time, out, fps, size, speed, seconds, skinning):
    """Play a file in a window, or write a movie or an image."""
    _check(movie, time, out)
    figure = as_figure(file)
    clip = _clip_of(figure, clip)
    console = Console()
    if figure.clips:
        console.print(_clips(figure, clip))
    if movie is None and time is None and out is None:
        _show(figure, clip, file, size, speed, skinning)
        return
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
        raise ValueError(
            '--movie excludes --time and --out, which write an image: use one of them.'
        )
    if out is not None:
        check_image(out)
    if movie is None:
        return
    suffix = Path(movie).suffix.lower()
    if suffix not in MOVIES:
        raise ValueError(f'--movie must end in one of {", ".join(MOVIES)}, got {str(movie)!r}.')


def _clip_of(figure, name):
    """Return a clip by name, or by number if no clip has that name."""
    names = {clip.name for clip in figure.clips}
    if name is not None and name not in names and name.isdecimal():
        name = int(name)
    return figure.clip(name)


def _clips(figure, playing):
    table = Table('clip', 'seconds', title=f'{figure.name}: {len(figure.clips)} clips')
    for clip in figure.clips:
        mark = '*' if clip is playing else ''
        table.add_row(f'{clip.name}{mark}', f'{clip.duration:.2f}')
    return table


def _length(figure, clip, speed, seconds):
    """Return the duration of a movie, by default that of the clip."""
    if seconds is not None:
        return seconds
    if clip is None or not clip.duration:
        raise ValueError(
            f'nothing moves in {figure.name or "the file"}: use --seconds or --time 0.'
        )
    return clip.duration / abs(speed)


def _stage(figure, clip, file, size, skinning, *, off_screen):
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), title=str(file))
    plotter.set_background(SKY)  # type: ignore[arg-type]
    plotter.enable_anti_aliasing('msaa')
    figure_actor = plotter.ibr.add_animated(figure, clip=clip, skinning=skinning)
    is_y_up = Path(file).suffix.lower() in ('.glb', '.gltf')
    _look(plotter, _box(figure, clip), (0, 1, 0) if is_y_up else (0, 0, 1))
    return plotter, figure_actor


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
    front = np.array([0, 0, 1.0]) if up[1] else np.array([0, -1.0, 0])
    to_eye = front + 0.6 * np.cross(up, front) + 0.35 * up
    to_eye /= np.linalg.norm(to_eye)
    right = np.cross(up, to_eye) / np.linalg.norm(np.cross(up, to_eye))
    box_center = corners.mean(0)
    x, y, z = np.stack([right, np.cross(to_eye, right), to_eye]) @ (corners - box_center).T
    width, height = plotter.window_size
    half_tangent = np.tan(np.radians(plotter.camera.view_angle) / 2)
    distances = np.maximum(abs(x) * height / width, abs(y)) * MARGIN / half_tangent
    eye = box_center + (z + distances).max() * to_eye
    plotter.camera_position = [tuple(eye), tuple(box_center), tuple(up)]
    plotter.reset_camera_clipping_range()


def _show(figure, clip, file, size, speed, skinning):
    plotter, figure_actor = _stage(figure, clip, file, size, skinning, off_screen=False)
    figure_actor.play(clip, speed=speed)
    key_actions = _Keys(plotter, figure, figure_actor, clip, speed)
    plotter.add_key_event('space', key_actions.pause)
    if len(figure.clips) > 1:
        plotter.add_key_event('n', key_actions.next)
    next_clip = '   n: next clip' if len(figure.clips) > 1 else ''
    plotter.add_text(f'space: pause{next_clip}   q: close', font_size=8, color='black')
    plotter.ibr.play()
    plotter.show()


class _Keys:
    """Key actions of the window."""

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
