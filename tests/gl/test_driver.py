"""Kinds of drivers."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl import driver
from pvibr.gl.frame_timer import FrameTimer
from tests.refusals import refused


@pytest.mark.parametrize(
    ('name', 'kind'),
    [
        ('llvmpipe (LLVM 19.1.7, 256 bits)', 'software'),
        ('Google SwiftShader', 'software'),
        ('Software Rasterizer', 'software'),
        ('Microsoft Basic Render Driver', 'software'),
        ('NVIDIA H200/PCIe/SSE2', 'hardware'),
        ('AMD Radeon RX 6600 (radeonsi, navi23, LLVM 17, DRM 3.54)', 'hardware'),
        ('Mesa Intel(R) UHD Graphics 620 (KBL GT2)', 'hardware'),
        ('Apple M2', 'hardware'),
        ('unknown', 'hardware'),
    ],
)
def test_kinds_by_name(name, kind, monkeypatch):
    monkeypatch.delenv(driver.VARIABLE, raising=False)
    monkeypatch.setattr(driver, '_names', [name])
    assert driver.driver_of().kind == kind
    with pvibr.deterministic():
        assert driver.driver_of().kind == 'software'


def test_the_variable_overrides(monkeypatch):
    for kind in ('software', 'hardware'):
        monkeypatch.setenv(driver.VARIABLE, kind)
        assert driver.driver_of().kind == kind
    monkeypatch.setenv(driver.VARIABLE, 'gpu')
    refused("PVIBR_DRIVER must be one of software, hardware, got 'gpu'", driver.driver_of)


def test_a_name_before_any_window(monkeypatch):
    """An atlas may be asked for before the plotter is shown."""
    monkeypatch.setattr(driver, '_names', [])
    name = driver.renderer_name(pv.Plotter(off_screen=True).render_window)
    assert name not in ('', 'unknown')


def test_a_gpu_takes_nominal_times_and_is_not_waited_for(monkeypatch):
    monkeypatch.setenv(driver.VARIABLE, 'hardware')
    with driver.timed(None, 0.25) as spent:
        pass
    assert spent.seconds == 0.25


class _Span:
    """A timer of the GPU that is ready when told so."""

    ready, ms = False, 40.0

    def __getattr__(self, _name):
        return lambda: True

    def Ready(self):
        return self.ready

    def GetElapsedMilliseconds(self):
        return self.ms


class _Window:
    waits = 0

    def WaitForCompletion(self):
        self.waits += 1

    def MakeCurrent(self):
        pass


@pytest.fixture
def clock(monkeypatch):
    times = iter(np.arange(0.0, 10.0, 0.01))
    monkeypatch.setattr('pvibr.gl.frame_timer.perf_counter', lambda: next(times))


@pytest.mark.usefixtures('clock')
def test_frames_in_software_are_waited_for(monkeypatch):
    monkeypatch.setenv(driver.VARIABLE, 'software')
    timer, window = FrameTimer(), _Window()
    assert timer.start(window) is None
    assert timer.end(window) == pytest.approx(10.0)
    assert timer.end(window) is None
    assert window.waits == 1


@pytest.mark.usefixtures('clock')
def test_frames_of_a_gpu_are_known_a_frame_later(monkeypatch):
    """By its own time if it has one, or by that of the processor."""
    monkeypatch.setenv(driver.VARIABLE, 'hardware')
    timer, window = FrameTimer(), _Window()
    timer._span = span = _Span()
    assert timer.start(window) is None
    assert timer.end(window) is None
    assert timer.start(window) == pytest.approx(10.0)  # the GPU has not ended
    span.ready = True
    assert timer.end(window) is None
    assert timer.start(window) == 40.0
    timer.cancel()
    assert timer.end(window) is None
    assert timer.start(window) is None
    assert window.waits == 0


def test_a_real_timer_of_the_gpu(monkeypatch):
    monkeypatch.setenv(driver.VARIABLE, 'hardware')
    pl = pv.Plotter(off_screen=True)
    pl.add_mesh(pv.Sphere())
    pl.show(auto_close=False)
    timer = FrameTimer()
    for _ in range(3):
        last_ms = timer.start(pl.render_window)
        pl.render()
        timer.end(pl.render_window)
    assert last_ms > 0
    timer.release()
