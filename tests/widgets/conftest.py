"""Presets of the tests' own, and plotters with things in them."""

from __future__ import annotations

import pytest
import pyvista as pv

import pvibr


@pytest.fixture(autouse=True)
def _own_presets(monkeypatch, tmp_path):
    monkeypatch.setenv('PVIBR_CONFIG', str(tmp_path / 'config'))


@pytest.fixture
def pl():
    """A ball with a bloom, drawn."""
    pl = pv.Plotter(window_size=(96, 64))
    pl.add_mesh(pv.Sphere(), color='white')
    pl.ibr.add(pvibr.Bloom(threshold=0.5))
    pl.show(auto_close=False)
    return pl
