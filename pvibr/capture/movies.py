"""Movies: frames at given times, stored until the movie is complete so that it can resume."""

from __future__ import annotations

import errno
import io
import json
import os
import shutil
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.capture.tiled_screenshot import check_samples
from pvibr.core.arguments import checked_number, checked_positive, checked_whole, naming
from pvibr.core.errors import require
from pvibr.core.files import in_a_folder, replacing
from pvibr.core.params import checked_flag

#: Suffixes of movies; anything else is a folder of PNG files.
MOVIES = ('.mp4', '.mov', '.mkv', '.webm', '.avi', '.gif')
#: File in a folder that describes its frames.
NOTE = 'movie.json'
#: Maximum number of frames.
_MOST = 10**7
#: A disk with fewer free bytes counts as full: ffmpeg writes larger chunks.
_FULL = 2**16


class Film:
    """The frames of a movie in a folder, and the movie."""

    def __init__(self, path, *, count, fps, marks, resume):
        self.path, self.count, self.fps = in_a_folder('path', path), count, fps
        self.suffix = self.path.suffix.lower()
        if self.suffix and self.suffix not in MOVIES:
            suffixes = ', '.join(MOVIES)
            raise ValueError(
                f'path must end in one of {suffixes}, or be a folder, got {str(path)!r}'
            )
        if self.suffix not in ('', '.gif'):
            require('imageio_ffmpeg', 'movie', 'Movies')
        with naming('path', path):
            hidden_folder = self.path.with_name(f'.{self.path.name}.frames')
        self.folder = hidden_folder if self.suffix else self.path
        # Through JSON, to compare with what a file returns.
        self._description = json.loads(json.dumps({'count': count, 'fps': fps, **marks}))
        self._resume = resume and self._matches_folder()

    def _matches_folder(self):
        try:
            return json.loads((self.folder / NOTE).read_text('utf-8')) == self._description
        except (OSError, ValueError):
            return False

    def _frame_path(self, k) -> Path:
        return self.folder / f'{k:0{len(str(self.count - 1))}d}.png'

    def missing(self) -> list[int]:
        """Return the numbers of the frames to draw."""
        self.folder.mkdir(exist_ok=True)
        if not self._resume:
            with replacing(self.folder / NOTE) as file:
                file.write_text(json.dumps(self._description), 'utf-8')
            self._resume = True
            return list(range(self.count))
        return [k for k in range(self.count) if not self._is_whole(k)]

    def _is_whole(self, k):
        from PIL import Image

        try:
            with Image.open(self._frame_path(k)) as picture:
                picture.load()
                return list(picture.size) == self._description.get('size', list(picture.size))
        except (OSError, SyntaxError, ValueError):
            return False

    @property
    def recovery(self) -> str:
        """How to resume after an error."""
        return f'Frames are stored in {self.folder}; the same call resumes from there.'

    def write_frame(self, k, png):
        """Write a frame, encoded by `encoded`."""
        with replacing(self._frame_path(k)) as file:
            file.write_bytes(png)

    def finish(self):
        """Encode the movie and remove its frames, except in a folder of PNG files."""
        if not self.suffix:
            (self.folder / NOTE).unlink()
            return
        frames = (self._read(k) for k in range(self.count))
        with replacing(self.path) as file:
            if self.suffix == '.gif':
                _write_gif(file, frames, self.fps)
            else:
                with _writer(file, self.suffix, self.fps) as write:
                    for picture in frames:
                        write(picture)
        shutil.rmtree(self.folder)

    def _read(self, frame_number):
        from PIL import Image

        with Image.open(self._frame_path(frame_number)) as picture:
            pixels = np.asarray(picture.convert('RGB'))
        if self.suffix == '.gif':
            return pixels
        height, width = pixels.shape[:2]
        # Most codecs require even sizes.
        return np.pad(pixels, ((0, height % 2), (0, width % 2), (0, 0)), mode='edge')


def _write_gif(file, pictures, fps):
    """Write a GIF whose frames are each dithered in their own 256 colours."""
    from PIL import Image

    def dithered():
        for picture in map(Image.fromarray, pictures):
            yield picture.quantize(palette=picture.quantize(256))

    frames = dithered()
    first, gif_options = next(frames), {'format': 'GIF', 'save_all': True, 'loop': 0}
    first.save(file, append_images=frames, duration=1e3 / fps, **gif_options)


