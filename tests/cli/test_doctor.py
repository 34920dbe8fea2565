import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pvibr.cli import doctor
from pvibr.cli.doctor import Diagnosis, diagnose, has_gl_libraries, require_gl
from pvibr.core.errors import PvibrError
from pvibr.instances.cache import AtlasCache
from tests.refusals import refused

SCRIPT = [sys.executable, '-I', doctor.__file__]


@pytest.fixture
def bare(monkeypatch):
    """A machine without any OpenGL library, where drawing crashes."""
    monkeypatch.setattr(sys, 'platform', 'linux')
    monkeypatch.setattr(doctor, '_loads', lambda library: False)
    monkeypatch.setattr(doctor, '_draw_elsewhere', lambda: ({}, 'VTK crashed (SIGSEGV)'))


def only(*libraries):
    return lambda library: any(name in library for name in libraries)


def test_this_machine_draws():
    found = diagnose()
    assert found.facts['off-screen'] == 'works'
    assert 'px wide textures' in found.facts['limits']
    assert {'pvibr', 'PyVista', 'VTK', 'OpenGL', 'renderer', 'drawn by', 'cache'} <= set(
        found.facts
    )
    assert not [what for what, _ in found.problems if 'OpenGL' in what]


def test_a_bare_machine_is_told_the_command(bare):
    found = diagnose()
    assert 'SIGSEGV' in found.facts['off-screen']
    assert dict(found.problems)['OpenGL libraries'] == doctor.gl_remedy()
    assert 'Nothing is missing' not in str(found)


def test_a_broken_driver_is_told_apart_from_missing_libraries(monkeypatch):
    monkeypatch.setattr(doctor, '_loads', lambda library: True)
    monkeypatch.setattr(doctor, '_draw_elsewhere', lambda: ({}, 'VTK crashed (SIGSEGV)'))
    assert 'a working OpenGL driver' in str(diagnose())


def test_require_gl_names_the_command(bare):
    refused('Run: ', require_gl, kind=PvibrError)


def test_a_vtk_with_its_own_opengl_is_accepted(bare, monkeypatch):
    monkeypatch.setattr(doctor, '_draw_elsewhere', lambda: ({}, ''))
    require_gl()


@pytest.mark.parametrize(
    ('libraries', 'display', 'usable'),
    [
        ((), '', False),
        (('EGL',), '', False),
        (('X11', 'EGL'), '', False),
        (('X11', 'libGL.'), '', False),
        (('X11', 'libGL.'), ':0', True),
        (('EGL', 'libGL.'), '', False),
        (('X11', 'EGL', 'libGL.'), '', True),
        (('X11', 'EGL', 'OpenGL'), '', True),
        (('OSMesa',), '', False),
        (('X11', 'OSMesa'), '', True),
    ],
)
def test_which_libraries_are_enough(monkeypatch, libraries, display, usable):
    # Tried with vtk 9.7.2 on Debian 12: the rows without a display, where apt-get can make them.
    monkeypatch.setattr(sys, 'platform', 'linux')
    monkeypatch.setattr(doctor, '_loads', only(*libraries))
    monkeypatch.setenv('DISPLAY', display)
    assert has_gl_libraries() is usable


@pytest.mark.parametrize(
    ('libraries', 'display', 'chosen', 'window'),
    [
        (('EGL', 'libGL.'), '', None, 'vtkEGLRenderWindow'),
        (('EGL', 'libGL.'), ':0', None, None),
        (('EGL',), '', None, None),
        (('EGL', 'libGL.'), '', 'vtkOSOpenGLRenderWindow', 'vtkOSOpenGLRenderWindow'),
    ],
)
def test_egl_is_preferred_without_a_display(monkeypatch, libraries, display, chosen, window):
    monkeypatch.setattr(sys, 'platform', 'linux')
    monkeypatch.setattr(doctor, '_loads', only(*libraries))
    environment = {'DISPLAY': display}
    if chosen:
        environment['VTK_DEFAULT_OPENGL_WINDOW'] = chosen
    monkeypatch.setattr(doctor.os, 'environ', environment)
    doctor.prefer_egl()
    assert environment.get('VTK_DEFAULT_OPENGL_WINDOW') == window


def test_a_crash_and_a_failure_elsewhere_are_told(monkeypatch):
    for body, told in {
        'import os, signal; os.kill(os.getpid(), signal.SIGSEGV)': 'SIGSEGV',
        'raise RuntimeError("no luck")': 'no luck',
    }.items():
        run = subprocess.run

        def instead(command, run=run, body=body, **kwargs):
            return run([sys.executable, '-c', body], **kwargs)

        monkeypatch.setattr(doctor.subprocess, 'run', instead)
        assert told in doctor._draw_elsewhere()[1]
        monkeypatch.undo()


def test_the_bootstrap_can_run_it_before_anything_is_installed():
    assert subprocess.run(SCRIPT, check=False).returncode == int(not has_gl_libraries())
    imported = """
import sys
before = set(sys.modules)
import runpy
runpy.run_path(sys.argv[1])
third = {name.partition(".")[0] for name in set(sys.modules) - before} - sys.stdlib_module_names
assert not third, third
"""
    subprocess.run([sys.executable, '-I', '-c', imported, doctor.__file__], check=True)


def test_a_cache_that_cannot_be_written_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path / 'a' / 'b'))
    monkeypatch.setattr(doctor.os, 'access', lambda folder, mode: Path(folder) != tmp_path)
    found = Diagnosis()
    doctor._cache(found)
    assert 'PVIBR_CACHE' in str(found)


def test_folder_size_and_bound_of_the_cache_are_told(monkeypatch, tmp_path):
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path))
    found = Diagnosis()
    AtlasCache().put('a' * 40, {'a': np.zeros(3 * 2**20, np.uint8)}, {})
    doctor._cache(found)
    cap = AtlasCache().cap_bytes / 2**20
    assert found.facts['cache'] == f'{tmp_path} (3.0 of {cap:.0f} MiB)'


def test_missing_packages_are_told(monkeypatch):
    lines = ['no-such-package>=2.1', 'numpy>=1.24', 'pytest; extra == "test"']
    monkeypatch.setattr(doctor.importlib.metadata, 'requires', lambda name: lines)
    found = Diagnosis()
    doctor._packages(found)
    assert found.problems == [('Python packages', 'python -m pip install "no-such-package>=2.1"')]
