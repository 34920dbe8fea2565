"""Reading cameras and pictures of photogrammetry programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.arguments import check_one_of, naming
from pvibr.core.errors import warn
from pvibr.maths.orthographic import Orthographic
from pvibr.photos import camera_programs, colmap, metashape, orthophotos, photo_projects
from pvibr.photos.photo_images import PictureFolders, size_of_picture
from pvibr.photos.photos import Photo, Photos

_HEADER_SIZE = 65536  # bytes searched for a format's marks
_READERS = {
    'colmap': colmap.read,
    'opensfm': camera_programs.read_opensfm,
    'openmvg': camera_programs.read_openmvg,
    'openmvs': camera_programs.read_openmvs,
    'bundler': camera_programs.read_bundler,
    'nvm': camera_programs.read_nvm,
    'metashape': metashape.read,
    'opf': photo_projects.read_opf,
    'transforms': photo_projects.read_transforms,
    'orthophoto': orthophotos.read,
}
_COLMAP_TABLES = ('cameras', 'images', 'rigs', 'frames')
#: Marks of JSON formats near the beginning of a file.
_JSON_MARKS = {
    b'application/opf-': 'opf',
    b'"sfm_data_version"': 'openmvg',
    b'"transform_matrix"': 'transforms',
    b'"camera_angle_x"': 'transforms',
    b'"projection_type"': 'opensfm',
    b'"shots"': 'opensfm',
}
#: Camera files in project folders: patterns by format, of which the first match is read.
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
#: Problems with cameras and their pictures.
_PROBLEMS = {
    'missing': 'have no picture in the project (images= selects another folder)',
    'unreadable': 'have unreadable pictures',
    'unlike': 'have pictures of another aspect ratio, which are ignored',
    'scaled': 'have pictures of another size and are scaled to it',
    'outside': 'have their principal point outside the picture, as only parts of pictures do',
    'unsized': 'are skipped, as neither the file nor a picture gives their size',
}
_COLMAP_FOLDERS = ('', 'sparse', 'dense/sparse', 'dense/0/sparse', 'colmap/sparse', 'colmap', '0')


def read_cameras(path, images=None, *, format=None):
    """Read cameras and pictures from a photogrammetry project.

    Parameters
    ----------
    path : str or pathlib.Path
        A file or project folder of COLMAP (binary or text, with or without rigs), OpenSfM,
        OpenMVG, OpenMVS (interface archives), Bundler, VisualSFM (NVM), Agisoft Metashape (XML),
        Pix4D (OPF), nerfstudio, instant-ngp or Blender (``transforms.json``); or a GeoTIFF, a
        picture with a world file, or a folder of these.
    images : str or pathlib.Path, optional
        Folder of the pictures. By default they are looked up in the project only: beside the file,
        in the folder above ``sparse/0`` and the like, and in folders there named ``images``,
        ``photos``, ``input`` or ``rgb``.
    format : str, optional
        ``'colmap'``, ``'opensfm'``, ``'openmvg'``, ``'openmvs'``, ``'bundler'``, ``'nvm'``,
        ``'metashape'``, ``'opf'``, ``'transforms'`` or ``'orthophoto'``; by default detected.

    Returns
    -------
    Photos
        A :class:`Photo` for each registered picture, in the file's order and world.

    Raises
    ------
    FileNotFoundError
        If a file or folder does not exist.
    ValueError
        If the format is not recognised or the file is broken, with the line or byte.

    Warns
    -----
    PvibrWarning
        If pictures are missing, unreadable or of another aspect ratio (`path` is None), or of
        another size (the camera is scaled); if a principal point is outside its picture.

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
        raise FileNotFoundError(f'path must be a file or folder, got {str(path)!r}')
    if images is not None:
        with naming('images', images):
            images = Path(images).expanduser()
        if not images.is_dir():
            raise FileNotFoundError(f'images must be a folder, got {str(images)!r}')
    if format is not None:
        check_one_of('format', format, _READERS)
    format_name, file = _located(path, format)
    with np.errstate(all='ignore'):
        return _with_pictures(_READERS[format_name](file), file, path, images)


def read_frustums(path, **options):
    """Return cameras as lines, for ``pyvista.read``."""
    return read_cameras(path, **options).frustums()


def _located(path, format_name):
    """Return the format and the file, or folder, to read."""
    if path.is_file():
        return format_name or format_of(path), path
    for name in [format_name] if format_name else _IN_FOLDERS:
        file = _in_folder(path, name)
        if file is not None:
            return name, file
    if format_name in (None, 'orthophoto') and any(map(orthophotos.is_referenced, _listed(path))):
        return 'orthophoto', path
    raise ValueError(
        f'{path}: the folder must have orthophotos or one of '
        f'{", ".join(p for patterns in _IN_FOLDERS.values() for p in patterns)}'
    )


