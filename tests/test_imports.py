"""Imports go down only, VTK has one door, and importing costs nothing."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import pvibr

ROOT = Path(pvibr.__file__).parent
RANKS = {
    '_vtk': 0,
    'errors': 0,
    'files': 0,
    'maths': 1,
    'gl': 2,
    'params': 3,
    'frame': 3,
    'effect': 3,
}
RANKS |= {
    'casters': 3,
    'lights': 3,
    'depth_view': 3,
    'moments': 3,
    'pictures': 3,
    'visibility': 3,
    'unwrap': 3,
}
RANKS |= {'clouds': 4, 'cloud_files': 4, 'cloud_texture': 4}
RANKS |= {'scenes': 4, 'animation': 4, 'actors': 4, 'effects': 4, 'report': 5, 'pipeline': 5}
RANKS |= {'shadow_volume': 3, 'buffers': 3, 'outlines': 3, 'shine': 3, 'full_screen': 3}
RANKS |= {
    'state_files': 4,
    'clock': 5,
    'quality': 5,
    'web_report': 5,
    'baked': 5,
    'baked_copies': 5,
    'baked_glb': 5,
    'baked_html': 5,
    'baked_paint': 5,
    'baked_props': 5,
    'baked_scene': 5,
    'baked_surfaces': 5,
    'component': 6,
    'accessor': 6,
}  # what is not named here is a command: 7
RANKS |= {'inspection': 5, 'inspection_marks': 5, 'inspection_tiles': 5}
RANKS |= {'movies': 5, 'large': 5, 'montage': 3, 'determinism': 0}
MODULES = sorted(p for p in ROOT.rglob('*.py') if p != ROOT / '__init__.py')


def layer(name):
    return name.split('.')[1] if '.' in name else name


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f'{path}: write imports in full'
            whole = node.module == 'pvibr'
            yield from ([f'pvibr.{a.name}' for a in node.names] if whole else [node.module])


@pytest.mark.parametrize('path', MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_down_only(path):
    mine = path.relative_to(ROOT).with_suffix('').parts[0]
    for name in imported(path):
        theirs = layer(name)
        if name.split('.')[0] in ('vtk', 'vtkmodules', 'cvista'):
            assert mine == '_vtk', f'{name}: VTK is imported by pvibr._vtk only'
        elif name.startswith('pvibr.') and (mine != theirs or mine == 'effects'):
            # `pvibr.Name` is the lazy door for users; whoever is a command may use it.
            assert RANKS.get(theirs, 7) <= RANKS.get(mine, 7), f'{path.name} imports {name}'
            assert not mine == theirs == 'effects', f'{path.name} imports {name}'


@pytest.mark.parametrize('name', ['gl', 'maths'])
def test_low_layers_know_no_pyvista(name):
    for path in (ROOT / name).glob('*.py'):
        assert not any(n.split('.')[0] == 'pyvista' for n in imported(path))


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
        'import pvibr.component, pvibr.accessor;'
        'print(*set(sys.modules) - before)'
    )
    assert not [m for m in names if m.startswith(('trimesh', 'imageio', 'scipy', 'rich'))]
    assert not [m for m in names if m.startswith('vtkmodules')]
    assert not [m for m in names if m.startswith('pvibr.actors')]


def test_a_plotter_and_a_mesh_find_pvibr_by_themselves():
    names = run(
        'import pyvista as pv; pl = pv.Plotter(off_screen=True);'
        'print(type(pl.ibr).__module__, type(pv.Sphere().ibr).__module__,'
        'type(pv.MultiBlock().ibr).__module__, type(pv.UnstructuredGrid().ibr).__module__)'
    )
    assert names == ['pvibr.component'] + ['pvibr.accessor'] * 3


def test_names_of_the_root():
    assert pvibr.__version__.count('.') >= 1
    assert set(pvibr.__all__) <= set(dir(pvibr))
    with pytest.raises(AttributeError, match='nothing_here'):
        pvibr.nothing_here
