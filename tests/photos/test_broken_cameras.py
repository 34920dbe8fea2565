"""Broken, truncated and hostile files: an error that names file and place, or what is left."""

import os
import random
import re
import shutil
import tracemalloc
import warnings

import pytest
from PIL import Image

import pvibr
from tests.camera_files import FORMATS, write_pictures
from tests.refusals import refused

pytestmark = pytest.mark.sampled

#: Cases of each format here; set PVIBR_SOAK for more (2 000 in all take two minutes), of which
#: PVIBR_SEED, any text, chooses others.
CASES, SEED = int(os.environ.get('PVIBR_SOAK', '12')), os.environ.get('PVIBR_SEED', '')
KINDS = [
    *('colmap-OPENCV', 'colmap-EUCM', 'opensfm', 'openmvg', 'openmvs-7', 'openmvs-0', 'bundler'),
    *('nvm', 'metashape', 'photoscan-0.9.0', 'opf', 'transforms', 'blender', 'binary', 'rigs'),
    *('geotiff', 'world'),
]
PLACE = re.compile(r'(line \d+|byte \d+|its GeoTIFF tags)')


def project(kind, folder):
    """A project in a folder; the files that are broken."""
    if kind in FORMATS:
        FORMATS[kind](folder, 3)
    elif kind in ('binary', 'rigs'):
        source = folder / 'text'
        source.mkdir()
        FORMATS['colmap-OPENCV'](source, 3)
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            photos = pvibr.read_cameras(source)
        style = 'colmap_binary' if kind == 'binary' else 'colmap'
        pvibr.write_cameras(folder / 'sparse' / '0', photos, format=style)
        shutil.rmtree(source)
        if kind == 'rigs':
            rows = ['1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 0.1 0 0']
            (folder / 'sparse' / '0' / 'rigs.txt').write_text('\n'.join(rows))
            rows = [f'{k} 1 1 0 0 0 0 0 4 1 CAMERA 1 {k}' for k in (1, 2, 3)]
            (folder / 'sparse' / '0' / 'frames.txt').write_text('\n'.join(rows))
    elif kind == 'geotiff':
        from PIL.TiffImagePlugin import ImageFileDirectory_v2

        tags = ImageFileDirectory_v2()
        tags[33550], tags[33922] = (0.5, 0.5, 0.0), (0.0, 0.0, 0.0, 5e5, 5e6, 0.0)
        tags[34735] = (1, 1, 0, 1, 3072, 0, 1, 32632)
        tags.tagtype.update({33550: 12, 33922: 12, 34735: 3})
        Image.new('L', (40, 30)).save(folder / 'a.tif', tiffinfo=tags)
    else:
        Image.new('L', (40, 30)).save(folder / 'a.png')
        (folder / 'a.pgw').write_text('0.5\n0\n0\n-0.5\n500000\n5000000\n')
    return sorted(p for p in folder.rglob('*') if p.is_file() and p.suffix != '.png')