@contextmanager
def _writer(file, ending, fps):
    import imageio

    writer_options: dict[str, Any] = {'fps': fps, 'macro_block_size': 2}
    if ending == '.webm':
        # WebM rejects the default codec.
        writer_options |= {'codec': 'libvpx-vp9', 'quality': None}
        writer_options['output_params'] = ['-crf', '24', '-b:v', '0', '-fflags', '+bitexact']
    try:
        with imageio.get_writer(file, **writer_options) as movie_writer:
            yield movie_writer.append_data
    except OSError:
        # ffmpeg is another process, of which only the exit is visible here.
        if shutil.disk_usage(file.parent).free < _FULL:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from None
        raise


def record(
    ibr, screenshots, path, count, *, fps, start, speed, each, resume, progress, samples, shutter
) -> Path:
    """Draw and write a movie of ``plotter.ibr``, each frame at its own time."""
    check_samples(samples)
    shutter = checked_number('shutter', shutter, 0, 1)
    if each is not None and not callable(each):
        raise TypeError(f'each must be a function of the time or None, got {each!r:.80}')
    resume = checked_flag('resume', resume)
    progress = checked_flag('progress', progress, optional=True)
    if shutter and samples == 1:
        raise ValueError(
            f'shutter must be 0 with one sample, got {shutter!r}: set samples, such as samples=32'
        )
    ibr.stop()
    old_time = ibr.time
    start = old_time if start is None else checked_number('start', start)
    speed = checked_number('speed', speed)
    frame_times = start + speed * np.arange(count) / fps
    with screenshots.cameras_restored() as state_marks:
        state_marks |= {'start': start, 'speed': speed, 'state': ibr.state()}
        state_marks |= {'samples': samples, 'shutter': shutter}
        film = Film(path, count=count, fps=fps, marks=state_marks, resume=resume)

        def go_to(time):
            ibr.time = time
            if each is not None:
                each(float(time))

        def draw(frame_number):
            go_to(frame_times[frame_number])
            open_seconds = shutter * speed / fps
            frame_time = frame_times[frame_number]
            set_moment = (
                (lambda share: go_to(frame_time + share * open_seconds)) if shutter else None
            )
            picture = screenshots.take(transparent=False, samples=samples, moments=set_moment)
            screenshots.call_back()
            return picture

        try:
            write_movie(film, lambda missing: ((k, encoded(draw(k))) for k in missing), progress)
        finally:
            ibr.time = old_time
    screenshots.draw()
    return film.path


def encoded(picture) -> bytes:
    """Return a picture as a PNG file."""
    from PIL import Image

    # Fast rather than small: most are read once, to encode a movie.
    png = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(png, 'PNG', compress_level=1)
    return png.getvalue()


def write_movie(film, drawn, progress=None):
    """Write a movie of frames that `drawn` yields for the numbers of missing ones, and encode it.

    It yields their numbers and `encoded` pictures, in any order.
    """
    missing_frames = film.missing()
    try:
        with _bar(film, len(missing_frames), progress) as advance:
            for frame_number, png in drawn(missing_frames):
                film.write_frame(frame_number, png)
                advance()
        film.finish()
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(film.recovery) from error
    except OSError as error:
        message = str(error) if error.strerror is None or error.filename else error.strerror
        reason = message.partition('\n')[0].rstrip('.')
        raise OSError(error.errno, f'{reason}. {film.recovery}') from error


def _bar(film, missing_count, is_wanted):
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    if not (console.is_terminal if is_wanted is None else is_wanted):
        return nullcontext(lambda: None)

    @contextmanager
    def bar():
        with Progress(console=console) as progress:
            steps = {'total': film.count, 'completed': film.count - missing_count}
            task = progress.add_task(f'writing {film.path}', **steps)
            yield lambda: progress.advance(task)

    return bar()


def checked_count(seconds, frames, fps) -> int:
    """Return a movie's number of frames, from it or from the duration."""
    if (seconds is None) == (frames is None):
        raise TypeError(
            f'either seconds or frames must be given, got seconds={seconds!r}, frames={frames!r}'
        )
    fps = checked_positive('fps', fps)
    if frames is not None:
        return checked_whole('frames', frames, 1, _MOST)
    count = checked_positive('seconds', seconds) * fps
    if count > _MOST:
        raise ValueError(
            f'seconds times fps must be at most {_MOST:,} frames, got {seconds} s at {fps} fps'
        )
    return max(1, round(count))
