"""Bakes are shown and can be interrupted."""

import os
import signal
import sys

import pytest
import pyvista as pv

from pvibr.core.progress import baking
from pvibr.instances import levels


def test_an_interrupted_bake_leaves_nothing(scenes, bean, monkeypatch, tmp_path):
    steps = []

    def press(model, progress, reference):
        os.kill(os.getpid(), signal.SIGINT)
        steps.append('still running')  # VTK may be calling Python right now
        progress(0.0)
        steps.append('never')

    monkeypatch.setattr(levels, 'measure', press)
    before = signal.getsignal(signal.SIGINT)
    pl = scenes.empty()
    pl.add_mesh(pv.Cube(), name='things')
    grid = {'cache': tmp_path, 'bake': True, 'name': 'things'}
    with pytest.raises(KeyboardInterrupt):
        pl.ibr.add_instances(bean, [[0, 0, 0]], **grid)
    assert steps == ['still running']
    assert signal.getsignal(signal.SIGINT) is before
    assert pl.ibr.effects == ()
    assert isinstance(pl.actors['things'].mapper.dataset, pv.PolyData)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('where', ['terminal', 'notebook', 'neither'])
def test_a_bar_is_shown_in_terminals_and_notebooks(where, monkeypatch, capsys):
    shown = []
    monkeypatch.setattr('pvibr.core.progress._DELAY', -1.0)
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: where == 'terminal', raising=False)
    monkeypatch.setattr('pvibr.core.progress.in_notebook', lambda: where == 'notebook')
    monkeypatch.setattr('rich.progress.Progress.start', lambda _: shown.append(True))
    with baking(None) as advance:
        advance(0.5)
    assert bool(shown) == (where != 'neither')
    shown.clear()
    with baking(False) as advance:
        advance(0.5)
    assert not shown
