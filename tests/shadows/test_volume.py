import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.common.light_scenes import LightScene, measured_lit, place
from benchmarks.common.rays import Rays, edge_band
from pvibr.maths.views import perspective
from pvibr.shadows.volume import safe_before, shadow_rects
from tests.makers import lamp
from tests.pictures import shot, shown

pytestmark = pytest.mark.sampled

EYE = ((1, -7, 5), (0, 0, 0.5), (0, 0, 1))


def floor(size=4.0):
    return pv.Plane(i_size=size, j_size=size, i_resolution=1, j_resolution=1).triangulate()


def ball(**more):
    return pv.Sphere(radius=0.5, theta_resolution=60, phi_resolution=60, **more)


def scene_of(meshes, light, camera=EYE):
    return LightScene('test', meshes, {'it': light}, camera)


def shadows(stage, **more):
    return stage.plotter.ibr.add(pvibr.Shadows(method='volume', **more))


def wrong_pixels(scene, window=(150, 110), near=None):
    """Return the pixels that differ from rays, and what the effect reports."""
    light = scene.lights['it']
    with scene.stage('it', window) as stage:
        if near is not None:
            stage.plotter.camera.clipping_range = near
        effect = shadows(stage)
        lit, frame, report = measured_lit(stage, effect), stage.frame(), effect.report()
    rays = Rays(scene.meshes)
    seen = rays.surface(frame)
    if near is not None:  # rays know no near plane: what it cuts is not compared
        away = (seen.points - frame.eye) @ -frame.view_from_world[2, :3]
        seen.hit[away < near[0]] = False
    true = rays.lit(seen.points, seen.normals, light)
    facing = seen.facing(light)
    # Beside a terminator the pixel's own facet is not for shadows to decide.
    counts = seen.hit & (facing > 0.01) & ~np.isnan(lit)
    counts &= ~edge_band(true, seen) & ~edge_band((facing > 0) * 1.0)
    assert counts.sum() > 500
    assert (true[counts] == 0).sum() > 5
    return int((np.abs(lit - true)[counts] > 0.5).sum()), report


def sheet():
    """Return an open mesh: half a bowl."""
    return pv.Sphere(radius=0.6, center=(0, 0, 1), end_phi=100, theta_resolution=40)


def fins():
    """Return a mesh in which three sheets meet at an edge."""
    points = [
        (0, 0, 0.3),
        (0, 0, 1.3),
        *((np.cos(a), np.sin(a), z) for a in (0, 2, 4) for z in (0.3, 1.3)),
    ]
    faces = [t for k in (2, 4, 6) for t in ((0, 1, k + 1), (0, k + 1, k))]
    return pv.PolyData.from_regular_faces(np.array(points, float), faces)


@pytest.mark.parametrize(
    'mesh', [ball(center=(0, 0, 1)), pv.Cube(center=(0, 0, 0.5)), sheet(), fins()]
)
@pytest.mark.parametrize(
    'light', [lamp((3, 1, 4)), lamp((0.4, 0.3, 4), cone=40), lamp((-1, -2, 2.5), cone=90)]
)
def test_every_pixel_is_that_of_rays(mesh, light):
    assert wrong_pixels(scene_of([floor(), mesh], light))[0] == 0


@pytest.mark.parametrize('window', [(90, 90), (200, 60), (60, 160)])
@pytest.mark.parametrize(('offset', 'scale'), [(0, 1), (1e6, 1), (1e9, 1), (0, 1e-9), (0, 1e9)])
def test_any_window_place_and_size(window, offset, scale):
    scene = place(scene_of([floor(), ball(center=(0, 0, 1))], lamp((3, 1, 4))), offset, scale)
    assert wrong_pixels(scene, window)[0] == 0


