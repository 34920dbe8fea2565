"""Instances as citizens of PyVista: what they are beside, whatever is on, whatever is given."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv
import trimesh
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.core import _vtk
from pvibr.gl import Texture
from pvibr.instances.cards import CARD_SHADERS
from pvibr.instances.levels import make_model
from tests.pictures import read

pytestmark = pytest.mark.sampled

SIZE = (160, 120)
CAMERA = {'eye': (9, -7, 5), 'focus': (-1, 0, 0.2), 'angle': 30}


def crowd(n=24, seed=5, scale=1.0):
    """Return matrices on a plane, turned anyhow, near and far from the camera."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (n, 1, 1))
    sizes = rng.uniform(0.7, 1.2, n) * np.sign(rng.uniform(-0.3, 1, n))
    poses[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix() * sizes[:, None, None]
    i, j = np.divmod(np.arange(n), 6)
    poses[:, :2, 3] = np.stack([3.2 - 2.6 * i, 1.5 * (j - 2.5)], 1) + rng.uniform(
        -0.2, 0.2, (n, 2)
    )
    poses[:, :3, :] *= scale
    return poses


def beans(scenes, bean, poses=None, **kwargs):
    kwargs = {'color': 'tan', 'size': SIZE, 'camera': CAMERA} | kwargs
    return scenes.instances(bean, crowd() if poses is None else poses, **kwargs)


def plain(scenes, bean, poses=None, **kwargs):
    kwargs = {'color': 'tan', 'size': SIZE, 'camera': CAMERA} | kwargs
    return scenes.actors(bean, crowd() if poses is None else poses, **kwargs)


def off(one, other):
    return float(np.abs(one - other).mean())


# ---------------------------------------------------------------- beside what is plain


def test_crowd_is_that_of_plain_actors(scenes, see, bean):
    pl, things = beans(scenes, bean)
    drawn = see.grab(pl)
    truth = see.reduce(see.grab(plain(scenes, bean, scale=4)), 4)
    assert off(drawn, truth) < 0.8 * off(see.grab(plain(scenes, bean)), truth)
    counts = pl.ibr.report().rows[0].details
    assert counts['instances'] == 24
    assert sum(counts[p.name] for p in CARD_SHADERS) > 0
    assert things.n_instances == len(things) == 24


MODES = {
    'fxaa': lambda pl: pl.renderer.SetUseFXAA(True),  # PyVista refuses it under EGL
    'shadows': lambda pl: pl.enable_shadows(),
}


@pytest.mark.parametrize('mode', MODES)
def test_beside_what_plotters_enable(scenes, see, bean, mode, request):
    if mode == 'shadows':
        reason = "shadows of VTK's own do not fall on cards"
        request.applymarker(pytest.mark.xfail(strict=True, reason=reason))
    pictures = []
    cards, things = beans(scenes, bean)
    things.force_level = 'parallax'
    for pl in (cards, plain(scenes, bean), scenes.empty(SIZE)):
        pl.add_mesh(pv.Plane(center=(0, 0, -0.9), i_size=12, j_size=9), color='white')
        pl.add_mesh(pv.Sphere(radius=1.0, center=(3, -1, 0.5)), color='blue', opacity=0.4)
        MODES[mode](pl)
        see.place(pl, **CAMERA)
        see.grab(pl)
        pictures.append(see.grab(pl))
    drawn, truth, without = pictures
    assert off(truth, without) > 0.02, 'the reference shows nothing'
    assert off(drawn, truth) < 0.012


def fog(pl, at):
    grid = pv.ImageData(dimensions=(12, 12, 12), spacing=(0.25,) * 3, origin=np.array(at) - 1.4)
    grid['density'] = np.full(grid.n_points, 100, np.uint8)
    pl.add_volume(grid, cmap='Blues', clim=[0, 255], opacity=[0, 0.2], show_scalar_bar=False)


def glass(pl, at):
    pl.add_mesh(pv.Sphere(radius=1.5, center=at), color='blue', opacity=0.4)


@pytest.mark.parametrize('thing', [fog, glass])
@pytest.mark.parametrize(
    'at', [(4.5, -3.5, 2.2), (-6, 3.5, -0.5), (0, 0, 0)], ids=['before', 'behind', 'within']
)
def test_beside_what_is_translucent(scenes, see, bean, thing, at):
    pictures = []
    for pl in (beans(scenes, bean)[0], plain(scenes, bean)):
        thing(pl, at)
        see.place(pl, **CAMERA)
        pictures.append(see.grab(pl))
    assert off(*pictures) < 0.015


# ---------------------------------------------------------------- cameras and windows


@pytest.mark.parametrize('size', [(300, 60), (60, 300), (1, 1)])
def test_resized(scenes, see, bean, size):
    pl, _ = beans(scenes, bean)
    see.grab(pl)
    pl.window_size = size
    resized = see.grab(pl)
    new, _ = beans(scenes, bean, size=size)
    np.testing.assert_allclose(resized, see.grab(new), atol=1.5 / 255)


CAMERAS = {
    'inside': {'eye': (0.2, 0.4, 0.2), 'focus': (-3, 0, 0), 'angle': 60},
    'pole': {'eye': (0, 0, 14), 'focus': (0, 0, 0), 'up': (0, 1, 0)},
    'below': {'eye': (0, 0, -14), 'focus': (0, 0, 0), 'up': (0, 1, 0)},
    'parallel': CAMERA | {'parallel': 4.0},
    'narrow': {'eye': (90, -70, 50), 'focus': (-1, 0, 0.2), 'angle': 3},
}


@pytest.mark.parametrize('camera', CAMERAS.values(), ids=CAMERAS)
def test_cameras(scenes, see, bean, camera):
    drawn = see.grab(beans(scenes, bean, camera=camera)[0])
    truth = see.reduce(see.grab(plain(scenes, bean, camera=camera, scale=4)), 4)
    assert np.ptp(truth) > 0.3
    assert off(drawn, truth) < 0.012


@pytest.mark.parametrize('move', [(1e6, 5e6, 300.0), (1e9, -1e9, 0)])
def test_far_from_the_origin(scenes, see, bean, move):
    """UTM and worse: to the last bit that doubles keep, the same picture."""
    here = see.grab(beans(scenes, bean)[0])
    poses = crowd()
    poses[:, :3, 3] += move
    moved = {k: np.add(v, move) if k in ('eye', 'focus') else v for k, v in CAMERA.items()}
    there = see.grab(beans(scenes, bean, poses, camera=moved)[0])
    assert off(here, there) < 1 / 255


@pytest.mark.parametrize('scale', [1e-9, 1e9])
def test_of_any_size(scenes, see, bean, scale):
    here = see.grab(beans(scenes, bean)[0])
    scaled = {k: np.multiply(v, scale) if k in ('eye', 'focus') else v for k, v in CAMERA.items()}
    there = see.grab(beans(scenes, bean, crowd(scale=scale), camera=scaled)[0])
    assert off(here, there) < 1 / 255


def test_large_screenshot(scenes, see, bean):
    pl, _ = beans(scenes, bean)
    see.grab(pl)
    large = pl.screenshot(scale=2) / 255.0
    truth = see.reduce(see.grab(plain(scenes, bean, scale=4)), 2)
    assert large.shape == truth.shape
    assert off(large, truth) < 0.01


def test_transparent_background(scenes, see, bean):
    pl, _ = beans(scenes, bean)
    see.grab(pl)
    alpha = pl.screenshot(transparent_background=True)[..., 3] / 255.0
    coverage = see.rgba(pl)[..., 3]
    assert 0.05 < coverage.mean() < 0.9
    assert np.abs(alpha - coverage).mean() < 0.01


def test_each_subplot_keeps_to_itself(scenes, see, bean):
    pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]), border=False)
    pl.disable_anti_aliasing()
    pl.subplot(0, 1)
    things = pl.ibr.add_instances(bean, crowd(), color='tan', bake=True, cache=scenes.folder)
    see.place(pl, **CAMERA)
    one = see.grab(pl)
    assert np.ptp(one[:, : SIZE[0]]) == 0
    alone = see.grab(beans(scenes, bean)[0])
    assert off(one[:, SIZE[0] :], alone) < 0.002  # the dither begins at the window's corner
    pl.subplot(0, 0)
    assert pl.ibr.effects == ()
    pl.ibr.add_instances(bean, crowd(), color='tan', bake=True, cache=scenes.folder)
    pl.link_views()
    see.place(pl, **CAMERA)
    both = see.grab(pl)
    assert off(both[:, : SIZE[0]], both[:, SIZE[0] :]) < 0.002
    things.remove()
    both = see.grab(pl)
    assert np.ptp(both[:, SIZE[0] :]) == 0
    assert off(both[:, : SIZE[0]], alone) < 0.002


