"""Kinds of drivers."""

import pytest
import pyvista as pv

import pvibr
from pvibr.gl import driver
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