@pytest.mark.parametrize(
    'light',
    [lamp((0, 0, 4)), lamp((0, 0, 4), cone=90), lamp((4, 0, 0.001)), lamp((2, 0, 2))],
)
def test_light_straight_above_and_in_the_plane_of_faces(light):
    meshes = [floor(), pv.Cube(center=(0.3, 0, 1.0), x_length=0.7, y_length=0.7, z_length=0.7)]
    meshes.append(floor(1.0).translate((-1, 0, 0.8)))
    drawn = wrong_pixels(scene_of(meshes, light))[0] if light.position[2] > 0.1 else 0
    assert drawn == 0


def test_a_ball_throws_an_ellipse():
    scene = scene_of(
        [
            floor(),
            pv.Sphere(radius=0.5, center=(0, 0, 1), theta_resolution=200, phi_resolution=200),
        ],
        lamp((3, 0, 4)),
        ((0, 0, 20), (0, 0, 0), (0, 1, 0)),
    )
    with scene.stage('it', (200, 200)) as stage:
        stage.plotter.camera.parallel_projection = True
        stage.plotter.camera.parallel_scale = 2.0
        lit = measured_lit(stage, shadows(stage))
    x, y = np.meshgrid((np.arange(200) + 0.5) / 50 - 2, 2 - (np.arange(200) + 0.5) / 50)
    # The centre falls on x = -0.75, stretched by 5 / 4.
    beyond = ((x + 0.75) * 0.8) ** 2 + y**2 - 0.5**2
    sure = (np.abs(beyond) > 0.02) & (x**2 + y**2 > 0.51**2) & (np.maximum(abs(x), abs(y)) < 1.98)
    assert np.array_equal(lit[sure] > 0.5, beyond[sure] > 0)


INSIDE = ((-1.0, -0.3, 0.6), (-1.1, 0.2, 0.0), (0, 0, 1))


@pytest.mark.parametrize('light', [lamp((3, 0, 4)), lamp((1.5, 0, 3.5), cone=90)])
@pytest.mark.parametrize(
    'mesh', [ball(center=(-0.4, -0.3, 1.4)), pv.Plane(center=(-0.4, -0.3, 1.4)).triangulate()]
)
def test_the_eye_may_be_in_the_shadow(light, mesh):
    found, report = wrong_pixels(scene_of([floor(12.0), mesh], light, INSIDE))
    assert report['depth-fail'] == 1
    assert found == 0


@pytest.mark.parametrize('near', [0.05, 0.3, 0.5, 0.65])
def test_the_near_plane_may_cut_the_shadow(near):
    scene = scene_of([floor(12.0), ball(center=(-0.4, -0.3, 1.4))], lamp((3, 0, 4)), INSIDE)
    assert wrong_pixels(scene, near=(near, 50.0))[0] == 0


def test_depth_over_a_million():
    scene = scene_of([floor(), ball(center=(0, 0, 1))], lamp((3, 1, 4)))
    assert wrong_pixels(scene, near=(1e-3, 1e3))[0] == 0


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('light', [lamp((3, 0, 4)), lamp((1, 0, 4), cone=90), lamp((0, 0.5, -4))])
def test_both_ways_of_counting_give_one_picture(light, parallel, monkeypatch):
    meshes = [
        floor(),
        ball(center=(0, 0, 1)),
        sheet().translate((1, 0.5, 0.3)),
        fins().translate((-1, 1, 0)),
    ]
    pictures = []
    for _ in range(2):
        with scene_of(meshes, light).stage('it', (200, 160)) as stage:
            stage.plotter.camera.parallel_projection = parallel
            stage.plotter.camera.parallel_scale = 2.5
            effect = shadows(stage)
            pictures.append(stage.picture())
            ways = effect.report()
        monkeypatch.setattr(
            'pvibr.shadows.volume.safe_before', lambda v, p, b: np.zeros(len(b), bool)
        )
    assert ways['depth-pass'] == 0
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(-1) > 0.02) < 2e-4


