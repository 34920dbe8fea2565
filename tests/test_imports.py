"""Imports go down only, VTK has one door, and importing costs nothing."""

import ast
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import pvibr

ROOT = Path(pvibr.__file__).parent
# The floors of the house, highest first: an import goes down, or stays in its room.
FLOORS = (
    ('api', 'cli', 'cluster'),
    ('web',),
    (
        'capture',
        'export',
        'figures',
        'inspection',
        'large',
        'photos',
        'scenes',
        'substitutes',
    ),
    ('effects', 'instances', 'points', 'shadows', 'visibility'),
    ('meshes', 'things'),
    ('animation', 'textures'),
    ('gl', 'io', 'maths'),
    ('core',),
)
RANKS = {room: -floor for floor, rooms in enumerate(FLOORS) for room in rooms}
MODULES = sorted(p for p in ROOT.rglob('*.py') if p != ROOT / '__init__.py')


def room_of(name):
    """The room of ``pvibr.room.module``; a folder within a room is a room of its own."""
    parts = name.split('.')
    inner = '.'.join(parts[1:3])
    return (
        inner if inner in RANKS or (ROOT / parts[1] / '/'.join(parts[2:3])).is_dir() else parts[1]
    )


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f'{path}: write imports in full'
            inside = node.module.count('.') < 2 and node.module.split('.')[0] == 'pvibr'
            whole = [f'{node.module}.{a.name}' for a in node.names] if inside else [node.module]
            yield from whole


@pytest.mark.parametrize('path', MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_down_only(path):
    mine = room_of('.'.join(('pvibr', *path.relative_to(ROOT).with_suffix('').parts)))
    assert mine in RANKS, f'{path}: say in FLOORS where the room {mine!r} is'
    for name in imported(path):
        if name.split('.')[0] in ('vtk', 'vtkmodules', 'cvista'):
            assert path.stem == '_vtk', f'{name}: VTK is imported by pvibr.core._vtk only'
        elif name.startswith('pvibr.') and not is_root_name(name):
            theirs = room_of(name)
            assert theirs in RANKS, f'{path.name} imports {name} of an unknown room'
            if mine != theirs:
                assert RANKS[theirs] < RANKS[mine], f'{path.name} imports {name}'
            elif mine == 'effects':
                assert name.split('.')[2] in (
                    *('auto_exposure', 'light_spread', 'full_screen', 'reflections', 'ORDER'),
                ), name


def is_root_name(name):
    """Whether it is ``pvibr.Name``: the lazy door for users, or what the root itself defines."""
    found = getattr(pvibr, name.split('.')[1], pvibr)
    return name.count('.') == 1 and not isinstance(found, ModuleType)


def test_few_files_lie_flat():
    assert len(list(ROOT.glob('*.py'))) <= 8


@pytest.mark.parametrize('name', ['gl', 'maths'])
def test_low_layers_know_no_pyvista(name):
    for path in (ROOT / name).glob('*.py'):
        assert not any(n.split('.')[0] == 'pyvista' for n in imported(path))


def test_few_classes_of_ours_above_any():
    """One finds the method of a class in few files."""
    for path in MODULES:
        if path.stem != '__main__':
            module = import_module(
                '.'.join(('pvibr', *path.relative_to(ROOT).with_suffix('').parts))
            )
            for cls in vars(module).values():
                if isinstance(cls, type) and cls.__module__ == module.__name__:
                    ours = [c.__name__ for c in cls.__mro__ if c.__module__.startswith('pvibr.')]
                    assert len(ours) <= 5, ours


def run(code):
    done = subprocess.run(
        [sys.executable, '-W', 'error', '-c', code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_importing_imports_nothing_else():
    heavy = run(
        'import sys; before = set(sys.modules); import pvibr; pvibr.__all__;'
        'print(*set(sys.modules) - before)'
    )
    assert {m for m in heavy if m.startswith('pvibr')} == {'pvibr'}
    assert not [m for m in heavy if m.startswith(('vtk', 'numpy', 'pyvista', 'scipy', 'trimesh'))]


def test_component_adds_nothing_heavy_to_plotting():
    names = run(
        'import sys, pyvista as pv; pv.Plotter; before = set(sys.modules);'
        'import pvibr.api.plotter_component, pvibr.api.mesh_accessor;'
        'print(*set(sys.modules) - before)'
    )
    assert not [m for m in names if m.startswith(('trimesh', 'imageio', 'scipy', 'rich'))]
    assert not [m for m in names if m.startswith('vtkmodules')]
    assert not [
        m for m in names if m.startswith(('pvibr.instances', 'pvibr.figures', 'pvibr.substitutes'))
    ]


def test_a_plotter_and_a_mesh_find_pvibr_by_themselves():
    names = run(
        'import pyvista as pv; pl = pv.Plotter(off_screen=True);'
        'print(type(pl.ibr).__module__, type(pv.Sphere().ibr).__module__,'
        'type(pv.MultiBlock().ibr).__module__, type(pv.UnstructuredGrid().ibr).__module__)'
    )
    assert names == ['pvibr.api.plotter_component'] + ['pvibr.api.mesh_accessor'] * 3


def test_names_of_the_root():
    assert pvibr.__version__.count('.') >= 1
    assert set(pvibr.__all__) <= set(dir(pvibr))
    with pytest.raises(AttributeError, match='nothing_here'):
        pvibr.nothing_here


def test_shaders_name_files_that_exist():
    names = {path.name for path in ROOT.rglob('*')} | {'my.glsl'}
    for shader in ROOT.rglob('*.glsl'):
        assert set(re.findall(r'\b\w+\.(?:glsl|py)\b', shader.read_text())) <= names, shader
