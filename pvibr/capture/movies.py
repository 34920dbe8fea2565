"""Movies: frames at given times, kept until the movie is complete, so that it can be resumed."""

from __future__ import annotations

import errno
import json
import os
import shutil
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.capture.tiled_screenshot import check_samples
from pvibr.core.errors import require
from pvibr.core.files import in_a_folder, replacing
from pvibr.core.params import checked_flag
from pvibr.maths.arguments import checked_number, checked_positive, checked_whole, naming

#: Suffixes of movies; anything else is a folder of PNG files.
MOVIES = ('.mp4', '.mov', '.mkv', '.webm', '.avi', '.gif')
#: File that describes the frames in a folder.
NOTE = 'movie.json'
#: Maximum number of frames.
_MOST = 10**7
#: Free bytes of a disk that counts as full: ffmpeg writes more than these at once.
_FULL = 2**16


class Film:
    """The frames of a movie in a folder, and the movie."""

    def __init__(self, path, *, count, fps, marks, resume):
        self.path, self.count, self.fps = in_a_folder('path', path), count, fps
        self.ending = self.path.suffix.lower()
        if self.ending and self.ending not in MOVIES:
            known = ', '.join(MOVIES)
            raise ValueError(
                f'path is {str(path)!r}; it must end in one of {known}, or be a folder.'
            )
        if self.ending not in ('', '.gif'):
            require('imageio_ffmpeg', 'movie', 'Movies')
        with naming('path', path):
            hidden = self.path.with_name(f'.{self.path.name}.frames')
        self.folder = hidden if self.ending else self.path
        # As JSON returns it.
        self._note = json.loads(json.dumps({'count': count, 'fps': fps, **marks}))
        self._resume = resume and self._is_same()

    def _is_same(self):
        try:
            return json.loads((self.folder / NOTE).read_text('utf-8')) == self._note
        except (OSError, ValueError):
            return False

    def _file(self, k) -> Path:
        return self.folder / f'{k:0{len(str(self.count - 1))}d}.png'

    def missing(self) -> list[int]:
        """Return the numbers of the frames to draw."""
        self.folder.mkdir(exist_ok=True)
        if not self._resume:
            with replacing(self.folder / NOTE) as file:
                file.write_text(json.dumps(self._note), 'utf-8')
            self._resume = True
            return list(range(self.count))
        return [k for k in range(self.count) if not self._is_whole(k)]

    def _is_whole(self, k):
        from PIL import Image

        try:
            with Image.open(self._file(k)) as picture:
                picture.load()
                return list(picture.size) == self._note.get('size', list(picture.size))
        except (OSError, SyntaxError, ValueError):
            return False

    @property
    def kept(self) -> str:
        """What to do after an error."""
        return f'Frames are kept in {self.folder}; the same call resumes from there.'

    def keep(self, k, picture):
        """Write a frame."""
        from PIL import Image

        with replacing(self._file(k)) as file:
            # Fast: it is read once.
            Image.fromarray(np.ascontiguousarray(picture)).save(file, compress_level=1)

    def finish(self):
        """Encode the movie and remove its frames; a folder of PNG files stays."""
        if not self.ending:
            (self.folder / NOTE).unlink()
            return
        pictures = (self._read(k) for k in range(self.count))
        with replacing(self.path) as file:
            if self.ending == '.gif':
                _write_gif(file, pictures, self.fps)
            else:
                with _writer(file, self.ending, self.fps) as write:
                    for picture in pictures:
                        write(picture)
        shutil.rmtree(self.folder)

    def _read(self, k):
        from PIL import Image

        with Image.open(self._file(k)) as picture:
            pixels = np.asarray(picture.convert('RGB'))
        if self.ending == '.gif':
            return pixels
        height, width = (n - n % 2 for n in pixels.shape[:2])  # most codecs require even sizes
        return pixels[:height, :width]


