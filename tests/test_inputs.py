"""No public call changes what it is given: inputs are hashed before and after every example."""

import doctest
import functools
import hashlib
import inspect
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import pyvista as pv
from pyvista import examples

import pvibr
import pvibr.animation
import pvibr_widgets
from pvibr.animation import Correctives, Figure, FigureMesh, Pose, Skeleton
from pvibr.api.mesh_accessor import IBRAccessor
from pvibr.api.plotter_component import IBRComponent
from tests.test_docstrings import is_ours, members

OWNERS = {
    **{name: getattr(pvibr, name) for name in pvibr.__all__},
    **{name: getattr(pvibr.animation, name) for name in pvibr.animation.__all__},
    **{name: getattr(pvibr_widgets, name) for name in pvibr_widgets.__all__},
    'plotter.ibr': IBRComponent,
    'mesh.ibr': IBRAccessor,
}
NAMES = sorted(name for name, owner in OWNERS.items() if callable(owner) and is_ours(owner))


def leaves(value, found, depth=8):
    """Collect the arrays and data sets that a value holds, by what they are called."""
    if isinstance(value, (np.ndarray, pv.DataObject)):
        found.append(value)
    elif depth and isinstance(value, dict):
        for one in value.values():
            leaves(one, found, depth - 1)
    elif depth and isinstance(value, (list, tuple)):
        for one in value[:50]:
            leaves(one, found, depth - 1)
    elif depth and is_ours(type(value)) and not hasattr(value, 'prepare'):
        slots = [name for kind in type(value).__mro__ for name in getattr(kind, '__slots__', ())]
        leaves([getattr(value, name, None) for name in slots], found, depth - 1)
        leaves(dict(getattr(value, '__dict__', {})), found, depth - 1)
    return found


def digest(value):
    """Return a hash of all that a caller sees of an array or a data set."""
    state = hashlib.sha1()
    for name, array in contents(value):
        state.update(f'{name} {array.dtype} {array.shape}'.encode())
        state.update(repr(array.tolist()).encode() if array.dtype == object else array.tobytes())
    return state.hexdigest()


def contents(value):
    if isinstance(value, np.ndarray):
        yield '', value
    elif isinstance(value, pv.MultiBlock):
        for key, block in zip(value.keys(), value, strict=True):
            yield from ((f'{key}.{name}', array) for name, array in contents(block))
    else:
        for name in ('points', 'faces', 'lines', 'verts', 'strips', 'cells', 'dimensions'):
            if getattr(value, name, None) is not None:
                yield name, np.asarray(getattr(value, name))
        for name in ('point_data', 'cell_data', 'field_data'):
            data = getattr(value, name, {})
            yield from ((f'{name}.{key}', np.asarray(data[key])) for key in data)
            for active in ('active_scalars_name', 'active_normals_name'):
                yield active, np.asarray(str(getattr(data, active, None)))


class Watch:
    """Wraps functions, and notes which were called and which changed an argument."""

    def __init__(self):
        self.called, self.changed, self.inside = set(), [], False

    def wrap(self, name, function, own):
        @functools.wraps(function)
        def called(*args, **kwargs):
            if self.inside:  # what pvibr calls is its own affair
                return function(*args, **kwargs)
            given = leaves([*args[own:], kwargs], [])
            before = [digest(one) for one in given]
            self.inside = True
            try:
                return function(*args, **kwargs)
            finally:
                self.inside = False
                self.called.add(name)
                if [digest(one) for one in given] != before:
                    self.changed.append(name)

        return called


@pytest.fixture(scope='module')
def watching():
    """Watch every public function and method."""
    made = Watch()
    with pytest.MonkeyPatch.context() as patch:
        wrap_all(made, patch)
        yield made


@pytest.fixture
def watch(watching):
    """Return what watches, with nothing noted yet."""
    watching.called, watching.changed = set(), []
    return watching


def wrap_all(made, patch):
    """Wrap every public function and method."""
    for name in NAMES:
        owner = OWNERS[name]
        if inspect.isclass(owner):
            names = {one.__name__ for one in members(owner) if inspect.isfunction(one)}
            for key in {*names, '__init__'} & {*vars(owner)}:
                value = vars(owner)[key]
                function = getattr(value, '__func__', value)
                if inspect.isfunction(function):
                    wrapped = made.wrap(
                        f'{name}.{key}', function, not isinstance(value, staticmethod)
                    )
                    kind = type(value) if function is not value else (lambda one: one)
                    patch.setattr(owner, key, kind(wrapped))
        else:
            for module in (pvibr, pvibr.animation, pvibr_widgets):
                if getattr(module, name, None) is owner:
                    patch.setattr(module, name, made.wrap(name, owner, 0))


