"""Every example runs as it is, with fewer instances, lighter meshes and smaller windows.

And what pvibr adds to it is seen.
"""

import ast
import contextlib
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.levels import make_model
from tests.marks import slow

FOLDER = Path(__file__).parents[1] / 'examples'
SMALL = {'COUNT': 120, 'TRIANGLES': 6_000, 'VIEWS': 8, 'SIZE': 120}
#: What an argument becomes, wherever it is.
SMALLER = {
    'views': '{0} if isinstance({0}, str) else 6',
    'resolution': 'min({0}, 1024)',  # of shadow maps
    'window_size': 'tuple(n // 3 if n > 400 else n for n in {0})',
}
#: Extras that not everyone has.
EXTRAS = {'mujoco': 'simulate', 'trame': 'jupyter', 'trame_pyvista': 'jupyter'}
#: Those that show what they made with pvibr as plain meshes.
PLAIN = ('atlas', 'billboard_cloud', 'error')
EXAMPLES = sorted(FOLDER.glob('*.py'))
#: More than two seconds of processor time.
SLOW = {
    'ant_macro',
    'baked',
    'billboard_cloud',
    'colours',
    'crowd',
    'error',
    'foliage_levels',
    'animated_gltf',
    'gyroid',
    'sun',
}
RUN = [slow(path, when=path.stem in SLOW, id=path.stem) for path in EXAMPLES]


class _Smaller(ast.NodeTransformer):
    """Make the constants at the head of an example small, and its windows."""

    def visit_Assign(self, node):
        name = getattr(node.targets[0], 'id', None)
        if name in SMALL:
            node.value = ast.copy_location(ast.Constant(SMALL[name]), node.value)
        return self.generic_visit(node)

    def visit_keyword(self, node):
        if smaller := SMALLER.get(node.arg):
            text = smaller.format(ast.unparse(node.value))
            node.value = ast.copy_location(ast.parse(text, mode='eval').body, node.value)
        return self.generic_visit(node)


def run(path):
    """Return the names that an example leaves."""
    tree = ast.fix_missing_locations(_Smaller().visit(ast.parse(path.read_text())))
    names = {'__name__': '__main__', '__file__': str(path)}
    try:
        exec(compile(tree, path, 'exec'), names)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        pytest.skip(f"needs {error.name}: pip install 'pvibr[{EXTRAS[error.name]}]'")
    return names


@pytest.fixture
def shown(monkeypatch, small_trees):
    """Collect of every plotter, as it closes: its report, its picture, and that without pvibr."""
    found = []
    monkeypatch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)
    monkeypatch.setitem(make_model.__kwdefaults__, 'views', 8)
    monkeypatch.setattr(pv, 'OFF_SCREEN', True)

    def look(plotter):
        picture, report = plotter.screenshot(return_img=True), plotter.ibr.report()
        plotter.ibr.clear()
        plotter.render()
        found.append((report, picture, plotter.screenshot(return_img=True)))

    def serve(_server, **_):
        for plotter in pv.plotting.plotter._ALL_PLOTTERS.values():
            look(plotter)

    monkeypatch.setattr(pv.global_theme, '_before_close_callback', look)
    with contextlib.suppress(ImportError):
        monkeypatch.setattr('trame_server.Server.start', serve)
    return found


def share_changed(one, other):
    """The share of pixels that look otherwise."""
    off = np.abs(np.asarray(one, int) - np.asarray(other, int))
    return (off.reshape(-1, 3).max(axis=1) > 20).mean()


def again(grab):
    grab.Modified()
    grab.Update()
    return pv.wrap(grab.GetOutput()).active_scalars


@pytest.mark.sampled
@pytest.mark.parametrize('path', RUN)
def test_runs_and_shows_what_pvibr_adds(path, shown):
    changed, names = [], run(path)
    if path.stem == 'plain_vtk':  # it looked, and closed what it had attached
        changed.append(share_changed(names['picture'].active_scalars, again(names['grab'])))
    assert all(picture.reshape(-1, 3).std(axis=0).max() > 5 for _, picture, _ in shown)
    for report, picture, without in shown:
        # Still views are refined from the second frame on.
        ran = {row.state for row in report.rows if row.effect != 'Accumulation'}
        assert ran <= {'ran'}, report
        if report.rows:
            changed.append(share_changed(picture, without))
    assert (path.stem in PLAIN) or changed
    assert all(share > 0.002 for share in changed), changed


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda p: p.stem)
def test_is_short_and_numbered(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 60
    assert text.startswith('"""\n')
    assert '# %%\n# 1. ' in text
