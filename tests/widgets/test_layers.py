"""What panels import: toolkits when asked for, VTK by pvibr's door; and pvibr no panel."""

import ast
import subprocess
import sys
from pathlib import Path

import pvibr
import pvibr_widgets

FOLDER, ROOT = Path(pvibr_widgets.__file__).parent, Path(pvibr.__file__).parent
TOOLKITS = 'anywidget', 'qtpy', 'PySide6', 'trame', 'pyvistaqt', 'vtk', 'vtkmodules'


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.partition('.')[0]


def test_pvibr_knows_no_panel():
    assert not [p for p in ROOT.rglob('*.py') if 'pvibr_widgets' in imported(p)]


def test_panels_have_toolkits_and_vtk_from_pvibr():
    found = {p.name: {*imported(p)} & {*TOOLKITS} for p in FOLDER.glob('*.py')}
    assert not [name for name, names in found.items() if names]


def test_importing_imports_no_toolkit():
    code = (
        'import sys, pvibr_widgets; pvibr_widgets.Model; dir(pvibr_widgets);'
        'print(*[m for m in sys.modules if m.partition(".")[0] in '
        f'{TOOLKITS[:5]!r}])'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_names_of_the_package():
    for name in pvibr_widgets.__all__:
        assert name in dir(pvibr_widgets)
    assert not hasattr(pvibr_widgets, 'nothing_here')


def test_what_panels_read_beside_python_is_in_the_package():
    assert {p.name for p in FOLDER.iterdir() if p.suffix in ('.js', '.css')} == {
        'panel.js',
        'notebook.js',
        'panel.css',
        'picture.js',
    }