@pytest.mark.sampled
@pytest.mark.parametrize('name', NAMES)
def test_no_example_changes_its_input(name, watch, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    owner = OWNERS[name]
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
    module = inspect.getmodule(owner)
    for test in doctest.DocTestFinder().find(owner, name, module=module, globs=dict(vars(module))):
        runner.run(test, out=lambda text: None)
    assert not watch.changed


def given(rng):
    """Return what the calls below are given."""
    ball = pv.Sphere(theta_resolution=12, phi_resolution=8)
    ball['height'] = ball.points[:, 2].copy()
    image = rng.integers(0, 255, (16, 16, 4), dtype=np.uint8)
    cloud = pv.PolyData(rng.normal(size=(5, 3)))
    cloud['wind'] = rng.normal(size=(5, 3))
    cloud.set_active_scalars(None)
    moved = FigureMesh(pv.Sphere(theta_resolution=12, phi_resolution=8), node=0)
    return {
        'ball': ball,
        'bare': pv.PolyData(ball.points.copy(), ball.faces.copy()),
        'blocks': pv.MultiBlock([ball.copy(), pv.Cube().triangulate()]),
        'points': rng.normal(size=(5, 3)),
        'ends': rng.normal(size=(5, 3)),
        'cloud': cloud,
        'sizes': rng.uniform(0.2, 0.5, 5),
        'radii': rng.uniform(0.2, 0.5, (5, 3)),
        'turns': rng.normal(size=(5, 4)),
        'colors': rng.uniform(size=(5, 3)),
        'opacity': rng.uniform(0.2, 0.9, 5),
        'values': rng.normal(size=5),
        'seen': np.array([True, False, True, True, True]),
        'image': image,
        'images': [image.copy(), image.copy()],
        'figure': Figure([moved], Skeleton([-1], Pose([[0.0, 0.0, 0.0]]))),
        'labels': rng.integers(0, 2, ball.n_cells),
        'target': rng.normal(size=ball.points.shape).astype(np.float32),
    }


_K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
_CAMERA = pvibr.Pinhole(_K, np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 3.0], (2048, 1024))
PHOTO = [pvibr.Photo('a.jpg', _CAMERA, examples.mapfile)]
CLOUD = {'planes': 4, 'size': 128, 'supersample': 1}
#: Every way to add something, and what is made of a mesh.
CALLS = {
    'add': lambda pl, g: pl.ibr.add(pvibr.Spheres(g['points'], g['sizes'])),
    'add_animated': lambda pl, g: pl.ibr.add_animated(g['figure'], g['points'], color='red'),
    'add_billboards': lambda pl, g: pl.ibr.add_billboards(
        g['points'],
        g['images'],
        size=g['sizes'],
        opacity=g['opacity'],
        visible=g['seen'],
        cutout=None,
    ),
    'add_cylinders': lambda pl, g: pl.ibr.add_cylinders(
        g['points'], g['ends'], g['sizes'], scalars=g['values']
    ),
    'add_ellipsoids': lambda pl, g: pl.ibr.add_ellipsoids(
        g['points'], g['radii'], g['turns'], colors=g['colors'], opacity=g['opacity']
    ),
    'add_image_layers': lambda pl, g: pl.ibr.add_image_layers(
        [pl.add_mesh(g['ball'], smooth_shading=True)], only_if_faster=False
    ),
    'add_impostor': lambda pl, g: pl.ibr.add_impostor(
        [pl.add_mesh(g['bare'], smooth_shading=True)], only_if_faster=False
    ),
    'add_instances': lambda pl, g: pl.ibr.add_instances(
        g['bare'], g['points'], colors=g['colors'], smooth_shading=True, bake=False
    ),
    'add_large_mesh': lambda pl, g: pl.ibr.add_large_mesh(
        g['ball'], scalars='height', smooth_shading=True
    ),
    'add_photos': lambda pl, g: pl.ibr.add_photos(g['ball'], PHOTO, masks=g['images'][:1]),
    'add_spheres': lambda pl, g: pl.ibr.add_spheres(
        g['cloud'], g['sizes'], scalars=g['values'], visible=g['seen']
    ),
    'bake': lambda pl, g: g['ball'].ibr.bake(views=6, tile=16, scalars='height'),
    'billboard_cloud': lambda pl, g: g['ball'].ibr.billboard_cloud(**CLOUD).add_to(pl),
    'billboard_cloud of blocks': lambda pl, g: g['blocks'].ibr.billboard_cloud(**CLOUD),
    'add_instances of blocks': lambda pl, g: pl.ibr.add_instances(
        g['blocks'], g['points'], bake=False
    ),
    'large': lambda pl, g: pl.ibr.add_large_mesh(
        g['ball'].ibr.large(Path(mkdtemp(), 'ball.pvl'), progress=False)
    ),
    'foliage_levels': lambda pl, g: pvibr.foliage_levels(
        g['bare'], g['labels'], views=4, view_size=32
    ),
    'glyph': lambda pl, g: pl.ibr.add_instances(g['cloud'].ibr.glyph(orient='wind', scale=False)),
    'from_sculpted': lambda pl, g: Correctives.from_sculpted(
        g['figure'], [0], Pose([[[1.0, 0, 0]]], [[[0.0, 1.0, 0, 0]]]), g['target'][None]
    ),
}


@pytest.mark.sampled
@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('name', CALLS)
def test_no_call_nor_frame_changes_its_input(name, seed, monkeypatch, shared_folder):
    monkeypatch.setenv('PVIBR_CACHE', str(shared_folder / 'inputs'))
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    inputs = given(np.random.default_rng(seed))
    before = [digest(one) for one in leaves(inputs, [])]
    held = leaves(inputs, [])
    CALLS[name](pl, inputs)
    pl.show(auto_close=False)
    assert [digest(one) for one in held] == before


def test_every_way_to_add_is_here():
    ways = {name for name in dir(IBRComponent) if name.startswith('add')}
    ways |= {name for name in dir(IBRAccessor) if name[0] != '_'}
    assert ways <= {*CALLS}
