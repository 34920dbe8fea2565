"""Damaged files of every format, in child processes: few here, as many as asked by the command."""

import ast
import json
import subprocess
import sys

import pytest

import pvibr
from tests.stress.readers import SOURCES

pytestmark = pytest.mark.skipif(sys.platform == 'win32', reason='children are forked')


def run(*options):
    command = [sys.executable, '-m', 'tests.stress.fuzz', *options]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=500)


def test_no_damaged_file_does_harm():
    """Those of cameras are in tests/photos/test_broken_cameras.py."""
    names = [name for name in SOURCES if not name.startswith(('cameras', 'real'))]
    chosen = [word for name in names for word in ('--only', name)]
    done = run('--cases', '2', '--seed', '0', *chosen)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    assert f'{2 * len(names)} cases' in done.stdout


@pytest.mark.stress
def test_no_file_of_thousands_does_harm():
    done = run('--cases', '200')
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]


def test_every_reader_is_here():
    readers = {name for name in pvibr.__all__ if name.startswith('read_')}
    covered = {'read_cameras', 'read_city', 'read_gltf', 'read_poses', 'read_views'}
    assert readers == covered


#: What a reader may do wrong, and how that is told.
WRONGS = {
    'raise SystemError': 'wrong: SystemError',
    'raise ValueError("it is cut")': 'nameless: ValueError: it is cut',
    'os.kill(os.getpid(), 11)': 'ended by SIGSEGV',
    'bytearray(2**31)': 'wrong: MemoryError',
    'open("/tmp")': 'wrong: AssertionError: /tmp is opened, outside of its folder',
    'open("/etc/passwd")': 'wrong: AssertionError: a name in the file led to /etc/passwd',
}
PROGRAM = """
import json, os, sys
from tests.stress import fuzz
from tests.stress.readers import Source, SOURCES
def write(folder):
    (folder / 'a').write_bytes(b'abc')
    return [folder / 'a']
def reading(wrong):
    begun = []
    def read(folder):
        if begun:
            exec(wrong)
        begun.append(1)
    return read
for wrong in json.loads(sys.argv[1]):
    SOURCES[wrong] = Source(write, reading(wrong))
    print(fuzz.in_child(wrong, 0, range(1))[0])
"""


def test_each_wrong_is_found():
    command = [sys.executable, '-c', PROGRAM, json.dumps([*WRONGS])]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=100)
    found = done.stdout.splitlines()
    assert all(map(str.startswith, found, WRONGS.values())), found
    assert len(found) == len(WRONGS)


def test_a_case_is_the_same_again():
    program = """
from tests.stress.fuzz import fuzz
print([[*fuzz('s', ['poses.csv'], start, count=n)] for start, n in ((3, 3), (5, 1))])
"""
    command = [sys.executable, '-c', program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=100)
    first, again = ast.literal_eval(done.stdout)
    assert first[2:] == again
