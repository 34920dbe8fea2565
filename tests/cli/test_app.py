import subprocess
import sys
import types
from pathlib import Path
from shutil import copytree, ignore_patterns

import numpy as np
import pytest
import pyvista as pv

import benchmarks
import pvibr
from pvibr.cli import app as cli
from pvibr.core.errors import PvibrError
from pvibr.instances import levels


@pytest.fixture
def called(monkeypatch):
    """Stand in for the bodies of the commands; give what they were called with."""
    calls = []
    for name in ('demo', 'view'):
        module = types.ModuleType(f'pvibr.cli.{name}')
        module.main = lambda *args, **kwargs: calls.append((args, kwargs))
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(benchmarks, 'main', module.main)
    monkeypatch.setattr(cli, '_require_gl', lambda **kwargs: None)
    return calls


@pytest.fixture
def files(tmp_path):
    for name in ('mesh.ply', 'poses.csv'):
        (tmp_path / name).write_text('')
    return [str(tmp_path / 'mesh.ply'), '--poses', str(tmp_path / 'poses.csv')]


def fails(capsys, *tokens):
    assert cli.main(tokens) == 2
    said, complaint = capsys.readouterr()
    assert said == ''
    assert complaint.startswith('pvibr: error: ')
    assert complaint.count('\n') == 1
    return complaint


@pytest.mark.parametrize(
    ('tokens', 'named'),
    [
        (['dmo'], 'demo'),
        (['demo', '--sizee', '3'], '--sizee'),
        (['demo', 'extra'], 'extra'),
        (['demo', '--count', '0'], '--count'),
        (['demo', '--count', 'x'], '--count'),
        (['demo', '--max-error', 'nan'], '--max-error'),
        (['demo', '--max-error', '-1'], '--max-error'),
        (['demo', '--frames', '0'], '--frames'),
        (['demo', '--size', '1280'], '1280x720'),
        (['demo', '--size', '0x9'], '0x9'),
        (['demo', '--movie'], '--movie'),
        (['view', 'no-such.ply', '--poses', 'x'], 'no-such.ply'),
        (['bake', 'no-such.ply'], 'no-such.ply'),
        (['bake', __file__, '-o', 'nowhere/a.npz'], 'nowhere'),
        (['bench', 'instancez'], 'instances'),
    ],
)
def test_bad_arguments_are_one_line_and_exit_code_2(called, capsys, tokens, named):
    assert named in fails(capsys, *tokens)
    assert called == []


def test_view_needs_three_columns(called, capsys, files):
    assert 'gx,gy,-' in fails(capsys, 'view', *files, '--columns', 'a,b')
    assert 'gx,gy,-' in fails(capsys, 'view', *files, '--columns', 'a,,b')


@pytest.mark.parametrize(
    'error',
    [
        ValueError('line 3:\n  not a number'),
        FileNotFoundError(2, 'No such file', 'a.csv'),
        PvibrError('nothing can be drawn'),
        ImportError('imageio_ffmpeg'),
        PermissionError(13, 'Permission denied', 'out'),
    ],
)
def test_errors_of_the_library_are_one_line(called, capsys, monkeypatch, error):
    def main(**kwargs):
        raise error

    monkeypatch.setattr(sys.modules['pvibr.cli.demo'], 'main', main)
    complaint = fails(capsys, 'demo')
    assert all(word in complaint for word in str(error).split())
    monkeypatch.setenv('PVIBR_DEBUG', '1')
    with pytest.raises(type(error)):
        cli.main(['demo'])


def test_an_interruption_is_not_an_error(called, capsys, monkeypatch):
    def main(**kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules['pvibr.cli.demo'], 'main', main)
    assert cli.main(['demo']) == 130


def test_demo_passes_its_options_on(called):
    assert cli.main(['demo']) == 0
    tokens = 'demo -o there --count 5 --max-error 2 --frames 3 --window --movie a.mp4 --size 64x32'
    assert cli.main(tokens.split()) == 0
    (_, default), (_, given) = called
    assert default['out'] == Path('out')
    assert (default['count'], default['max_error'], default['frames']) == (10_000, 1.0, None)
    assert default['size'] == (1024, 768)
    assert given == {
        'out': Path('there'),
        'count': 5,
        'max_error': 2.0,
        'frames': 3,
        'window': True,
        'movie': Path('a.mp4'),
        'size': (64, 32),
    }


def test_view_passes_its_options_on(called, files):
    tokens = ['--scalars', 'growth', '--cmap', 'hot', '--columns', 'gx,gy,-', '-o', 'a.png']
    assert cli.main(['view', *files, *tokens]) == 0
    ((args, kwargs),) = called
    assert args == (Path(files[0]), Path(files[2]))
    assert kwargs['columns'] == ('gx', 'gy', None)
    assert (kwargs['scalars'], kwargs['cmap'], kwargs['out']) == ('growth', 'hot', Path('a.png'))


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='others always have a display')
def test_a_window_needs_a_display(called, capsys, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, 'pvibr.cli.demo', types.SimpleNamespace(main=None))
    monkeypatch.delenv('DISPLAY', raising=False)
    assert '--window needs a display' in fails(capsys, 'demo', '--window')


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='others always have a display')
@pytest.mark.parametrize('display', [True, False])
def test_view_opens_a_window_where_there_is_a_display(called, files, monkeypatch, display):
    if display:
        monkeypatch.setenv('DISPLAY', ':7')
    else:
        monkeypatch.delenv('DISPLAY', raising=False)
    for tokens in ([], ['-o', 'a.png'], ['--no-window']):
        assert cli.main(['view', *files, *tokens]) == 0
    assert [kwargs['window'] for _, kwargs in called] == [display, False, False]


