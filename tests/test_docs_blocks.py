"""Every Python block of README and docs runs as printed, on data that comes along.

The blocks of a page are one program, run in order in an empty folder, off screen.
"""

import re
from importlib.util import find_spec
from pathlib import Path

import pytest
import pyvista as pv

import pvibr
import pvibr_widgets
from pvibr.scenes.trees import tree_parts
from tests.marks import slow

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
BLOCK = re.compile(r'^```python\n(.*?)^```', re.MULTILINE | re.DOTALL)
#: Their blocks are files of a project, which tests of their own run.
OF_FILES = {
    'add-an-effect.md': 'tests/effects/test_docs.py',
    'regression.md': 'tests/test_regression_page.py',
}
#: Its blocks are the cells of a notebook.
OF_CELLS = 'notebooks.md'
#: More than two seconds of processor time.
SLOW = {
    'README.md',
    'index.md',
    OF_CELLS,
    'billboard-clouds.md',
    'billboards.md',
    'clusters.md',
    'effects.md',
    'figures.md',
    'from-glyph.md',
    'inspect.md',
    'instances.md',
    'large-meshes.md',
    'projection.md',
    'web.md',
}
#: Extras that not everyone has.
EXTRAS = {'ephem', 'anywidget', 'distributed', 'pyvistaqt', 'trame', 'trame_pyvista'}


def blocks(page):
    """Return the code of each block, at its line of the page, so that tracebacks name it."""
    text = page.read_text(encoding='utf-8')
    for found in BLOCK.finditer(text):
        yield '\n' * text.count('\n', 0, found.start(1)) + found[1]


SCRIPTS = [
    slow(page, when=page.name in SLOW, id=page.stem)
    for page in PAGES
    if any(blocks(page)) and page.name not in {*OF_FILES, OF_CELLS}
]


@pytest.fixture
def _small(monkeypatch, tmp_path):
    """Run in an empty folder, with small windows and few views in atlases of figures."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('QT_QPA_PLATFORM', 'offscreen')
    monkeypatch.setattr(pv.global_theme, 'window_size', [200, 150])
    monkeypatch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)
    monkeypatch.setattr('pvibr_widgets.choice._is_notebook', lambda: True)  # as for panels


@pytest.mark.parametrize('page', SCRIPTS)
@pytest.mark.usefixtures('_small', 'small_trees')
def test_page_runs_as_printed(page):
    names = {'__name__': '__main__'}
    try:
        for code in blocks(page):
            exec(compile(code, page, 'exec', dont_inherit=True), names)
    except ImportError as error:
        if error.name not in EXTRAS:
            raise
        pytest.skip(f'needs {error.name}')
    if 'pl' in names and not names['pl']._closed:
        shows_something(names['pl'])


def test_trees_of_pages_have_enough_triangles():
    """Pages run with small trees, for which fewer are enough."""
    text = '\n'.join(page.read_text(encoding='utf-8') for page in PAGES)
    found = set(re.findall(r"tree_parts\('(\w+)', triangles=([\d_]+)\)", text))
    assert found
    for kind, triangles in found:
        assert tree_parts(kind, triangles=int(triangles))


def shows_something(pl):
    pl.render()
    picture = pl.screenshot(return_img=True)
    assert picture.reshape(-1, 3).std(axis=0).max() > 5
    report = pl.ibr.report()
    assert 'off' not in {row.state for row in report.rows}, report


@pytest.mark.slow
def test_cells_run_as_printed(monkeypatch, tmp_path):
    if not (find_spec('nbclient') and find_spec('trame_pyvista')):
        pytest.skip("needs nbclient and trame_pyvista: pip install 'pvibr[test]'")
    import nbformat
    from nbclient import NotebookClient

    for name in ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR', 'IPYTHONDIR'):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    monkeypatch.setenv('JUPYTER_PLATFORM_DIRS', '1')
    cells = [nbformat.v4.new_code_cell(code.strip()) for code in blocks(ROOT / 'docs' / OF_CELLS)]
    made = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(made, timeout=120, kernel_name='python3').execute(cwd=str(tmp_path))
    assert len(cells) > 3
    said = [out.text for cell in cells for out in cell.outputs if out.get('name') == 'stderr']
    assert not complaints('\n'.join(said))


def complaints(said):
    """Return the lines of ``said`` that are warnings, VTK's errors or frames of pvibr's own code.

    What a kernel says of its transport, trame of a download that a machine without internet
    refuses and VTK of a missing display falls into any cell, or none: a matter of time.
    """
    ours = [re.escape(str(Path(package.__file__).parent)) for package in (pvibr, pvibr_widgets)]
    wrong = re.compile(r'\.py:\d+: \w*Warning: |\b(?:ERR|WARN)\||' + '|'.join(ours))
    lines = [line for line in said.splitlines() if wrong.search(line)]
    return [line for line in lines if 'bad X server' not in line]


@pytest.mark.parametrize(
    'line',
    [
        '/tmp/ipykernel_1/2.py:3: UserWarning: Bloom is off',
        '(   1.2s) [        1]  vtkShader.cxx:1   ERR| vtkShaderProgram (0x1): Could not create',
        f'  File "{Path(pvibr.__file__).parent}/scene/component.py", line 3, in add',
    ],
    ids=['warning', 'error of VTK', 'traceback'],
)
def test_complaints_are_seen(line):
    assert complaints(f'Task exception was never retrieved\n{line}\n') == [line]


def test_pages_of_files_have_tests():
    for name, test in OF_FILES.items():
        assert name in (ROOT / test).read_text(encoding='utf-8')
