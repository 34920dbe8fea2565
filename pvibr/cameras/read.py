"""Cameras and pictures of any photogrammetry program."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.cameras import colmap, metashape, ortho, programs, projects
from pvibr.cameras.photos import Photo, Photos
from pvibr.cameras.pictures import PictureFolders, size_of_picture
from pvibr.core.errors import warn
from pvibr.maths.arguments import check_one_of, naming

_HEAD = 65536  # bytes that tell a format
_READERS = {
    'colmap': colmap.read,
    'opensfm': programs.read_opensfm,
    'openmvg': programs.read_openmvg,
    'openmvs': programs.read_openmvs,
    'bundler': programs.read_bundler,
    'nvm': programs.read_nvm,
    'metashape': metashape.read,
    'opf': projects.read_opf,
    'transforms': projects.read_transforms,
    'orthophoto': ortho.read,
}
_COLMAP_TABLES = ('cameras', 'images', 'rigs', 'frames')
#: What JSON files of a format hold near their beginning.
_TELLS = {
    b'application/opf-': 'opf',
    b'"sfm_data_version"': 'openmvg',
    b'"transform_matrix"': 'transforms',
    b'"camera_angle_x"': 'transforms',
    b'"projection_type"': 'opensfm',
    b'"shots"': 'opensfm',
}
#: Where folders of projects hold their cameras: patterns by format, the first that fits is read.
_IN_FOLDERS = {
    'colmap': ('images.bin', 'images.txt'),
    'transforms': ('transforms.json', 'transforms_train.json'),
    'opensfm': ('reconstruction.json', 'opensfm/reconstruction.json'),
    'opf': ('*.opf', 'calibrated_cameras.json', 'opf/*.opf'),
    'metashape': ('*.xml',),
    'nvm': ('*.nvm',),
    'openmvs': ('*.mvs',),
    'openmvg': ('sfm_data.json', '*/sfm_data.json'),
    'bundler': ('bundle.out', 'bundle/bundle.out', '*.out'),
}
#: What may be wrong with pictures.
_SAYS = {
    'missing': 'have no picture in the project (images= names another folder)',
    'unreadable': 'have pictures that cannot be read',
    'unlike': 'have pictures of other proportions, which are left out',
    'scaled': 'have pictures of another size, to which their cameras are scaled',
    'unsized': 'are left out: neither the file nor a picture tells their size',
}
_COLMAP_FOLDERS = ('', 'sparse', 'dense/sparse', 'dense/0/sparse', 'colmap/sparse', 'colmap', '0')


def read_cameras(path, images=None, *, format=None):
    """Read the cameras and pictures of a photogrammetry program.

    Parameters
    ----------
    path : str or pathlib.Path
        A file, or the folder of a project: of COLMAP (binary or text, rigs too), OpenSfM, OpenMVG,
        OpenMVS (interface archives), Bundler, VisualSFM (NVM), Agisoft Metashape (XML), Pix4D
        (OPF), nerfstudio, instant-ngp or Blender (``transforms.json``); a GeoTIFF, a picture with
        a world file, or a folder of these.
    images : str or pathlib.Path, optional
        The folder of the pictures. By default they are looked up in the project: beside the file,
        in the project's folder above ``sparse/0`` and the like, and in folders named ``images``,
        ``photos``, ``input`` or ``rgb`` there; never elsewhere, whatever the file names.
    format : str, optional
        ``'colmap'``, ``'opensfm'``, ``'openmvg'``, ``'openmvs'``, ``'bundler'``, ``'nvm'``,
        ``'metashape'``, ``'opf'``, ``'transforms'`` or ``'orthophoto'``; by default it is found by
        the content.

    Returns
    -------
    Photos
        A :class:`Photo` for each registered picture, in the file's order and its world.

    Raises
    ------
    FileNotFoundError
        If there is no such file or folder.
    ValueError
        If no format fits, or the file is broken; file and line or byte are named.

    Warns
    -----
    PvibrWarning
        If pictures are missing, unreadable or of other proportions (their `path` is None), or of
        another size (their cameras are scaled).

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pvibr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
    ...     camera = pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100))
    ...     pvibr.write_cameras(f'{folder}/sparse/0', [pvibr.Photo('a.png', camera)])
    ...     import imageio.v3
    ...
    ...     imageio.v3.imwrite(f'{folder}/a.png', np.zeros((100, 100, 3), np.uint8))
    ...     pvibr.read_cameras(folder)[0]
    Photo('a.png', 100 x 100, at [0, 0, -5])
    """
    with naming('path', path):
        path = Path(path).expanduser()
    if not path.exists():
        raise FileNotFoundError(f'path is {str(path)!r}; there is no such file or folder.')
    if images is not None:
        with naming('images', images):
            images = Path(images).expanduser()
        if not images.is_dir():
            raise FileNotFoundError(f'images is {str(images)!r}; there is no such folder.')
    if format is not None:
        check_one_of('format', format, _READERS)
    found, file = _located(path, format)
    with np.errstate(all='ignore'):
        entries = _READERS[found](file)
        return _with_pictures(entries, file, path, images)


def read_frustums(path, **options):
    """Return what :func:`read_cameras` reads as lines, for ``pyvista.read``."""
    return read_cameras(path, **options).frustums()


def _located(path, wanted):
    """Return the format and the file, or folder, to read."""
    if path.is_file():
        return wanted or format_of(path), path
    for name in [wanted] if wanted else _IN_FOLDERS:
        file = _in_folder(path, name)
        if file is not None:
            return name, file
    if wanted in (None, 'orthophoto') and any(map(ortho.is_referenced, _listed(path))):
        return 'orthophoto', path
    raise ValueError(
        f'{path}: the folder at this path has no cameras; there should be one of '
        f'{", ".join(p for patterns in _IN_FOLDERS.values() for p in patterns)}, or orthophotos.'
    )


def _in_folder(path, name):
    """Return the file of a format in a project's folder, or None."""
    if name == 'colmap':
        return _colmap_folder(path)
    for pattern in _IN_FOLDERS.get(name, ()):
        for file in sorted(path.glob(pattern)):
            if file.is_file() and format_of(file, strict=False) == name:
                return file
    return None