def test_a_plain_renderer(scenes, see, bean):
    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkOpenGLRenderer()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    with pvibr.attach(renderer) as ibr:
        kept = {'bake': True, 'cache': scenes.folder}
        things = ibr.add_instances(bean, crowd(), color='tan', lighting=False, **kept)
        camera = renderer.GetActiveCamera()
        camera.SetPosition(*CAMERA['eye'])
        camera.SetFocalPoint(*CAMERA['focus'])
        camera.SetViewUp(0, 0, 1)
        renderer.ResetCameraClippingRange()
        window.Render()
        drawn = read(window) / 255.0
        pl, _ = beans(scenes, bean, lighting=False)
        pl.set_background('black')
        assert off(drawn, see.grab(pl)) < 0.005
        assert ibr.pick(SIZE[0] // 2, SIZE[1] // 2) is not None or things.n_instances
    window.Finalize()


# ---------------------------------------------------------------- a life


def test_name_bounds_visibility(scenes, see, bean):
    pl, things = beans(scenes, bean, name='beans')
    empty = see.grab(scenes.empty(SIZE))
    shown = see.grab(pl)
    assert things.name == 'beans'
    assert 'beans' in pl.actors
    points = np.concatenate([bean.points @ m[:3, :3].T + m[:3, 3] for m in crowd()])
    low, high = np.array(things.bounds).reshape(3, 2).T
    np.testing.assert_allclose([low, high], [points.min(0), points.max(0)], atol=1e-5)
    np.testing.assert_allclose(pl.bounds, things.bounds)
    things.visibility = False
    np.testing.assert_array_equal(see.grab(pl), empty)
    assert pl.ibr.report().rows[0].why == 'not visible'
    things.visibility = True
    np.testing.assert_array_equal(see.grab(pl), shown)
    pl.actors['beans'].visibility = False
    np.testing.assert_array_equal(see.grab(pl), empty)


def test_removed_in_every_way(scenes, see, bean):
    pl, things = beans(scenes, bean, name='beans')
    shown, empty = see.grab(pl), see.grab(scenes.empty(SIZE))
    ways = (
        things.remove,
        lambda: pl.ibr.remove(things),
        pl.ibr.clear,
        lambda: pl.remove_actor('beans'),
        lambda: pl.remove_actor(things),
        pl.clear,
    )
    for way in ways:
        see.place(pl, **CAMERA)
        np.testing.assert_array_equal(see.grab(pl), shown)
        way()
        np.testing.assert_array_equal(see.grab(pl), empty)
        assert pl.ibr.effects == ()
        assert not pl.actors
        assert pl.renderer.GetViewProps().GetNumberOfItems() == 0
        pl.ibr.add(things)
    pl.close()
    other = scenes.empty(SIZE)
    other.ibr.add(things)
    np.testing.assert_array_equal(see.grab(see.place(other, **CAMERA)), shown)


def test_name_replaces(scenes, see, bean):
    pl, first = beans(scenes, bean, name='beans')
    second = pl.ibr.add_instances(
        bean, crowd()[:3], color='tan', name='beans', cache=scenes.folder
    )
    assert pl.ibr.effects == (second,)
    assert first.pipeline is None
    assert 'beans' in pl.actors


def test_nothing_outlives_its_plotter(scenes, see, bean):
    pl, things = beans(scenes, bean)
    see.grab(pl)
    refs = [weakref.ref(things), weakref.ref(things.groups[0]), weakref.ref(pl)]
    pl.close()
    pl.deep_clean()
    del pl, things
    gc.collect()
    assert [r() for r in refs] == [None] * 3


def test_two_plotters_at_once(scenes, see, bean):
    """The same parts and poses: what one does is not seen in the other."""
    poses = crowd()
    one, things = beans(scenes, bean, poses)
    other, _ = beans(scenes, bean, poses)
    shown = see.grab(one)
    np.testing.assert_array_equal(see.grab(other), shown)
    things.visible = np.arange(24) < 5
    assert off(see.grab(one), shown) > 0.01
    np.testing.assert_array_equal(see.grab(other), shown)
    one.close()
    np.testing.assert_array_equal(see.grab(other), shown)


def test_new_poses(scenes, see, bean):
    pl, things = beans(scenes, bean)
    shown = see.grab(pl)
    things.poses = crowd(seed=6)
    moved = see.grab(pl)
    assert off(moved, shown) > 0.01
    np.testing.assert_allclose(
        moved, see.grab(beans(scenes, bean, crowd(seed=6))[0]), atol=2 / 255
    )
    with pytest.raises(ValueError, match=r'finite|NaN'):
        things.poses = crowd() * np.nan
    np.testing.assert_array_equal(see.grab(pl), moved)


def test_scalar_bar(scenes, bean):
    options = {'scalars': np.arange(24.0), 'clim': [2, 20], 'scalar_bar_args': {'title': 'growth'}}
    pl, things = beans(scenes, bean, show_scalar_bar=True, **options)
    assert list(pl.scalar_bars.keys()) == ['growth']
    assert things.table.scalar_range == (2, 20)
    bar = pl.scalar_bars['growth']
    assert tuple(bar.GetLookupTable().GetTableRange()) == (2, 20)
    pl, _ = beans(scenes, bean, scalars='height', show_scalar_bar=True, color=None)
    assert list(pl.scalar_bars.keys()) == ['height']
    pl, _ = beans(scenes, bean, show_scalar_bar=True)
    assert not list(pl.scalar_bars.keys())


def test_several_meshes_by_index(scenes, see, bean):
    cube = pv.Cube().triangulate()
    index = np.arange(24) % 2
    pl, things = beans(scenes, [bean, cube], index=index)
    drawn = see.grab(pl)
    truth = plain(scenes, bean, crowd()[index == 0])
    for matrix in crowd()[index == 1]:
        truth.add_mesh(cube, color='tan').user_matrix = matrix
    see.place(truth, **CAMERA)
    assert off(drawn, see.grab(truth)) < 0.015
    assert len(things.atlases) == 2


def interrupted(*_args, **_kwargs):
    raise KeyboardInterrupt


@pytest.mark.parametrize('level', ['mesh', 'parallax'])
def test_mirrored_poses_are_not_culled_inside_out(scenes, see, level, monkeypatch):
    for name, value in (('views', 16), ('tile', 128)):  # also of what is baked after an update
        monkeypatch.setitem(make_model.__kwdefaults__, name, value)
    bowl = pv.Sphere(theta_resolution=12, phi_resolution=12, end_phi=120)
    poses = np.diag([-1.0, 1, 1, 1])[None]
    options = {'level': level, 'camera': CAMERA, 'size': SIZE}
    truth = see.grab(scenes.instances(bowl, poses, culling='none', **options)[0])
    pl, things = scenes.instances(bowl, poses, culling='front', **options)
    assert off(see.grab(pl), truth) == 0
    things.poses = [[0, 0, 0]]
    assert off(culled := see.grab(pl), truth) > 0.003
    things.poses = np.eye(4)
    before = things.poses
    with monkeypatch.context() as patch:
        patch.setattr('pvibr.instances.mesh_models.make_model', interrupted)
        with pytest.raises(KeyboardInterrupt):
            things.update([0], poses=poses)
    np.testing.assert_array_equal(things.poses, before)
    assert off(see.grab(pl), culled) == 0
    things.update([0], poses=poses)
    assert off(see.grab(pl), truth) == 0


def test_scene_of_trimesh(scenes, see):
    box = trimesh.creation.box()
    box.visual.face_colors = [200, 30, 30, 255]
    scene = trimesh.Scene({'box': box})
    for k in range(3):
        matrix = np.eye(4)
        matrix[:3, 3] = [0, 1.7 * k, 0.4 * k]
        scene.graph.update(f'n{k}', matrix=matrix, geometry='box')
    pl, things = scenes.instances(scene, None, camera=CAMERA, size=SIZE)
    red = see.grab(pl)
    assert len(things) >= 3
    assert (red[..., 0] - red[..., 1] > 0.3).mean() > 0.01


# ---------------------------------------------------------------- costs


@pytest.fixture
def uploads(monkeypatch):
    """Count what goes to the GPU."""
    counted = []
    upload = Texture.upload

    def count(self, array):
        counted.append(np.shape(array))
        return upload(self, array)

    monkeypatch.setattr(Texture, 'upload', count)
    return counted


def test_a_still_camera_uploads_nothing(scenes, see, bean, uploads):
    pl, things = beans(scenes, bean)
    see.grab(pl)
    assert uploads
    uploads.clear()
    see.grab(pl)
    see.grab(pl)
    assert uploads == []
    things.max_error = 2.0
    see.grab(pl)
    uploads.clear()
    see.place(pl, **(CAMERA | {'eye': (8.9, -7, 5)}))
    see.grab(pl)
    assert sum(np.prod(s) * 4 for s in uploads) < 100_000


def test_out_of_view_draws_nothing(scenes, see, bean):
    pl, _ = beans(scenes, bean)
    see.grab(pl)
    away = {'eye': CAMERA['eye'], 'focus': np.multiply(CAMERA['eye'], 2)}
    see.place(pl, **away)
    picture = see.grab(pl)
    assert np.ptp(picture) == 0
    details = pl.ibr.report().rows[0].details
    counts = {k: v for k, v in details.items() if isinstance(v, int)}
    assert sum(v for k, v in counts.items() if k not in ('instances', 'of blocks')) == 0
    shown = [a.GetMapper().GetInput() for a in pl.renderer.GetViewProps() if a.GetVisibility()]
    drawn = [mesh for mesh in shown if mesh.GetNumberOfCells() > 1]
    assert drawn == []
    see.place(pl, **CAMERA)
    np.testing.assert_array_equal(see.grab(pl), see.grab(beans(scenes, bean)[0]))


@pytest.mark.parametrize('poses', [np.zeros((0, 3)), np.zeros((0, 4, 4)), []])
def test_none(scenes, see, bean, poses):
    pl, things = scenes.instances(bean, poses, size=SIZE, color='tan')
    assert np.ptp(see.grab(pl)) == 0
    assert len(things) == 0
    assert pl.ibr.report().rows[0].why == 'no instances'
    assert things.pick(5, 5) is None
    pl.reset_camera()
    things.colors = np.zeros((0, 3))
    things.visible = True


def test_one(scenes, see, bean):
    pl, things = beans(scenes, bean, [0.0, 0.0, 0.0])
    assert len(things) == 1
    assert off(see.grab(pl), see.grab(plain(scenes, bean, [[0, 0, 0]]))) < 0.003


# ---------------------------------------------------------------- bad input

SINGULAR = np.tile(np.diag([1.0, 1, 0, 1]), (2, 1, 1))
BAD = {
    'level': ({'force_level': 'nearest'}, ValueError, 'force_level.*blended, fine, mesh.*nearest'),
    'sizes': ({'force_level': {'flat': (9.0, 3.0)}}, ValueError, r'force_level.*flat.*\(9'),
    'nan': ({'poses': [[0, 0, np.nan], [0, 0, 0]]}, ValueError, r'poses.*(NaN|finite)'),
    'infinite': ({'poses': [[0, 0, np.inf], [0, 0, 0]]}, ValueError, 'poses.*finite'),
    'singular': ({'poses': SINGULAR}, ValueError, 'inverse'),
    'shape': ({'poses': np.zeros((2, 5))}, ValueError, r'\(2, 5\)'),
    'text': ({'poses': [['a', 'b', 'c']]}, (TypeError, ValueError), 'poses'),
    'no poses': ({'poses': None}, TypeError, 'poses must be'),
    'empty mesh': ({'mesh': pv.PolyData()}, ValueError, 'must have points'),
    'no mesh': ({'mesh': 3}, TypeError, 'mesh must be'),
    'list': ({'mesh': []}, ValueError, 'at least one mesh'),
    'no file': ({'mesh': 'nowhere.ply'}, FileNotFoundError, r'nowhere\.ply'),
    'scalars': ({'scalars': [1.0]}, ValueError, r'scalars must be \(2,\).* got shape \(1,\)'),
    'no array': ({'scalars': 'nowhere'}, (KeyError, ValueError), 'nowhere'),
    'cmap': ({'scalars': [1.0, 2], 'cmap': 'nocolors'}, ValueError, 'nocolors'),
    'cmap of the mesh': ({'scalars': 'height', 'cmap': 'nocolors'}, ValueError, 'nocolors'),
    'clim': ({'scalars': [1.0, 2], 'clim': [2, 1]}, ValueError, 'clim'),
    'colors': ({'colors': [[1.0, 0, 0]]}, ValueError, r'colors.*\(2, 3\)'),
    'zero error': ({'max_error': 0}, ValueError, 'max_error'),
    'negative error': ({'max_error': -1.0}, ValueError, 'max_error'),
    'nan error': ({'max_error': np.nan}, ValueError, 'max_error'),
    'error of text': ({'max_error': 'small'}, TypeError, 'max_error'),
    'index': ({'index': [0, 1]}, ValueError, r'index\[1\] must be 0 to 0.*got 1'),
    'negative index': ({'index': [-1, 0]}, ValueError, r'index\[0\] must be .*got -1'),
    'length of index': ({'index': [0]}, ValueError, r'index must be .*got shape \(1,\)'),
    'index of floats': ({'index': [0.0, 0.0]}, ValueError, 'integers'),
    'blend': ({'blend': 'add'}, ValueError, 'blend'),
    'views': ({'views': 'some'}, ValueError, 'views'),
    'opacity': ({'opacity': 'nothing'}, ValueError, 'nothing'),
    'no transfer function': ({'opacity': ''}, ValueError, "opacity = ''"),
    'opacity of nan': ({'opacity': [np.nan] * 5}, TypeError, 'opacity = '),
    'no opacity': ({'opacity': []}, ValueError, 'opacity = '),
    'opacity of many axes': ({'opacity': np.zeros((2, 2, 2))}, TypeError, 'opacity = '),
    'name of scalars': ({'scalars': ''}, ValueError, "scalars = '': must be an array of the mesh"),
    'back': ({'backface_params': {'x': 1}}, TypeError, 'backface_params = '),
    'empty texture': ({'texture': np.zeros(0)}, TypeError, 'texture = '),
    'texture of nan': ({'texture': np.full((5, 3), np.nan)}, TypeError, 'texture = '),
    'texture of nothing': ({'texture': np.array([None] * 5)}, TypeError, 'texture = '),
    'column': ({'poses': {'x': 1}}, ValueError, "poses = .*column 'x'"),
    'columns': ({'poses': np.zeros(5, [('a', float)])}, ValueError, "poses = .*column 'x'"),
    'cache': ({'cache': 3.5}, TypeError, 'cache must be True or False, got 3.5'),
    'theme': ({'theme': 'nowhere'}, FileNotFoundError, 'theme = .nowhere'),
    'dates': ({'scale': np.datetime64('NaT', 's')}, TypeError, 'scale must be numbers'),
    'masked': ({'scale': np.ma.masked_all(2)}, TypeError, 'scale must be numbers'),
    'records': ({'scale': np.zeros(2, [('a', float)])}, TypeError, 'scale must be numbers'),
    'unknown': ({'colour': 'red'}, TypeError, 'colour'),
}


@pytest.mark.parametrize(('given', 'kind', 'words'), BAD.values(), ids=BAD)
def test_bad_input_adds_nothing(scenes, bean, given, kind, words, monkeypatch):
    def bake(*_args, **_kwargs):
        raise AssertionError('baked before all was checked')

    monkeypatch.setattr('pvibr.instances.levels.bake_parts', bake)
    pl = scenes.empty()
    pl.add_mesh(pv.Cube(), name='cube')
    arguments = {'mesh': bean, 'poses': [[0, 0, 0], [1, 0, 0]], 'cache': False} | given
    with pytest.raises(kind, match=words):
        pl.ibr.add_instances(**arguments)
    assert list(pl.actors) == ['cube']
    assert pl.ibr.effects == ()
    assert not list(pl.scalar_bars.keys())


UPDATES = {
    'index': ({'ids': [24], 'visible': False}, IndexError, '24'),
    'colors': ({'ids': [0, 1], 'colors': [[1.0, 0, 0]] * 3}, ValueError, 'colors|shape'),
    'scalars': ({'ids': [0, 1], 'scalars': [1.0, 2, 3]}, ValueError, 'shape|broadcast'),
    'text': ({'ids': [0], 'scalars': 'a'}, ValueError, 'got <U1'),
}


@pytest.mark.parametrize(('given', 'kind', 'words'), UPDATES.values(), ids=UPDATES)
def test_bad_updates_change_nothing(scenes, see, bean, given, kind, words):
    pl, things = beans(scenes, bean, scalars=np.arange(24.0))
    shown = see.grab(pl)
    with pytest.raises(kind, match=words):
        things.update(**given)
    np.testing.assert_array_equal(things.scalars, np.arange(24.0))
    np.testing.assert_array_equal(see.grab(pl), shown)


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('colors', np.zeros((3, 3))),
        ('scalars', np.zeros(3)),
        ('visible', np.full(24, 2.0)),
        ('phase', []),
        pytest.param('visible', np.zeros(3, bool), id='visible-shape'),
        ('max_error', 0.0),
    ],
)
def test_bad_settings_change_nothing(scenes, see, bean, name, value):
    pl, things = beans(scenes, bean)
    shown = see.grab(pl)
    with pytest.raises(ValueError, match=name):
        setattr(things, name, value)
    np.testing.assert_array_equal(see.grab(pl), shown)


