"""Plotters, things and windows again and again: memory and what the driver holds stay flat.

A thing that is removed says that it holds no bytes, in tests/test_every_thing.py; here the process
itself is measured, trimmed, in a child of its own.
"""

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != 'linux', reason='reads /proc')

PROGRAM = """
import ctypes, ctypes.util, gc, json, sys, warnings
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

KINDS = 'Texture', 'Buffer', 'Framebuffer', 'Renderbuffer', 'Program', 'Shader', 'VertexArray'
library = ctypes.CDLL(ctypes.util.find_library('OpenGL') or ctypes.util.find_library('GL'))

def objects():
    # Names are given out from 1 on, the lowest free one first.
    other.render()
    other.render_window.MakeCurrent()
    asks = [getattr(library, 'glIs' + kind) for kind in KINDS]
    counts = [sum(bool(ask(name) & 255) for name in range(1, 20_000)) for ask in asks]
    return dict(zip(KINDS, counts))

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
    counts, before = objects(), resident()
    for _ in range(cycles):
        work()
    after = resident()
print(json.dumps([before, after, counts, objects()]))
"""


def grown(what, cycles):
    """Return the MiB and OpenGL's objects of a process, before and after a number of cycles."""
    command = [sys.executable, '-c', PROGRAM, what, str(cycles)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=560)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


#: Cycles of each in the quick tests, and in the long ones.
CYCLES = {'plotters': (4, 150), 'things': (1, 30), 'resizes': (1, 30), 'windows': (30, 3000)}
#: In a short run the driver's own caches still come and go: by 32 MiB, measured.
SHORT_MIB, SHARE = 64, 0.02


def assert_flat(objects, now):
    """Programs stay in VTK's cache with their window; of the rest there is none more."""
    more = {kind: now[kind] - count for kind, count in objects.items() if now[kind] > count}
    assert not more, (objects, now)


@pytest.mark.slow
@pytest.mark.parametrize('what', CYCLES)
def test_memory_stays(what):
    before, after, objects, now = grown(what, CYCLES[what][0])
    assert after - before < SHORT_MIB
    assert objects['Texture'] > 0
    assert_flat(objects, now)


@pytest.mark.stress
@pytest.mark.parametrize('what', CYCLES)
def test_memory_is_flat(what):
    before, after, objects, now = grown(what, CYCLES[what][1])
    assert after - before < SHARE * before
    assert_flat(objects, now)