def test_actors_move_turn_shrink_and_mirror_without_a_new_table(monkeypatch):
    tables = []
    whole = pvibr.shadows.volume.edge_table
    monkeypatch.setattr(
        'pvibr.shadows.volume.edge_table', lambda *a: tables.append(1) or whole(*a)
    )
    thing = pv.Cube(x_length=1.0, y_length=0.5, z_length=0.3).triangulate()
    for k in range(4):
        scene = scene_of([floor(), thing], lamp((3, 1, 4)))
        with scene.stage('it', (120, 90)) as stage:
            effect = shadows(stage)
            stage.picture()
            actor = [a for a in stage.plotter.actors.values() if isinstance(a, pv.Actor)][-1]
            matrix = np.eye(4)
            matrix[:3, :3] = [
                np.eye(3),
                np.diag([1, 1, -2]),
                np.diag([1, 0.3, 2]),
                np.diag([1, 1, 0]),
            ][k]
            matrix[:3, 3] = 0.2 * k, 0.1, 1.0
            actor.user_matrix = matrix
            made = len(tables)
            moved = measured_lit(stage, effect)
            assert len(tables) - made == (1 if k == 3 else 0)  # what is flat has another shape
        with scene_of([floor(), thing.transform(matrix, inplace=False)], lamp((3, 1, 4))).stage(
            'it', (120, 90)
        ) as stage:
            fixed = measured_lit(stage, shadows(stage))
        apart = np.abs(np.nan_to_num(moved, nan=0.5) - np.nan_to_num(fixed, nan=0.5)) > 0.3
        assert apart.mean() < 2e-3


def test_nothing_is_drawn_anew_for_nothing():
    scene = scene_of([floor(), ball(center=(0, 0, 1))], lamp((3, 1, 4)))
    with scene.stage('it', (90, 60)) as stage:
        effect = shadows(stage)
        for _ in range(3):
            stage.picture()
        assert effect.report()['masks drawn'] == 1
        stage.look(((1, -7, 4), (0, 0, 0.5), (0, 0, 1)))
        stage.picture()
        assert effect.report()['masks drawn'] == 2
        assert effect.report()['outlines found'] == 2  # one of each caster
        next(iter(stage.renderer.GetLights())).SetPosition(3, 2, 4)
        stage.picture()
        assert effect.report()['outlines found'] == 4


@pytest.mark.parametrize('count', [2, 5])
def test_several_lights_each_have_a_mask(count):
    meshes, alone = [floor(), ball(center=(0, 0, 1))], []
    lights = [lamp((3 * np.cos(a), 3 * np.sin(a), 4)) for a in np.arange(count) * 1.2]
    for light in lights:
        light.intensity = 0.15
        with scene_of(meshes, light).stage('it', (90, 70)) as stage:
            shadows(stage)
            alone.append(stage.picture())
    with scene_of(meshes, lights[0]).stage('it', (90, 70)) as stage:
        for light in lights[1:]:
            stage.plotter.add_light(light)
        effect = shadows(stage)
        both = stage.picture()
        assert effect.report()['lights'] == count
    assert np.abs(both - sum(alone)).max() < (count + 1) / 255


def test_subplots_resize_remove_and_add_leave_no_trace():
    pl = pv.Plotter(
        shape=(1, 2), off_screen=True, window_size=(200, 80), lighting='none', border=False
    )
    for k in range(2):
        pl.subplot(0, k)
        pl.set_background('black')
        pl.add_mesh(floor(), color='white', ambient=0)
        pl.add_mesh(ball(center=(0, 0, 1)), color='white', ambient=0)
        pl.add_light(lamp((3, 1, 4)))
        pl.camera_position = EYE
    plain = shown(pl)
    both = pl.ibr.add(pvibr.Shadows(method='volume'))
    pl.subplot(0, 0)
    first = pl.ibr.add(pvibr.Shadows(method='volume'))
    picture = shot(pl)
    assert np.array_equal(picture[:, :100], picture[:, 100:])
    assert (np.abs(picture.astype(int) - plain).max(-1) > 50).mean() > 0.01
    pl.window_size = 120, 100
    smaller = shot(pl)
    assert np.abs(smaller[:, :60].astype(int) - smaller[:, 60:]).max() < 3
    pl.ibr.remove(first)
    pl.subplot(0, 1)
    pl.ibr.remove(both)
    pl.window_size = 200, 80
    assert np.array_equal(shot(pl), plain)
    pl.ibr.add(both)
    assert np.array_equal(shot(pl)[:, 100:], picture[:, 100:])
    assert not pl.ren_win.GetState().GetEnumState(0x0B90)  # the stencil test