def broken(data, rng):
    """One of many ways to break bytes."""
    data = bytearray(data)
    at = rng.randrange(len(data) + 1)
    way = rng.randrange(7)
    if way == 0:
        return data[:at]
    if way == 1:
        data[at:at] = rng.randbytes(rng.randrange(1, 9))
    elif way == 2:
        del data[at : at + rng.randrange(1, 20)]
    elif way == 3:
        for _ in range(rng.randrange(1, 6)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif way == 4:
        data[at : at + 8] = b'\xff' * 8
    elif way == 5:
        numbers = [m.span() for m in re.finditer(rb'[-\d.]+', data)] or [(0, 0)]
        start, end = rng.choice(numbers)
        words = [b'nan', b'1e999', b'-1', b'0', b'9' * 30, b'', b'1e300', b'"x"', b'null', b'[]']
        data[start:end] = rng.choice(words)
    else:
        names = [m.span() for m in re.finditer(rb'[\w.]+\.(jpg|png)', data)] or [(0, 0)]
        start, end = rng.choice(names)
        words = [
            b'../../../etc/passwd',
            b'/etc/passwd',
            b'..',
            b'C:\\x\\y.jpg',
            b'a' * 5000,
            b'\\',
        ]
        data[start:end] = rng.choice(words)
    return bytes(data)


@pytest.mark.parametrize('kind', KINDS)
def test_no_broken_file_does_harm(kind, tmp_path):
    rng = random.Random(kind + SEED)
    files = project(kind, tmp_path)
    if kind not in ('geotiff', 'world'):
        write_pictures(tmp_path, ['0.jpg', 'a 0.jpg', './train/r_0'])
    tracemalloc.start()
    for case in range(CASES):
        file = rng.choice(files)
        whole = file.read_bytes()
        file.write_bytes(broken(whole, rng))
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter('always')
                photos = pvibr.read_cameras(tmp_path)
            assert len({str(w.message) for w in said}) == len(said) <= 2  # lenses, pictures
            assert all(w.category is pvibr.PvibrWarning for w in said)
            for photo in photos:
                inside = photo.path is None or photo.path.resolve().is_relative_to(tmp_path)
                assert inside, photo
        except ValueError as error:
            text = str(error)
            assert str(tmp_path) in text, (case, text)
            assert PLACE.search(text) or 'the folder must have' in text, text
            assert len(text) < 1500
        file.write_bytes(whole)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6


@pytest.mark.parametrize('kind', sorted({*KINDS} - {'rigs'}))  # there some may be empty
def test_empty_files_are_named(kind, tmp_path):
    for file in project(kind, tmp_path):
        whole = file.read_bytes()
        file.write_bytes(b'')
        refused(re.escape(str(tmp_path)), pvibr.read_cameras, file)
        file.write_bytes(whole)


def test_pictures_outside_the_project_are_not_read(tmp_path):
    """A name with .. is followed only as far as it stays inside; so are links."""
    secret = tmp_path / 'secret.png'
    Image.new('L', (640, 480)).save(secret)
    home = tmp_path / 'project'
    home.mkdir()
    path, _ = FORMATS['transforms'](home, 3)
    (home / 'link.png').symlink_to(secret)
    inner = home / 'images' / 'inner.png'
    inner.parent.mkdir()
    Image.new('L', (640, 480)).save(inner)
    names = ['../secret.png', str(secret), 'link.png', 'x/../images/inner.png']
    text = path.read_text()
    for k, name in enumerate(names):
        text = text.replace(f'images/{k}.png', name)
    path.write_text(text)
    with pytest.warns(pvibr.PvibrWarning, match='3 have no picture'):
        photos = pvibr.read_cameras(path)
    assert [photo.path for photo in photos] == [None, None, None, inner]
    assert pvibr.read_cameras(home, tmp_path)[1].path == secret  # named by the user


def test_pictures_of_another_size(tmp_path):
    path, made = FORMATS['transforms'](tmp_path, 3)
    write_pictures(tmp_path, made, {'images/1.png': (320, 240), 'images/2.png': (300, 240)})
    (tmp_path / 'images' / '3.png').write_bytes(b'no picture')
    with pytest.warns(pvibr.PvibrWarning) as said:
        photos = pvibr.read_cameras(path)
    (warning,) = said
    for text in (
        '1 have pictures of another size',
        '1 have pictures of another aspect',
        'have unreadable pictures',
    ):
        assert text in str(warning.message)
    assert [photo.size for photo in photos] == [(640, 480), (320, 240), (640, 480), (640, 480)]
    assert [photo.path is None for photo in photos] == [False, False, True, True]
    whole, half = photos[0].K, photos[1].K
    assert abs(half[0, 2] + 0.5 - (whole[0, 2] + 0.5) / 2) < 1e-12
    refused(r'2\.png.* has no picture', photos[2].read)


@pytest.mark.parametrize(
    ('name', 'change', 'wanted'),
    [
        ('transforms', ('"fl_x": 600', '"fl_x": "wide"'), r'transforms\.json, line 5 \(fl_x\): '),
        ('blender', ('"camera_angle_x"', '"angle"'), r'\(frames\[0\]\): fl_x or camera_angle_x'),
        (
            'opensfm',
            ('"focal": 0.9', '"focal": 1e999'),
            r'line \d+ \(\[0\]\.cameras\.persp\.focal',
        ),
        (
            'opensfm',
            ('"rotation": [', '"rotation": [ 1e300, 0, 0], "x": ['),
            r'line \d+ \(\[0\]\.shots.*',
        ),
        (
            'metashape',
            ('<f>600</f>', '<f>-600</f>'),
            r'cameras\.xml, line 4: K must have',
        ),
        ('metashape', ('<document', '<!DOCTYPE a [<!ENTITY b "c">]><document'), 'document type'),
        ('bundler', ('5 0', '5000000000 0'), 'bundle.out, line 2'),
        ('nvm', ('\n4\n', '\n900000\n'), r'scene\.nvm, line 9: values must be 10 finite numbers'),
        ('colmap-OPENCV', ('OPENCV', 'OPENCW'), "cameras.txt, line 2: camera model 'OPENCW'"),
    ],
)
def test_errors_name_file_and_line(name, change, wanted, tmp_path):
    path, made = FORMATS[name](tmp_path, 3)
    write_pictures(tmp_path, made)
    files = [path] if path.is_file() else list(path.rglob('*.txt'))
    for file in files:
        file.write_text(file.read_text().replace(*change, 1))
    refused(wanted, pvibr.read_cameras, path)


def test_arguments_are_checked(tmp_path):
    refused('path must be', pvibr.read_cameras, tmp_path / 'no', kind=FileNotFoundError)
    refused('the folder must have', pvibr.read_cameras, tmp_path)
    (tmp_path / 'a.json').write_text('{}')
    refused('not a recognised camera file', pvibr.read_cameras, tmp_path / 'a.json')
    refused('format must be', pvibr.read_cameras, tmp_path, format='x')
    with pytest.raises(FileNotFoundError, match='images must be'):
        pvibr.read_cameras(tmp_path, tmp_path / 'no')


def test_pictures_that_are_not_what_they_seem(tmp_path):
    """Of a GIF the first picture is read; errors about pixels name the file."""
    path, made = FORMATS['transforms'](tmp_path, 3)
    write_pictures(tmp_path, made)
    first, second = (tmp_path / 'images' / f'{k}.png' for k in (0, 1))
    red, blue = (Image.new('RGB', (640, 480), color) for color in ('red', 'blue'))
    red.save(first, 'GIF', save_all=True, append_images=[blue])
    Image.new('I', (640, 480)).save(second, 'TIFF')
    photos = pvibr.read_cameras(path)
    assert (photos[0].read() == [255, 0, 0, 255]).all()
    refused(rf'{re.escape(str(second))}.*int32', photos[1].read)