def _colmap_folder(path):
    for sub in _COLMAP_FOLDERS:
        models = [path / sub, *sorted((path / sub).glob('[0-9]*'))]
        models = [m for m in models if any((m / n).is_file() for n in _IN_FOLDERS['colmap'])]
        if models:
            if len(models) > 1:
                warn(
                    f'{path / sub} has {len(models)} models, each a world of its own: '
                    f'{models[0].name} is read.'
                )
            return models[0]
    return None


def _listed(path):
    return sorted(p for p in path.iterdir() if p.suffix.lower() in ortho.PICTURES)


def format_of(path, *, strict=True):
    """Return the format of a file by its content."""
    with path.open('rb') as file:
        head = file.read(_HEAD)
    found = _by_name(path.suffix.lower(), path.name.lower()) or _by_content(head)
    if found is None and strict:
        raise ValueError(f'{path}, byte 0: the path is of no camera file that pvibr knows.')
    return found


def _by_name(suffix, name):
    if suffix in ortho.WORLD_SUFFIXES or suffix in ortho.PICTURES:
        return 'orthophoto'
    endings = {'.mvs': 'openmvs', '.nvm': 'nvm', '.out': 'bundler', '.opf': 'opf'}
    names = {'transforms.json': 'transforms', 'reconstruction.json': 'opensfm'}
    names |= {f'{n}{e}': 'colmap' for n in _COLMAP_TABLES for e in ('.bin', '.txt')}
    return endings.get(suffix) or names.get(name)


def _by_content(head):
    start = head.lstrip(b'\xef\xbb\xbf \r\n')
    begins = {b'MVSI': 'openmvs', b'NVM_V': 'nvm', b'# Bundle file': 'bundler'}
    if start[:1] == b'<':
        return 'metashape' if b'<chunk' in head else None
    for text, found in begins.items():
        if start.startswith(text):
            return found
    return next((found for text, found in _TELLS.items() if text in head), None)


def _with_pictures(entries, file, path, images):
    """Return photographs with their pictures, and warn once of those without."""
    folders = PictureFolders(path if path.is_dir() else file, images)
    photos = []
    lost: dict[str, list] = {why: [] for why in _SAYS}
    for entry in entries:
        picture = folders.find(entry.name)
        found = picture and size_of_picture(picture)
        size, why = entry.size or found, ''
        if found is None:
            why = 'missing' if picture is None else 'unreadable'
        elif size != found:
            why = 'scaled' if _alike(size, found) else 'unlike'
        if size is None:
            lost['unsized'].append(entry.name)
            continue
        camera = entry.make(size)
        if why == 'scaled':
            camera = camera.resized(found)
        if why:
            lost[why].append(entry.name)
        photos.append(
            Photo(entry.name, camera, picture if why in ('', 'scaled') else None, entry.crs)
        )
    _check(photos, lost, file)
    return Photos(photos)


def _alike(size, other):
    """Return whether two sizes have the same proportions but for rounding to pixels."""
    (a, b), (c, d) = size, other
    return abs(a * d - b * c) <= max(a, b, c, d)


def _check(photos, lost, file):
    """Warn once of what is wrong with pictures; raise an error if nothing is left."""
    text = '; '.join(
        f'{len(names)} {_SAYS[why]}, such as {names[0]!r:.80}'
        for why, names in lost.items()
        if names
    )
    total = len(photos) + len(lost['unsized'])
    if not photos:
        msg = f'{file}, line 1: there are no registered cameras'
        raise ValueError(f'{msg}; of {total} cameras, {text}.' if text else f'{msg}.')
    if text:
        warn(f'{file}: of {total} cameras, {text}.')
