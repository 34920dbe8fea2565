"""Layers against the actors that they stand for."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

import pvibr
from tests.pictures import depth_buffer, read
from tests.refusals import refused
from tests.substitutes.twins import Twins, displaced

pytestmark = pytest.mark.sampled

TORUS = pv.ParametricTorus(u_res=60, v_res=30)
BALL = pv.Sphere(theta_resolution=60, phi_resolution=30)
SIZE = (320, 200)


def grab(pl):
    pl.renderer.ResetCameraClippingRange()
    pl.render_window.Render()
    return read(pl.render_window)


def kinds(picture):
    """Return which object is seen: by its hue."""
    r, g, b = np.moveaxis(picture, -1, 0)
    return (r > g + 30) * 1 + (g > b + 20) * 2 + (b > r + 20) * 4


class Scene(Twins):
    """The same actors twice: as they are, and in layers."""

    picture, kinds = staticmethod(grab), staticmethod(kinds)

    def __init__(
        self, *, offset=0.0, parallel=False, size=SIZE, samples=0, setup=None, **settings
    ):
        self.plotters, self.actors = [], []
        self.offset = offset
        for _ in range(2):
            light = pv.Light(position=(3, -5, 9), light_type='scene light', intensity=0.8)
            pl = pv.Plotter(off_screen=True, window_size=size, lighting='none')
            pl.add_light(light)
            pl.ren_win.SetMultiSamples(samples)
            looks = {'smooth_shading': True, 'reset_camera': False}
            made = [
                pl.add_mesh(pv.Plane(i_size=30, j_size=30), color='lightblue', reset_camera=False),
                pl.add_mesh(BALL, color='tomato', **looks),
                pl.add_mesh(TORUS, color='gold', **looks),
                pl.add_mesh(BALL, color='seagreen', **looks),
            ]
            places = (0, 0, -0.6), (-1.2, -3, 0), (0.5, 1, 0), (2, 6, 0.5)
            for actor, place in zip(made, places, strict=True):
                actor.position = np.add(place, offset)
            pl.camera_position = [
                np.add((0, -12, 4), offset),
                np.add((0, 0, 0.5), offset),
                (0, 0, 1),
            ]
            pl.camera.parallel_projection = parallel
            pl.camera.parallel_scale = 3.5
            if setup is not None:
                setup(pl)
            self.plotters.append(pl)
            self.actors.append(made)
            pl.show(auto_close=False)
        settings.setdefault('only_if_faster', False)
        self.layers = self.standin = self.plotters[1].ibr.add_image_layers(
            self.groups(), **settings
        )

    def groups(self):
        ground, *others = self.actors[1]
        return [others[0], others[1:], ground]

    def each(self, change):
        for pl, made in zip(self.plotters, self.actors, strict=True):
            change(pl, made)

    def yaw(self, degrees):
        self.each(lambda pl, _: pl.camera.Yaw(degrees))

    def step(self, *move):
        def go(pl, _):
            pl.camera.position = np.add(pl.camera.position, move)
            pl.camera.focal_point = np.add(pl.camera.focal_point, move)

        self.each(go)

    def told(self, key):
        report = self.layers.report()
        return [report[f'layer {k}'][key] for k in range(len(self.layers))]


@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize('parallel', [False, True])
def test_a_picture_that_was_just_taken_is_the_scene_itself(offset, parallel):
    scene = Scene(offset=offset, parallel=parallel)
    plain, drawn = scene.pictures()
    assert np.abs(plain - drawn).max() <= 8
    assert np.abs(plain - drawn).mean() < 0.05
    deep = [depth_buffer(pl) for pl in scene.plotters]
    assert np.abs(deep[0] - deep[1]).max() < 1e-4
    assert scene.told('state') == ['taken'] * 3


@pytest.mark.parametrize('warp', ['affine', 'projective'])
@pytest.mark.parametrize('parallel', [False, True])
def test_outlines_and_intersections_stay_within_the_error(warp, parallel):
    scene = Scene(warp=warp, parallel=parallel)
    scene.pictures()
    for k in range(8):
        if k % 2:
            scene.yaw(0.3)
        scene.step(0.02, 0.03, 0.01)
        plain, drawn = scene.pictures()
        assert scene.layers.report()['residual_px'] <= 1
        assert displaced(plain, drawn, kinds) <= 2
        assert np.abs(plain - drawn).mean() < 1.5
    assert scene.layers.report()['taken'] < 3 * 9


def test_the_nearest_layer_is_taken_most_often():
    scene = Scene()
    scene.pictures()
    for _ in range(12):
        scene.step(0.01, 0, 0)
        scene.pictures()
    near, far, _ = scene.told('rate')
    assert near >= far
    assert far < 0.5


def test_a_pan_of_projective_warps_takes_none_until_the_overscan_ends():
    scene = Scene(warp='projective')
    scene.pictures()
    before = scene.layers.report()['taken']
    for _ in range(5):
        scene.yaw(0.4)
        scene.check(shift=1.5)
    assert scene.layers.report()['taken'] == before
    scene.yaw(9)
    scene.check(shift=1.5)
    assert 'visibility' in scene.told('taken for')[2]


def test_a_larger_error_takes_fewer():
    taken = []
    for max_error in (0.25, 4.0):
        scene = Scene(max_error=max_error)
        for _ in range(8):
            scene.step(0.05, 0, 0)
            scene.pictures()
        taken.append(scene.layers.report()['taken'])
        pv.close_all()
    assert taken[1] < taken[0] / 2


def test_while_the_camera_stands_still_nothing_is_taken():
    scene = Scene()
    scene.pictures()
    props = scene.plotters[1].renderer.GetViewProps()
    before = scene.layers.report()['taken'], props.GetMTime()
    for _ in range(3):
        scene.pictures()
    assert (scene.layers.report()['taken'], props.GetMTime()) == before


def test_zooming_in_takes_pictures_with_finer_texels():
    scene = Scene(warp='projective')
    scene.pictures()
    scene.each(lambda pl, _: pl.camera.Zoom(2.0))
    scene.check(shift=1.5)
    assert scene.told('taken for')[1].get('resolution')


def test_light_that_turns_takes_pictures_again():
    scene = Scene()
    scene.pictures()
    before = scene.layers.report()['taken']

    def turn(pl, _):
        pl.renderer.GetLights().GetItemAsObject(0).SetPosition(3, 5, 9)

    scene.each(turn)
    scene.check(mean=0.05)
    assert scene.layers.report()['taken'] == before + 3
    assert scene.told('taken for')[0]['light'] == 1
    scene.each(lambda pl, _: pl.renderer.GetLights().GetItemAsObject(0).SetIntensity(0.3))
    scene.check(mean=0.05)


def test_actors_that_change_move_or_vanish_are_seen_to():
    scene = Scene()
    scene.pictures()

    def change(_, made):
        made[1].prop.color = 'red'
        made[3].mapper.dataset.points[:, 2] *= 0.5
        made[3].mapper.dataset.Modified()

    scene.each(change)
    scene.check(mean=0.05)
    assert [t.get('changed', 0) for t in scene.told('taken for')] == [1, 1, 0]

    def leave(pl, made):
        made[2].visibility = False
        made[1].mapper.SetInputData(pv.PolyData())

    scene.each(leave)
    scene.check(mean=0.05)
    assert scene.told('state')[0] == 'empty'
    scene.each(lambda _, made: setattr(made[2], 'visibility', True))
    scene.each(lambda pl, made: pl.remove_actor(made[3]))
    scene.check(mean=0.05)
    assert len(scene.layers.actors()) == 3


def test_an_actor_that_moves_as_a_whole_is_warped_and_not_taken():
    scene = Scene(warp='projective')
    scene.pictures()
    before = scene.layers.report()['taken']

    def move(_, made):
        made[1].position = np.add(made[1].position, (0.03, 0, 0.02))

    for _ in range(4):
        scene.each(move)
        scene.check(shift=1.5)
    assert scene.layers.report()['taken'] == before
    scene.each(lambda _, made: setattr(made[2], 'position', (0.5, 1, 0.4)))  # one of its layer
    scene.check(mean=1.0)
    assert scene.told('taken for')[1]['changed'] == 1


def test_what_was_behind_the_eye_comes_into_view():
    scene = Scene()
    for made in scene.actors:
        made[1].position = (0, -20, 1)
    scene.pictures()
    for _ in range(6):
        scene.yaw(30)
        scene.check(mean=0.1)


def test_a_walk_through_the_scene_is_right_at_every_step():
    scene = Scene()
    for _ in range(12):
        scene.step(0.1, 1.3, -0.1)
        scene.check(mean=1.5, shift=2, share=95)


def test_by_depth_all_actors_are_in_layers_those_that_come_later_too():
    scene = Scene()
    scene.layers.remove()
    pl = scene.plotters[1]
    layers = pl.ibr.add_image_layers(count=3, only_if_faster=False)
    scene.check(mean=0.05)
    assert 2 <= len(layers) <= 4
    assert len(layers.actors()) == 4

    def add(pl, made):
        made.append(pl.add_mesh(TORUS, color='gold', reset_camera=False))
        made[-1].position = (-3, 4, 0)

    scene.each(add)
    scene.check(mean=0.05)
    assert len(layers.actors()) == 5
    for _ in range(4):
        scene.step(0, 1.0, 0)
        scene.check(mean=1.5)
    scene.each(lambda pl, made: [pl.remove_actor(a) for a in made])
    plain, drawn = scene.pictures()
    assert np.array_equal(plain, drawn)
    assert len(layers) == 0


def test_translucent_props_and_volumes_beside_and_within():
    def setup(pl):
        glass = pl.add_mesh(BALL, opacity=0.5, color='white', reset_camera=False)
        glass.position, glass.scale = (0.4, -1, 0.2), (2, 2, 2)
        grid = pv.ImageData(dimensions=(20, 20, 20), spacing=(0.1,) * 3, origin=(-3, 2, 0))
        grid['density'] = np.linalg.norm(grid.points - np.array(grid.center), axis=1)
        pl.add_volume(grid, opacity=[0.6, 0.1, 0], show_scalar_bar=False, reset_camera=False)

    scene = Scene(setup=setup)
    scene.check(mean=0.2)
    for made in scene.actors:
        made[2].prop.opacity = 0.4
    scene.check(mean=0.2)
    assert scene.told('as VTK draws it')[1] == {'translucent': 1}


PASSES = {
    'peeling': lambda pl: pl.enable_depth_peeling(),
    'edl': lambda pl: pl.enable_eye_dome_lighting(),
    'ssao': lambda pl: pl.enable_ssao(radius=0.5, kernel_size=32),
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
}


@pytest.mark.parametrize('name', PASSES)
def test_other_passes_see_layers_as_surfaces(name):
    scene = Scene(setup=PASSES[name])
    bounds = {'ssao': 2.0, 'ssaa': 1.0, 'edl': 0.3}  # normals in layers are those of depth
    plain, drawn = scene.pictures()
    assert np.abs(plain - drawn).mean() < bounds.get(name, 0.05)
    scene.yaw(0.1)
    plain, drawn = scene.pictures()
    assert np.abs(plain - drawn).mean() < bounds.get(name, 0.05) + 0.3
    assert scene.told('state') == ['warped'] * 3


def test_smooth_windows_have_layers_with_smooth_edges():
    scene = Scene(samples=4)
    plain, drawn = scene.pictures()
    assert scene.told('texels')[0][0] > 1.2 * Scene().told('texels')[0][0]
    assert np.abs(plain - drawn).mean() < 1.0


def test_shadows_projectors_and_outlines_are_those_of_the_actors():
    def setup(pl):
        pl.ibr.add(pvibr.Shadows())
        pl.ibr.add(pvibr.Outline())

    scene = Scene(setup=setup)
    scene.check(mean=1.0)
    before = scene.layers.report()['taken']
    scene.pictures()
    assert scene.layers.report()['taken'] == before
    for made in scene.actors:
        made[3].position = (0.5, 3, 3)
    scene.check(mean=1.0)  # its shadow falls on another layer
    ids = [pl.ibr.buffer('depth') for pl in scene.plotters]
    near = np.isfinite(ids[0]) & np.isfinite(ids[1])
    assert np.median(np.abs(ids[0][near] - ids[1][near])) < 1e-3


def test_instances_beside_have_their_soft_edges_before_layers(bean, atlases):
    places = [(0, -4, 0), (2, 0, 0.2), (-2, 3, 0.1)]

    def setup(pl):
        pl.ibr.add_instances(bean, places, color='purple', cache=atlases, bake=True)

    scene = Scene(setup=setup)
    scene.check(mean=0.05)


def fringe(plain, drawn):
    """Return how far colours are beyond those around each pixel of what is drawn in full."""
    low, high = minimum_filter(plain, (3, 3, 1)), maximum_filter(plain, (3, 3, 1))
    return np.maximum(low - drawn, drawn - high)


@pytest.mark.parametrize('blur', [None, 4.0], ids=['in no layer', 'blurred'])
def test_soft_edges_are_before_the_ground_that_is_behind_them(blur):
    scene = Scene(samples=4)
    if blur is None:
        scene.plotters[1].ibr.remove(scene.layers)
        near, *others = scene.actors[1][1:]
        scene.layers = scene.plotters[1].ibr.add_image_layers([near, others], only_if_faster=False)
    else:
        scene.layers.blur = (0, 0, blur)
    plain, drawn = scene.pictures()
    horizon = np.flatnonzero((kinds(plain) == 4)[:, 0])[0]
    assert fringe(plain, drawn)[horizon + 16 :].max() < 45


def test_impostors_beside_intersect_layers():
    def setup(pl):
        heavy = pl.add_mesh(BALL, color='red', smooth_shading=True, reset_camera=False)
        heavy.position = (0.5, 0.4, 0)
        pl.ibr.add_impostor(heavy, only_if_faster=False)

    scene = Scene(setup=setup)
    scene.check(shift=1.5)
    scene.yaw(0.2)
    scene.check(shift=2)
    scene.plotters[1].ibr.add_impostor(
        scene.actors[1][2], only_if_faster=False
    )  # leaves its layer
    scene.check(shift=2)
    assert len(scene.layers.actors()) == 3


def test_a_blurred_layer_is_soft_and_the_others_are_sharp():
    scene = Scene(blur=(0, 0, 0))
    _, sharp = scene.pictures()
    scene.layers.blur = (3.0, 0, 0)
    _, soft = scene.pictures()
    ball = kinds(sharp) == 1
    away = distance_transform_edt(~ball)
    assert np.abs(sharp - soft)[(away > 0) & (away < 3)].mean() > 5
    assert np.abs(sharp - soft)[away > 14].max() <= 8
    # What leaves the ball is beside it, but for what the ground hides.
    assert sharp[away < 12].mean() == pytest.approx(soft[away < 12].mean(), abs=8)
    steps = np.abs(np.diff(soft, axis=1))[(away < 14)[:, 1:]]  # no edge is left, nor noise
    assert steps.max() < 60
    scene.layers.blur = 40.0
    _, flat = scene.pictures()
    assert np.isfinite(flat).all()
    scene.layers.blur = ()
    _, again = scene.pictures()
    assert np.array_equal(again, sharp)


def test_coarse_layers_have_few_texels():
    scene = Scene(resolution=(1.0, 0.5))
    scene.pictures()
    fine = Scene()
    fine.pictures()
    assert scene.told('texels')[0] == fine.told('texels')[0]
    assert scene.told('texels')[2][0] <= 0.51 * fine.told('texels')[2][0]


def test_little_memory_is_kept():
    scene = Scene(memory=2**19)
    plain, drawn = scene.pictures()
    assert scene.layers.report()['bytes'] < 2**19
    assert np.abs(plain - drawn).mean() < 3
    assert displaced(plain, drawn, kinds, 90) <= 3


def test_a_budget_takes_the_worst_first_and_the_rest_later():
    scene = Scene(budget_ms=0.0)
    counts = []
    for _ in range(5):
        plain, drawn = scene.pictures()
        counts.append(scene.layers.report()['taken'])
        assert np.abs(plain - drawn).mean() < 0.05
    assert np.diff(counts).max() <= 1
    assert counts[-1] == 3


def test_layers_that_are_no_cheaper_are_left_to_vtk():
    scene = Scene(only_if_faster=True)
    states = set()
    for k in range(8):
        scene.yaw(15 * (-1) ** k)
        scene.check(mean=1.0)
        states |= set(scene.told('state'))
    assert 'left to VTK' in states
    assert all(rate < 1 for rate in scene.told('rate'))


def test_windows_that_shrink_to_a_pixel_and_grow_again():
    scene = Scene()
    for size in ((200, 300), (1, 1), (1, 200), SIZE):
        for pl in scene.plotters:
            pl.window_size = size
        scene.check(mean=1.0)
    large = [pl.screenshot(None, return_img=True, scale=2).astype(int) for pl in scene.plotters]
    assert np.array_equal(*large)
    plain, drawn = scene.pictures()
    assert np.abs(plain - drawn).max() <= 8


def test_subplots_and_two_plotters_have_their_own():
    scenes = Scene(), Scene(warp='projective')
    for scene in (*scenes, scenes[0]):
        scene.yaw(0.2)
        assert displaced(*scene.pictures(), kinds) <= 2
    pl = pv.Plotter(off_screen=True, window_size=(400, 150), shape=(1, 2))
    for k in range(2):
        pl.subplot(0, k)
        actor = pl.add_mesh(TORUS, color='gold', smooth_shading=True)
        if k:
            pl.ibr.add_image_layers([actor], only_if_faster=False)
    pl.show(auto_close=False)
    picture = grab(pl)
    assert np.abs(picture[5:-5, 5:195] - picture[5:-5, 205:-5]).mean() < 0.2
    assert picture[:, 200:].std() > 10


def test_bad_input_changes_nothing():
    pl = pv.Plotter(off_screen=True)
    actor = pl.add_mesh(BALL)
    stranger = pv.Actor(mapper=pv.DataSetMapper(BALL))
    for wrong in ([], [[]], [actor, actor], [actor, [actor]], [stranger]):
        refused('groups', pl.ibr.add_image_layers, wrong)
    for alien in ([[3]], [None], BALL, 'layers'):
        refused('groups must contain actors', pl.ibr.add_image_layers, alien, kind=TypeError)
    for settings in ({'max_error': -1}, {'blur': -1}, {'resolution': 0.0}, {'warp': 'x'}):
        refused(next(iter(settings)), pl.ibr.add_image_layers, [actor], **settings)
    pl.ibr.add_image_layers([actor])
    refused('already replaces', pl.ibr.add_image_layers, [actor])
    assert len(pl.ibr.effects) == 1
    assert not pl.ibr.effects[0].report()['taken']