def test_the_method_may_change():
    scene = scene_of([floor(), ball(center=(0, 0, 1))], lamp((3, 1, 4)))
    with scene.stage('it', (90, 70)) as stage:
        effect = shadows(stage)
        volume = stage.picture()
        effect.method = 'pcf'
        assert np.abs(stage.picture() - volume).mean() < 0.01
        assert 'masks drawn' not in effect.report()
        effect.method = 'volume'
        assert np.array_equal(stage.picture(), volume)


def test_finer_passes_read_the_mask_where_it_is():
    scene = scene_of([floor(), ball(center=(0, 0, 1))], lamp((3, 1, 4)))
    with scene.stage('it', (120, 90)) as stage:
        shadows(stage)
        plain = stage.picture()
        stage.plotter.enable_anti_aliasing('ssaa')
        fine = stage.picture()
    assert np.mean(np.abs(plain - fine).max(-1) > 0.25) < 0.03


def test_translucent_things_cast_none_and_show_none():
    meshes = [floor(), ball(center=(0, 0, 1))]
    with scene_of(meshes, lamp((0, 0, 4))).stage('it', (90, 70)) as stage:
        glass = stage.plotter.add_mesh(
            floor(1.5).translate((0, 0, 0.4)), color='white', opacity=0.5
        )
        plain = stage.picture()
        effect = shadows(stage)
        dark = np.abs(stage.picture() - plain).max(-1) > 0.2
        assert effect.report()['casters without volume'] == 1
        glass.visibility = False
        alone = stage.picture()
    assert dark.sum() > 30
    assert alone.mean() > 0.1


def test_what_may_throw_shadows_into_a_view():
    view = perspective([0, 0, 5], [0, 0, -1], 1.0, 1.0, 10.0)
    rng = np.random.default_rng(4)
    middle, half = rng.uniform(-6, 6, (400, 3)), rng.uniform(0.1, 1, (400, 3))
    boxes = np.stack([middle - half, middle + half], -1).reshape(-1, 6)
    scene = np.array([-7, 7, -7, 7, -7, 7.0])
    for light in ((1, 2, 3, 0), (0, 0, 1, 0), (2, -1, 8, 1), (0, 0, 0, 1)):
        light = np.array(light, float)
        rects, safe = (
            shadow_rects(view, light, boxes, scene, (100, 100)),
            safe_before(view, light, boxes),
        )
        inside = rng.uniform(-1, 1, (400, 3)) * half + middle
        away = light[3] * inside - light[:3]
        points = inside + rng.uniform(0, 20, (400, 1)) * away
        clip = np.column_stack([points - view.eye, np.ones(400)]) @ np.diag([1, 1, -1, 1])
        shown = (np.abs(points) < 7).all(1) & (np.abs(clip[:, :2]) < clip[:, 2:3]).all(1)
        pixel = (clip[:, :2] / clip[:, 2:3] + 1) * 50
        low, high = rects[:, :2], rects[:, :2] + rects[:, 2:]
        assert np.all(((pixel >= low) & (pixel <= high))[shown])
        # A way from the near plane to the light meets no safe box.
        near = view.eye + np.column_stack([rng.uniform(-1, 1, (300, 2)), np.full(300, -1.0)])
        share = rng.uniform(0, 1, (300, 30, 1))
        way = light[:3] - light[3] * near
        ways = near[:, None] + share * (way if light[3] else 12 * way)[:, None]
        low, high = boxes[:, ::2], boxes[:, 1::2]
        hit = ((ways[..., None, :] > low) & (ways[..., None, :] < high)).all(-1).any((0, 1))
        assert not np.any(hit & safe)
        assert safe.mean() > 0.3