def _write_gif(file, pictures, fps):
    """Write a GIF, each frame dithered in 256 colours of its own."""
    from PIL import Image

    def dithered():
        for picture in map(Image.fromarray, pictures):
            yield picture.quantize(palette=picture.quantize(256))

    frames = dithered()
    first, options = next(frames), {'format': 'GIF', 'save_all': True, 'loop': 0}
    first.save(file, append_images=frames, duration=1e3 / fps, **options)


@contextmanager
def _writer(file, ending, fps):
    import imageio

    options: dict[str, Any] = {'fps': fps, 'macro_block_size': 2}
    if ending == '.webm':
        # WebM does not allow the default codec.
        options |= {'codec': 'libvpx-vp9', 'quality': None}
        options['output_params'] = ['-crf', '24', '-b:v', '0', '-fflags', '+bitexact']
    try:
        with imageio.get_writer(file, **options) as writer:
            yield writer.append_data
    except OSError:
        # ffmpeg is another process, and only its end is known here.
        if shutil.disk_usage(file.parent).free < _FULL:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from None
        raise


def record(
    ibr, screenshots, path, count, *, fps, start, speed, each, resume, progress, samples, shutter
) -> Path:
    """Draw the frames of a movie of ``plotter.ibr``, each at its own time, and write it."""
    check_samples(samples)
    shutter = checked_number('shutter', shutter, 0, 1)
    if each is not None and not callable(each):
        raise TypeError(f'each = {each!r:.80}: must be a function of the time, or None')
    resume = checked_flag('resume', resume)
    progress = checked_flag('progress', progress, optional=True)
    if shutter and samples == 1:
        raise ValueError(
            f'shutter = {shutter!r}: needs several samples over that time, such as samples=32.'
        )
    ibr.stop()
    before = ibr.time
    start = before if start is None else checked_number('start', start)
    speed = checked_number('speed', speed)
    times = start + speed * np.arange(count) / fps
    with screenshots.cameras_restored() as marks:
        marks |= {'start': start, 'speed': speed, 'state': ibr.state()}
        marks |= {'samples': samples, 'shutter': shutter}
        film = Film(path, count=count, fps=fps, marks=marks, resume=resume)

        def be_at(time):
            ibr.time = time
            if each is not None:
                each(float(time))

        def draw(k):
            be_at(times[k])
            opened = shutter * speed / fps
            moments = (lambda share: be_at(times[k] + share * opened)) if shutter else None
            return screenshots.take(transparent=False, samples=samples, moments=moments)

        try:
            write_movie(film, draw, progress=progress)
        finally:
            ibr.time = before
    screenshots.draw()
    return film.path


def write_movie(film, draw, *, progress=None):
    """Draw the missing frames of a movie, and encode it."""
    missing = film.missing()
    try:
        with _bar(film, len(missing), progress) as step:
            for k in missing:
                film.keep(k, draw(k))
                step()
        film.finish()
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(film.kept) from error
    except OSError as error:
        named = str(error) if error.strerror is None or error.filename else error.strerror
        why = named.partition('\n')[0].rstrip('.')
        raise OSError(error.errno, f'{why}. {film.kept}') from error


def _bar(film, missing, wanted):
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    if not (console.is_terminal if wanted is None else wanted):
        return nullcontext(lambda: None)

    @contextmanager
    def bar():
        with Progress(console=console) as shown:
            done = film.count - missing
            task = shown.add_task(f'writing {film.path}', total=film.count, completed=done)
            yield lambda: shown.advance(task)

    return bar()


def checked_count(seconds, frames, fps) -> int:
    """Return the number of frames of a movie, of which it or the duration is given."""
    if (seconds is None) == (frames is None):
        raise TypeError(
            'give seconds, the duration of the movie, or frames, their number: one of these'
        )
    fps = checked_positive('fps', fps)
    if frames is not None:
        return checked_whole('frames', frames, 1, _MOST)
    count = checked_positive('seconds', seconds) * fps
    if count > _MOST:
        raise ValueError(f'seconds = {seconds} at fps = {fps} are more than {_MOST:,} frames')
    return max(1, round(count))