def _in_folder(path, format_name):
    """Return the file of a format in a project folder, or None."""
    if format_name == 'colmap':
        return _colmap_folder(path)
    for pattern in _IN_FOLDERS.get(format_name, ()):
        for file in sorted(path.glob(pattern)):
            if file.is_file() and format_of(file, strict=False) == format_name:
                return file
    return None


def _colmap_folder(path):
    for subfolder in _COLMAP_FOLDERS:
        models = [path / subfolder, *sorted((path / subfolder).glob('[0-9]*'))]
        models = [m for m in models if any((m / n).is_file() for n in _IN_FOLDERS['colmap'])]
        if models:
            if len(models) > 1:
                warn(
                    f'{path / subfolder} has {len(models)} models with separate worlds: only '
                    f'{models[0].name} is read'
                )
            return models[0]
    return None


def _listed(path):
    return sorted(p for p in path.iterdir() if p.suffix.lower() in orthophotos.PICTURES)


def format_of(path, *, strict=True):
    """Return the format of a file by its content."""
    with path.open('rb') as file:
        header = file.read(_HEADER_SIZE)
    format_name = _by_name(path.suffix.lower(), path.name.lower()) or _by_content(header)
    if format_name is None and strict:
        raise ValueError(f'{path}, byte 0: not a recognised camera file')
    return format_name


def _by_name(suffix, name):
    if suffix in orthophotos.WORLD_SUFFIXES or suffix in orthophotos.PICTURES:
        return 'orthophoto'
    formats_by_suffix = {'.mvs': 'openmvs', '.nvm': 'nvm', '.out': 'bundler', '.opf': 'opf'}
    formats_by_name = {'transforms.json': 'transforms', 'reconstruction.json': 'opensfm'}
    formats_by_name |= {f'{n}{e}': 'colmap' for n in _COLMAP_TABLES for e in ('.bin', '.txt')}
    return formats_by_suffix.get(suffix) or formats_by_name.get(name)


def _by_content(header):
    start = header.lstrip(b'\xef\xbb\xbf \r\n')
    magic_numbers = {b'MVSI': 'openmvs', b'NVM_V': 'nvm', b'# Bundle file': 'bundler'}
    if start[:1] == b'<':
        return 'metashape' if b'<chunk' in header or b'<collection' in header else None
    for text, format_name in magic_numbers.items():
        if start.startswith(text):
            return format_name
    return next((format_name for text, format_name in _JSON_MARKS.items() if text in header), None)


def _with_pictures(entries, file, path, images):
    """Return photographs with their pictures; warn once of problems."""
    folders = PictureFolders(path if path.is_dir() else file, images)
    photos = []
    names_by_problem: dict[str, list] = {problem: [] for problem in _PROBLEMS}
    for entry in entries:
        picture = folders.find(entry.name)
        picture_size = picture and size_of_picture(picture)
        size, problem = entry.size or picture_size, ''
        if picture_size is None:
            problem = 'missing' if picture is None else 'unreadable'
        elif size != picture_size:
            problem = 'scaled' if _same_proportions(size, picture_size) else 'unlike'
        if size is None:
            names_by_problem['unsized'].append(entry.name)
            continue
        camera = entry.make(size)
        if problem == 'scaled':
            camera = camera.resized(picture_size)
        if problem:
            names_by_problem[problem].append(entry.name)
        if not _is_centred(camera):
            names_by_problem['outside'].append(entry.name)
        path = picture if problem in ('', 'scaled') else None
        photos.append(Photo(entry.name, camera, path, entry.crs))
    _check(photos, names_by_problem, file)
    return Photos(photos)


def _is_centred(camera):
    """Return whether the principal point of a camera, if it has one, is within its picture."""
    if isinstance(camera, Orthographic):
        return True
    relative_point = (camera.K[:2, 2] + 0.5) / camera.size
    return bool((relative_point >= 0).all() and (relative_point <= 1).all())


def _same_proportions(size, other_size):
    """Return whether two sizes have the same aspect ratio, up to rounding to pixels."""
    (a, b), (c, d) = size, other_size
    return abs(a * d - b * c) <= max(a, b, c, d)


def _check(photos, names_by_problem, file):
    """Warn once of problems with pictures; raise an error if no photograph remains."""
    text = '; '.join(
        f'{len(names)} {_PROBLEMS[problem]}, such as {names[0]!r:.80}'
        for problem, names in names_by_problem.items()
        if names
    )
    total = len(photos) + len(names_by_problem['unsized'])
    if not photos:
        details = f'; of {total} cameras, {text}' if text else ''
        raise ValueError(f'{file}, line 1: registered cameras are missing{details}')
    if text:
        warn(f'{file}: of {total} cameras, {text}')
