"""Every example runs as it is, with fewer instances and lighter meshes, and shows something."""

import ast
import contextlib
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

FOLDER = Path(__file__).parents[1] / 'examples'
SMALL = {'COUNT': 120, 'TRIANGLES': 29_000, 'VIEWS': 8, 'SIZE': 120}
#: Extras that not everyone has.
EXTRAS = {'mujoco': 'simulate', 'trame': 'jupyter', 'trame_pyvista': 'jupyter'}
EXAMPLES = sorted(FOLDER.glob('*.py'))


class _Smaller(ast.NodeTransformer):
    """Make the constants at the head of an example small."""

    def visit_Assign(self, node):
        name = getattr(node.targets[0], 'id', None)
        if name in SMALL:
            node.value = ast.copy_location(ast.Constant(SMALL[name]), node.value)
        return node


def run(path):
    """Return the names that an example leaves, and the pictures of its plotters."""
    tree = _Smaller().visit(ast.parse(path.read_text()))
    names = {'__name__': '__main__', '__file__': str(path)}
    try:
        exec(compile(tree, path, 'exec'), names)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        pytest.skip(f"needs {error.name}: pip install 'pvibr[{EXTRAS[error.name]}]'")
    return names


@pytest.fixture
def pictures(monkeypatch, tmp_path):
    """Collect the picture of every plotter as it closes; measure less, and share nothing."""
    found = []
    monkeypatch.setattr('pvibr.instances.measure.SIZES', (8, 32))
    monkeypatch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path))
    monkeypatch.setattr(pv, 'OFF_SCREEN', True)
    monkeypatch.setattr(
        pv.global_theme,
        '_before_close_callback',
        lambda plotter: found.append(plotter.screenshot(return_img=True)),
    )

    def serve(_server, **_):
        found.extend(
            p.screenshot(return_img=True) for p in pv.plotting.plotter._ALL_PLOTTERS.values()
        )

    with contextlib.suppress(ImportError):
        monkeypatch.setattr('trame_server.Server.start', serve)
    return found


def test_there_are_examples():
    assert len(EXAMPLES) >= 8


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda p: p.stem)
def test_runs_and_shows_something(path, pictures):
    names = run(path)
    if 'picture' in names and hasattr(names['picture'], 'point_data'):  # of a plain VTK window
        pictures.append(names['picture'].active_scalars)
    assert pictures
    spread = np.asarray(pictures[-1], float).reshape(-1, 3).std(0)
    assert spread.max() > 5


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda p: p.stem)
def test_is_short_and_numbered(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 60
    assert text.startswith('"""\n')
    assert '# %%\n# 1. ' in text
