"""Plotters, things and windows again and again: memory and what the driver holds stay flat.

A thing that is removed says that it holds no bytes, in tests/test_every_thing.py; here the process
itself is measured, trimmed, in a child of its own.
"""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != 'linux', reason='reads /proc')

PROGRAM = """
import ctypes, gc, sys, warnings
import pyvista as pv
from tests.browser import everything
from tests.browser.everything import EVERYTHING

pv.OFF_SCREEN, cycles = True, int(sys.argv[2])
warnings.simplefilter('ignore')
libc = ctypes.CDLL(None)

def resident():
    gc.collect()
    libc.malloc_trim(0)
    pages = int(open('/proc/self/statm').read().split()[1])
    return pages * 4096 / 2**20

def held(pl):
    return sum(row.bytes for row in pl.ibr.report().rows)

def plotters():
    pl = everything.plotter(size=(160, 120))
    everything.show_only(pl, 'Spheres')
    pl.show(auto_close=False)
    pl.close()

other = everything.plotter(size=(160, 120))
other.show(auto_close=False)

def things():
    for name in EVERYTHING:
        everything.show_only(other, name)
        other.render()
    everything.show_only(other, '')
    other.render()
    assert held(other) == 0

def resizes():
    for name in ('Bloom', 'Shadows', 'Instances', 'Impostor'):
        EVERYTHING[name](other)
    for k in range(10):
        other.window_size = 100 + 7 * k, 90 + 5 * k
        other.render()
    everything.show_only(other, '')

def windows():
    for pl in (other, second):
        pl.camera.azimuth += 3
        pl.render()

second = everything.plotter(size=(160, 120))
for name in ('Shadows', 'Spheres', 'Outline'):
    EVERYTHING[name](second)
second.show(auto_close=False)
work = locals()[sys.argv[1]]
with everything.lighter():
    for _ in range(max(cycles // 3, 2)):
        work()
    before = resident()
    for _ in range(cycles):
        work()
print(before, resident())
"""


def grown(what, cycles):
    """Return how many MiB a process grows by in a number of cycles, and how many it has."""
    command = [sys.executable, '-c', PROGRAM, what, str(cycles)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=560)
    assert done.returncode == 0, done.stderr[-2000:]
    before, after = map(float, done.stdout.split()[-2:])
    return after - before, before


#: Cycles of each in the quick tests, and in the long ones.
CYCLES = {'plotters': (4, 150), 'things': (1, 30), 'resizes': (1, 30), 'windows': (30, 3000)}
#: In a short run the driver's own caches still come and go: by 32 MiB, measured.
SHORT_MIB, SHARE = 64, 0.02


@pytest.mark.slow
@pytest.mark.parametrize('what', CYCLES)
def test_memory_stays(what):
    growth, _ = grown(what, CYCLES[what][0])
    assert growth < SHORT_MIB


@pytest.mark.stress
@pytest.mark.parametrize('what', CYCLES)
def test_memory_is_flat(what):
    growth, before = grown(what, CYCLES[what][1])
    assert growth < SHARE * before