@pytest.mark.slow
def test_bake_writes_files(tmp_path, capsys):
    pv.Sphere(theta_resolution=9, phi_resolution=9).save(tmp_path / 'ball.ply')
    out, sheet = tmp_path / 'ball.npz', tmp_path / 'views.png'
    assert (
        cli.main(['bake', str(tmp_path / 'ball.ply'), '-o', str(out), '--sheet', str(sheet)]) == 0
    )
    said = capsys.readouterr().out
    assert f'wrote {out}: 576 views' in said
    assert str(sheet) in said
    assert out.is_file()
    assert sheet.is_file()


@pytest.fixture
def balls(tmp_path, monkeypatch):
    monkeypatch.setattr(levels, '_GRID', (4, 16))
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path / 'cache'))
    paths = [tmp_path / f'ball{n}.ply' for n in range(2)]
    for n, path in enumerate(paths):
        pv.Sphere(theta_resolution=30 + n).save(path)
    return [str(path) for path in paths]


def test_bake_fills_the_cache_and_goes_on_where_it_stopped(balls, tmp_path, capsys):
    options = ['--color', 'tan', '--smooth-shading']
    assert cli.main(['bake', balls[0], *options]) == 0
    assert 'baked in' in capsys.readouterr().out
    assert cli.main(['bake', *balls, *options, '--processes', '2']) == 0
    first, second = sorted(capsys.readouterr().out.splitlines())
    assert 'in the cache already' in first
    assert 'baked in' in second
    assert len(list((tmp_path / 'cache').iterdir())) == 2
    plotter = pv.Plotter(off_screen=True)
    looks = {'color': 'tan', 'smooth_shading': True}
    places = np.random.default_rng(0).uniform(-9, 9, (2000, 3))
    drawn = plotter.ibr.add_instances(balls[1], places, bake=True, wait=False, **looks)
    assert not drawn.pending
    plotter.close()


def test_bake_names_meshes_that_it_cannot_bake(balls, tmp_path, capsys):
    page = tmp_path / 'page.ply'
    page.write_text('<!doctype html>')
    assert cli.main(['bake', str(page), balls[0]]) == 2
    said = capsys.readouterr()
    assert 'page.ply' in said.err
    assert 'baked in' in said.out
    assert cli.main(['bake', *balls, '--sheet', str(tmp_path / 'a.png')]) == 2
    assert 'for one mesh, got 2' in capsys.readouterr().err


def test_bench_passes_the_seed_of_a_survey_on(called, capsys):
    assert cli.main(['bench', 'instances', '--survey', '7']) == 0
    assert called == [
        (('instances',), {'out': Path('out'), 'quick': False, 'survey': 7, 'heavy': False})
    ]
    assert 'seed' in fails(capsys, 'bench', 'instances', '--survey', '-1')
    assert '--survey' in fails(capsys, 'bench', 'shadows', '--survey', '1')


@pytest.mark.parametrize('name', ['moving', 'shadows', 'projection'])
def test_bench_passes_its_options_on(called, name):
    assert cli.main(['bench', name, '--quick', '-o', 'b']) == 0
    assert called == [((name,), {'out': Path('b'), 'quick': True})]


def test_an_installed_package_says_where_benchmarks_are(tmp_path):
    copytree(
        Path(pvibr.__file__).parent, tmp_path / 'pvibr', ignore=ignore_patterns('__pycache__')
    )
    code = 'import sys; from pvibr.cli.app import main; sys.exit(main(["bench", *sys.argv[1:]]))'
    for names in ([], ['instances'], ['instances', '--quick']):
        done = subprocess.run(
            [sys.executable, '-c', code, *names],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert 'clone it' in done.stdout + done.stderr, done
        assert 'Traceback' not in done.stderr


def test_benchmarks_are_those_of_the_clone(tmp_path):
    (tmp_path / 'benchmarks').mkdir()
    (tmp_path / 'benchmarks' / '__init__.py').write_text('')
    code = 'import sys; from pvibr.cli.app import main; sys.exit(main(["bench", "--help"]))'
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert 'shadows' in done.stdout


@pytest.mark.parametrize(('problems', 'code'), [([], 0), ([('EGL', 'apt-get')], 1)])
def test_doctor_says_what_it_found(capsys, monkeypatch, problems, code):
    from pvibr.cli import doctor

    monkeypatch.setattr(doctor, 'diagnose', lambda: doctor.Diagnosis({'a': 'b'}, problems))
    assert cli.main(['doctor']) == code
    assert 'a           b' in capsys.readouterr().out


def test_version_and_help_need_neither_vtk_nor_pyvista(capsys):
    code = """
import sys
from pvibr.cli import app as cli
assert cli.main(['--version']) == 0
assert cli.main(['demo', '--help']) == 0
heavy = {'vtkmodules', 'pyvista', 'scipy'} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith('0.')
    assert '--max-error' in done.stdout
