"""Files are whole or as they were, also where the disk is full."""

import subprocess
import sys

import pytest
import pyvista as pv

import pvibr
from pvibr.core.files import existing, in_a_folder, replacing, with_suffix
from tests.refusals import refused


def test_what_fails_leaves_what_was_there(tmp_path):
    file = tmp_path / 'a.txt'
    with replacing(file) as part:
        part.write_text('first')
    with pytest.raises(RuntimeError), replacing(file) as part:
        _fail(part)
    assert file.read_text() == 'first'
    assert [p.name for p in file.parent.iterdir()] == ['a.txt']
    with pytest.raises(FileNotFoundError, match='there is no folder'), replacing(file / 'b'):
        pass


def _fail(file):
    file.write_text('second')
    raise RuntimeError


FULL = """
import resource, signal, sys
from pvibr.core.files import replacing
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    with replacing(sys.argv[1]) as part:
        part.write_bytes(bytes(5000))
except OSError as error:
    print(error.errno, error)
"""


@pytest.mark.skipif(sys.platform == 'win32', reason='limits of files are those of POSIX')
def test_a_full_disk_is_named(tmp_path):
    file = tmp_path / 'a.bin'
    file.write_bytes(b'before')
    done = subprocess.run(
        [sys.executable, '-c', FULL, str(file)], capture_output=True, text=True, check=True
    )
    assert f'cannot write {file}' in done.stdout
    assert 'the existing file is unchanged' in done.stdout
    assert file.read_bytes() == b'before'
    assert [p.name for p in tmp_path.iterdir()] == ['a.bin']


@pytest.mark.parametrize(
    'read', [existing, lambda p: with_suffix(p, '.glb'), lambda p: in_a_folder('path', p)]
)
def test_what_is_no_path_is_named(read):
    for wrong in (None, 2, ['a'], b'a'):
        refused('path = ', read, wrong, kind=TypeError)
    refused('path', read, '', kind=(ValueError, FileNotFoundError))


LFS_POINTER = 'version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n'
PAGE = '\n<!DOCTYPE html>\n<html><head><title>Fox.glb</title></head></html>'


@pytest.mark.parametrize(
    ('content', 'words'),
    [(LFS_POINTER, 'git lfs pull'), (PAGE, 'download the file itself')],
    ids=['pointer', 'page'],
)
def test_what_was_saved_in_place_of_a_mesh_is_named(tmp_path, content, words):
    pl = pv.Plotter(off_screen=True)
    for name in ('a.ply', 'a.glb', 'a.stl', 'a.vtp'):
        path = tmp_path / name
        path.write_text(content)
        with pytest.raises(ValueError, match=words):
            pl.ibr.add_animated(path)
        with pytest.raises(ValueError, match=words):
            pl.ibr.add_instances(path, [[0, 0, 0]])
    with pytest.raises(ValueError, match=words):
        pvibr.read_gltf(tmp_path / 'a.glb')
    pl.close()
