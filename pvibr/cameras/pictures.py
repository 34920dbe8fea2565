"""The pictures of cameras, looked up within a project's folders only."""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path

#: Folders of a project that hold cameras, not pictures: the project begins above them.
_INNER = {
    *('sparse', 'dense', 'colmap', 'text', 'txt', 'bin', 'model', 'models', 'undistorted', 'sfm'),
    *('reconstruction', 'reconstruction_sequential', 'reconstruction_global', 'matches', 'mvs'),
    *('opensfm', 'openmvg', 'bundle', 'pmvs', 'output', 'outputs', 'results', 'opf', 'cameras'),
}
#: Folders of a project that hold pictures.
_FOLDERS = ('images', 'imgs', 'photos', 'pictures', 'input', 'rgb', 'undistorted/images')
_ENDINGS = ('.jpg', '.jpeg', '.png', '.tif', '.tiff', '.webp', '.bmp', '.jp2', '.exr')


class PictureFolders:
    """Where the pictures of a file of cameras may be."""

    def __init__(self, file, images=None):
        folder = file if file.is_dir() else file.parent
        root = folder
        for _ in range(4):
            inner = root.name.lower() in _INNER or root.name.isdigit()
            root = root.parent if inner and root.parent != root else root
        self.root = root
        roots = [folder, root] if images is None else [images, folder, root]
        self._allowed = [r.resolve() for r in roots]
        self._before_links = [Path(os.path.abspath(r)) for r in roots] + self._allowed
        bases = [base / sub for base in roots for sub in ('', *_FOLDERS)]
        self._bases = list(dict.fromkeys(bases))
        self._listed: dict = {}

    def find(self, name) -> Path | None:
        """Return the picture of a name, by its full path or ever shorter ends of it."""
        parts = [part for part in re.split(r'[\\/]+', name) if part not in ('', '.')]
        if not parts or any(ord(c) < 32 for c in name):
            return None
        if Path(name).is_absolute():
            found = self._known(Path('/'), parts)
            if found is not None:
                return found
        for start in range(len(parts)):
            for base in self._bases:
                found = self._known(base, parts[start:])
                if found is not None:
                    return found
        return None

    def _known(self, base, parts):
        """Return a picture if it exists and is inside the project."""
        path = Path(os.path.abspath(base.joinpath(*parts)))
        if not any(path.is_relative_to(r) for r in self._before_links):
            return None  # not even listed
        real = self._listing(path.parent).get(path.name.lower())
        if real is None:
            return None
        found = path.with_name(real)
        inside = any(found.resolve().is_relative_to(r) for r in self._allowed)
        return found if inside else None

    def _listing(self, folder):
        """Return names in a folder by lower case, with and without their endings."""
        if folder not in self._listed:
            found: dict[str, str] = {}
            self._listed[folder] = found
            try:
                names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file())
            except OSError:
                return found
            pictures = [n for n in names if Path(n).suffix.lower() in _ENDINGS]
            found.update({Path(n).stem.lower(): n for n in reversed(pictures)})
            found.update({n.lower(): n for n in names})
        return self._listed[folder]


def size_of_picture(path):
    """Return width and height of a picture, from its head; None if it cannot be read."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None  # nothing is decoded here
        try:
            with Image.open(path) as picture:
                return picture.size
        except Exception:
            return None
        finally:
            Image.MAX_IMAGE_PIXELS = limit