SHADERS = 'gl.feature.Feature.landed', 'things.shader_draws.ShaderDraws._set_shader'
FAILURES = {
    'both did not land': (SHADERS[0], 'drawn (as|by) .* instead'),
    'meshes did not land': (SHADERS[0], 'actor'),
    'meshes did not compile': (SHADERS[1], 'actor'),
    'cards did not compile': (SHADERS[1], 'drawn (as|by) .* instead'),
}


@pytest.mark.parametrize(('where', 'match'), FAILURES.values(), ids=FAILURES)
def test_a_shader_that_fails_leaves_the_meshes(scenes, see, bean, monkeypatch, where, match):
    """A driver that does not take the cards: one warning, and the meshes are there."""
    level = 'mesh' if match == 'actor' else None
    beans(scenes, bean, level=level)  # images are baked with shaders that work
    monkeypatch.setattr(f'pvibr.{where}', lambda *_: False)
    pl, _ = beans(scenes, bean, level=level)
    with pytest.warns(pvibr.PvibrWarning, match=match):
        [see.grab(pl) for _ in range(3)]
    truth = see.grab(plain(scenes, bean))
    assert off(see.grab(pl), truth) < 0.01


def test_near_meshes_are_drawn_without_any_light():
    pl = pv.Plotter(lighting='none', window_size=(60, 40))
    pl.ibr.add_instances(pv.Sphere(), [[0, 0, 0]], cache=False, color='red')
    pl.camera_position = [(0, -2, 0), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    assert pl.screenshot(return_img=True)[20, 30].tolist() == [255, 0, 0]
    pl.close()
