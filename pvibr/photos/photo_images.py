"""Lookup of pictures, only within a project's folders."""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path

#: Folders of a project that hold cameras rather than pictures: the project's root is above them.
_INNER = {
    *('sparse', 'dense', 'colmap', 'text', 'txt', 'bin', 'model', 'models', 'undistorted', 'sfm'),
    *('reconstruction', 'reconstruction_sequential', 'reconstruction_global', 'matches', 'mvs'),
    *('opensfm', 'openmvg', 'bundle', 'pmvs', 'output', 'outputs', 'results', 'opf', 'cameras'),
}
#: Folders of a project that hold pictures.
_FOLDERS = ('images', 'imgs', 'photos', 'pictures', 'input', 'rgb', 'undistorted/images')
_ENDINGS = ('.jpg', '.jpeg', '.png', '.tif', '.tiff', '.webp', '.bmp', '.jp2', '.exr')


class PictureFolders:
    """The folders where the pictures of a camera file may be."""

    def __init__(self, file, images=None):
        camera_folder = file if file.is_dir() else file.parent
        root = camera_folder
        for _ in range(4):
            is_inner = root.name.lower() in _INNER or root.name.isdigit()
            root = root.parent if is_inner and root.parent != root else root
        self.root = root
        roots = [camera_folder, root] if images is None else [images, camera_folder, root]
        self._allowed = [r.resolve() for r in roots]
        self._before_links = [Path(os.path.abspath(r)) for r in roots] + self._allowed
        bases = [base / sub for base in roots for sub in ('', *_FOLDERS)]
        self._bases = list(dict.fromkeys(bases))
        self._listed: dict = {}

    def find(self, name) -> Path | None:
        """Return the picture of a name, by its full path or ever shorter tails of it."""
        parts = [part for part in re.split(r'[\\/]+', name) if part not in ('', '.')]
        if not parts or any(ord(c) < 32 for c in name):
            return None
        if Path(name).is_absolute():
            picture = self._existing(Path('/'), parts)
            if picture is not None:
                return picture
        for start in range(len(parts)):
            for base in self._bases:
                picture = self._existing(base, parts[start:])
                if picture is not None:
                    return picture
        return None

    def _existing(self, base, parts):
        """Return a picture if it exists and is inside the project."""
        path = Path(os.path.abspath(base.joinpath(*parts)))
        if not any(path.is_relative_to(r) for r in self._before_links):
            return None  # not even listing folders outside
        real_name = self._listing(path.parent).get(path.name.lower())
        if real_name is None:
            return None
        picture = path.with_name(real_name)
        inside = any(picture.resolve().is_relative_to(r) for r in self._allowed)
        return picture if inside else None

    def _listing(self, folder):
        """Return names in a folder by their lower case, with and without suffix."""
        if folder not in self._listed:
            names_by_lower: dict[str, str] = {}
            self._listed[folder] = names_by_lower
            try:
                names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file())
            except OSError:
                return names_by_lower
            pictures = [n for n in names if Path(n).suffix.lower() in _ENDINGS]
            names_by_lower.update({Path(n).stem.lower(): n for n in reversed(pictures)})
            names_by_lower.update({n.lower(): n for n in names})
        return self._listed[folder]


def size_of_picture(path):
    """Return width and height of a picture from its header, None if unreadable."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        limit = Image.MAX_IMAGE_PIXELS
        Image.MAX_IMAGE_PIXELS = None
        try:
            with Image.open(path) as picture:
                return picture.size
        except Exception:
            return None
        finally:
            Image.MAX_IMAGE_PIXELS = limit
