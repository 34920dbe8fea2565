"""Shadows lie where closed forms have them, beside everything else that a plotter does."""

import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from pvibr.core.errors import PvibrWarning
from pvibr.gl.feature import replacements
from tests.makers import MATT
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (240, 160)
MAPS = ('hard', 'pcf', 'pcss', 'vsm', 'evsm', 'msm')
KINDS = ('directional', 'spot', 'point')
AT = (0.8, 0.5, 4.0)


def light(kind='directional', at=(0.0, 0.0, 4.0), focus=(0.0, 0.0, 0.0), **options):
    lamp = pv.Light(position=at, focal_point=focus, light_type='scene light', **options)
    lamp.positional = kind != 'directional'
    lamp.cone_angle = {'spot': 40.0, 'point': 90.0}.get(kind, 30.0)
    lamp.exponent = 0.0
    return lamp


class Scene:
    """A disk over a floor, seen from the side; white and matt, so that pixels tell the light."""

    def __init__(self, *lights, size=SIZE, offset=0.0, scale=1.0, plotter=None, height=1.0):
        self.offset, self.scale = np.full(3, offset * scale), scale
        self.pl = plotter or pv.Plotter(off_screen=True, window_size=size, lighting='none')
        self.pl.set_background('black')
        for lamp in lights or (light(),):
            for name in ('position', 'focal_point'):
                setattr(lamp, name, self.placed(getattr(lamp, name)))
            self.pl.add_light(lamp)
        self.floor = self.add(pv.Plane(i_size=6, j_size=6, i_resolution=7, j_resolution=5))
        disk = pv.Disc(center=(0, 0, height), inner=0, outer=0.5, c_res=200)
        self.disk = self.add(disk)
        self.look((0, -7, 5))

    def placed(self, points):
        return np.asarray(points, float) * self.scale + self.offset

    def add(self, mesh, **looks):
        mesh = mesh.copy()
        mesh.points = self.placed(mesh.points)
        return self.pl.add_mesh(mesh, **MATT | looks)

    def look(self, eye, focus=(0, 0, 0)):
        self.pl.camera_position = [self.placed(eye), self.placed(focus), (0, 0, 1)]
        self.pl.reset_camera_clipping_range()

    def draw(self):
        if self.pl.ren_win.GetNeverRendered():
            self.pl.show(auto_close=False)
        self.pl.render()
        return self.pl.screenshot(return_img=True).astype(float)

    def lit(self, effect):
        """Return the drawn part of the light, (h, w); NaN where there is none to lose."""
        effect.enabled = True
        shadowed = self.draw()
        effect.enabled = False
        plain = self.draw()
        effect.enabled = True
        with np.errstate(divide='ignore', invalid='ignore'):
            return np.where(plain[..., 0] > 60, shadowed[..., 0] / plain[..., 0], np.nan)

    def floor_points(self):
        """Return where each pixel's ray meets the floor, (h, w, 2), in units of the scene."""
        width, height = self.pl.window_size
        camera = self.pl.renderer.GetActiveCamera()
        matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
        inverse = np.linalg.inv(
            np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
            @ translation(self.offset)
        )
        y, x = np.mgrid[height - 1 : -1 : -1, 0:width]
        ends = []
        for depth in (-1.0, 1.0):
            ndc = np.stack([(2 * x + 1) / width - 1, (2 * y + 1) / height - 1], -1)
            clip = np.concatenate([ndc, np.full((*x.shape, 1), depth), np.ones((*x.shape, 1))], -1)
            world = clip @ inverse.T
            ends.append(world[..., :3] / world[..., 3:] / self.scale)
        near, far = ends
        t = -near[..., 2] / (far[..., 2] - near[..., 2])
        return (near + t[..., None] * (far - near))[..., :2]

    def sees_floor(self):
        """Return which pixels show the floor and not the disk."""
        shown = [e for e in self.pl.ibr.effects if e.enabled]
        for effect in shown:
            effect.enabled = False
        self.disk.SetVisibility(False)
        bare = self.draw()
        self.disk.SetVisibility(True)
        self.disk.prop.lighting, self.disk.prop.color = False, 'black'
        covered = self.draw()
        self.disk.prop.lighting, self.disk.prop.color = True, 'white'
        for effect in shown:
            effect.enabled = True
        return (bare.sum(-1) > 60) & (covered.sum(-1) > 60)


def translation(offset):
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def shadow_of_disk(points, lamp_at, directional, height=1.0, radius=0.5):
    """Return the distance of floor points to the edge of the disk's shadow; inside below 0."""
    lamp = np.asarray(lamp_at, float)
    if directional:
        center, size = -lamp[:2] * height / lamp[2], radius
    else:
        share = lamp[2] / (lamp[2] - height)
        center, size = lamp[:2] + (0 - lamp[:2]) * share, radius * share
    return np.linalg.norm(points - center, axis=-1) - size


def check(scene, effect, lamp_at, directional, *, edge=0.08, height=1.0):
    lit = scene.lit(effect)
    away = shadow_of_disk(scene.floor_points(), lamp_at, directional, height)
    floor = scene.sees_floor() & np.isfinite(lit)
    dark, bright = floor & (away < -edge), floor & (away > edge)
    assert dark.sum() > 50
    assert bright.sum() > 2000
    assert lit[dark].max() < 0.02
    assert lit[bright].min() > 0.97


THROWS = {
    **{
        m: (AT, {}, {'method': m, 'resolution': 1024, 'angle': 0.01, 'radius': 1e-4}) for m in MAPS
    },
    'square window': ((-0.7, 0.6, 3.5), {'size': (200, 200)}, {}),
    'wide window': ((-0.7, 0.6, 3.5), {'size': (320, 120)}, {}),
    'high window': ((-0.7, 0.6, 3.5), {'size': (100, 300)}, {}),
    'light straight above': ((0.0, 0.0, 4.0), {}, {}),
    'polygon offset': (AT, {}, {'bias': 'polygon_offset'}),
    'far light': ((80.0, 50.0, 400.0), {}, {}),
}


@pytest.mark.parametrize('name', THROWS)
@pytest.mark.parametrize('kind', KINDS)
def test_a_disk_throws_a_disk(name, kind):
    at, options, settings = THROWS[name]
    scene = Scene(light(kind, at), **options)
    check(scene, scene.pl.ibr.add(pvibr.Shadows(**settings)), at, kind == 'directional')


@pytest.mark.parametrize(
    ('offset', 'scale'), [(1e6, 1.0), (1e9, 1.0), (0.0, 1e-9), (0.0, 1e9), (1e6, 1e-3)]
)
@pytest.mark.parametrize('kind', KINDS)
def test_far_away_and_of_any_size(offset, scale, kind):
    scene = Scene(light(kind, AT), offset=offset, scale=scale)
    shadows = scene.pl.ibr.add(pvibr.Shadows(resolution=1024))
    lit = scene.lit(shadows)
    here = Scene(light(kind, AT))
    expected = here.lit(here.pl.ibr.add(pvibr.Shadows(resolution=1024)))
    both = np.isfinite(lit) & np.isfinite(expected)
    assert both.mean() > 0.3
    assert (np.abs(lit - expected)[both] > 0.3).mean() < 0.003


@pytest.mark.parametrize('angle', [80, 84, 87, 89])
@pytest.mark.parametrize('method', ['hard', 'pcf'])
def test_no_acne_at_grazing_angles(angle, method):
    tilt = np.radians(angle)
    scene = Scene(light(at=(4 * np.sin(tilt), 0, 4 * np.cos(tilt)), intensity=60.0))
    scene.disk.SetVisibility(False)
    shadows = scene.pl.ibr.add(pvibr.Shadows(method=method, resolution=512))
    lit = scene.lit(shadows)
    assert np.isfinite(lit).sum() > 5000
    assert np.nanmin(lit) > 0.98


def test_light_in_the_plane_of_the_floor():
    scene = Scene(light(at=(4, 0, 0)))
    scene.pl.ibr.add(pvibr.Shadows())
    assert scene.draw().max() < 5


def test_parallel_projection():
    scene = Scene(light(at=AT))
    scene.pl.enable_parallel_projection()
    check(scene, scene.pl.ibr.add(pvibr.Shadows()), AT, True)


def test_a_deep_scene_is_sharp_near_the_eye():
    at = (0.4, 0.3, 4.0)
    scene = Scene(light(at=at))
    scene.add(pv.Plane(center=(0, 0, -0.5), i_size=600, j_size=600))
    scene.look((0, -3, 2))
    scene.pl.camera.clipping_range = (0.1, 1000)
    shadows = scene.pl.ibr.add(pvibr.Shadows(resolution=512))
    check(scene, shadows, at, True)
    assert shadows.report()['views'] > 1


def test_nothing_is_drawn_again_while_only_the_camera_moves():
    scene = Scene(light(at=(1, 1, 4)), light('spot', (-1, 1, 4)), light('point', (0, -1, 4)))
    shadows = scene.pl.ibr.add(pvibr.Shadows(resolution=1024))
    scene.draw()
    before = shadows.report()['views drawn']
    for k in range(5):
        scene.look((k - 2.0, -7, 5))
        scene.draw()
    assert shadows.report()['views drawn'] == before == 3


def test_what_changes_is_drawn_again():
    lamp = light('spot', AT)
    scene = Scene(lamp)
    shadows = scene.pl.ibr.add(pvibr.Shadows())

    def drawn():
        scene.draw()
        return shadows.report()['views drawn']

    counts = [drawn()]
    lamp.position = (0.5, 0.5, 4.0)
    counts.append(drawn())
    scene.disk.position = (0.1, 0, 0)
    counts.append(drawn())
    scene.disk.mapper.dataset.points += 0.01
    counts.append(drawn())
    scene.disk.SetVisibility(False)
    counts.append(drawn())
    shadows.resolution = 256
    counts.append(drawn())
    assert (np.diff(counts) == 1).all(), counts
    assert drawn() == counts[-1]


def test_several_lights_darken_their_own_share():
    left, right = (-2.0, 0.0, 4.0), (2.0, 0.0, 4.0)
    scene = Scene(light(at=left, intensity=0.4), light(at=right, intensity=0.4))
    lit = scene.lit(scene.pl.ibr.add(pvibr.Shadows()))
    points, floor = scene.floor_points(), scene.sees_floor()
    for at in (left, right):
        inside = floor & (shadow_of_disk(points, at, True) < -0.08)
        assert abs(np.nanmean(lit[inside]) - 0.5) < 0.02


@pytest.mark.parametrize('method', MAPS)
def test_headlights_cast_none_and_it_says_so(method):
    scene = Scene(pv.Light(light_type='headlight'))
    shadows = scene.pl.ibr.add(pvibr.Shadows(method=method, lights='all'))
    plain = scene.draw()
    assert 'headlights' in str(scene.pl.ibr.report())
    scene.pl.ibr.remove(shadows)
    np.testing.assert_array_equal(scene.draw(), plain)


def test_camera_lights_follow_the_camera():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)  # PyVista's light kit
    pl.add_mesh(pv.Plane(i_size=4, j_size=4))
    pl.add_mesh(pv.Sphere(center=(0, 0, 1)))
    pl.camera_position = [(3, -5, 5), (0, 0, 0), (0, 0, 1)]
    shadows = pl.ibr.add(pvibr.Shadows(resolution=128, lights='all'))
    pl.show(auto_close=False)
    before = shadows.report()['views drawn']
    pl.camera.azimuth += 20
    pl.render()
    assert shadows.report()['views drawn'] > before


def test_removed_the_picture_is_as_it_was():
    scene = Scene()
    own = '  // of the user\n//VTK::Light::Impl\n'
    shader = scene.floor.GetShaderProperty()
    shader.AddFragmentShaderReplacement('//VTK::Light::Impl', True, own, False)
    plain = scene.draw()
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    assert np.abs(scene.draw() - plain).max() > 50
    scene.pl.ibr.remove(shadows)
    np.testing.assert_array_equal(scene.draw(), plain)
    assert replacements(shader) == {('Fragment', '//VTK::Light::Impl'): own}
    assert not replacements(scene.disk.GetShaderProperty())
    scene.pl.ibr.add(shadows)
    dark = scene.draw()
    assert np.abs(dark - plain).max() > 50
    shadows.enabled = False
    np.testing.assert_array_equal(scene.draw(), plain)
    shadows.enabled = True
    np.testing.assert_array_equal(scene.draw(), dark)


@pytest.mark.parametrize('choose', ['list', 'function'])
def test_who_casts_and_who_receives(choose):
    scene = Scene()
    plain = scene.draw()
    chosen = [scene.disk] if choose == 'list' else lambda actor: actor is scene.disk
    scene.pl.ibr.add(pvibr.Shadows(casts=chosen))
    dark = scene.draw()
    assert np.abs(dark - plain).max() > 50
    scene.pl.ibr.clear()
    scene.pl.ibr.add(pvibr.Shadows(receives=chosen))
    np.testing.assert_array_equal(scene.draw(), plain)
    for others in ([scene.floor], []):
        scene.pl.ibr.clear()
        scene.pl.ibr.add(pvibr.Shadows(casts=others))
        np.testing.assert_array_equal(scene.draw(), plain)


def test_translucent_casters_tint_the_light():
    scene = Scene(light(at=AT))
    scene.disk.prop.color, scene.disk.prop.opacity = 'red', 0.5
    scene.pl.ibr.add(pvibr.Shadows())
    shadowed = scene.draw()
    away = shadow_of_disk(scene.floor_points(), AT, True)
    scene.disk.SetVisibility(False)
    plain = scene.draw()
    inside = (away < -0.08) & (plain[..., 0] > 60)
    below = inside & (shadowed[..., 1] < shadowed[..., 0] - 20)
    assert below.sum() > 0.6 * inside.sum()
    np.testing.assert_allclose(
        np.median(shadowed[below] / plain[below], 0), [0.5, 0.25, 0.25], atol=0.02
    )


def test_light_behind_glass_alone_does_not_tint_what_is_before_it():
    scene = Scene(light(at=(0.0, 0.0, 4.0)))
    scene.disk.prop.opacity = 0.5
    scene.add(pv.Disc(center=(0, 0, 2), inner=0, outer=0.3, c_res=60))
    scene.pl.ibr.add(pvibr.Shadows())
    scene.look((0, -4, 9), (0, 0, 2))
    assert scene.draw()[SIZE[1] // 2, SIZE[0] // 2, 0] > 250


THIN = {
    'points': (pv.PolyData(np.array([[0.0, 0.0, 1.0]])), {'point_size': 40}),
    'spheres': (
        pv.PolyData(np.array([[0.0, 0.0, 1.0]])),
        {'point_size': 40, 'render_points_as_spheres': True},
    ),
    'gaussian points': (
        pv.PolyData(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])),
        {'style': 'points_gaussian', 'point_size': 300, 'emissive': False},
    ),
    'lines': (pv.Line((-1, 0, 1), (1, 0, 1)), {'line_width': 20}),
    'wireframe': (
        pv.Plane(center=(0, 0, 1), i_size=2, j_size=2, i_resolution=2, j_resolution=2),
        {'style': 'wireframe', 'line_width': 20},
    ),
}


@pytest.mark.parametrize('name', THIN)
def test_points_and_lines_cast(name):
    scene = Scene(light(at=(0.0, 3.0, 4.0)))
    scene.disk.SetVisibility(False)
    mesh, looks = THIN[name]
    thing = scene.add(mesh, **looks)
    shadows = scene.pl.ibr.add(pvibr.Shadows(casts=[thing], receives=[scene.floor]))
    lit = scene.lit(shadows)
    center = np.linalg.norm(scene.floor_points() - [0.0, -0.75], axis=-1) < 0.05
    assert np.nanmax(lit[center]) < 0.6
    assert 20 < np.nansum(lit < 0.5) < 6000


def test_a_sphere_of_a_point_is_half_lit_by_itself():
    scene = Scene(light(at=(4.0, -4.0, 4.0)))
    scene.disk.SetVisibility(False)
    mesh, looks = THIN['spheres']
    scene.add(mesh, **looks)
    lit = scene.lit(scene.pl.ibr.add(pvibr.Shadows()))
    scene.floor.SetVisibility(False)
    ball = scene.draw()[..., 0] > 100
    assert ball.sum() > 300
    assert (lit[ball] > 0.9).mean() > 0.97


def test_surfaces_of_any_kind_receive():
    looks = [
        {'smooth_shading': True},
        {'pbr': True, 'metallic': 0.0, 'roughness': 0.8},
        {'style': 'surface', 'interpolation': 'flat'},
        {'show_edges': True},
        {'scalars': 'z', 'cmap': 'viridis', 'show_scalar_bar': False},
    ]
    for look in looks:
        scene = Scene(light(at=AT))
        scene.floor.SetVisibility(False)
        mesh = pv.Plane(i_size=6, j_size=6, i_resolution=3, j_resolution=3)
        mesh['z'] = np.linspace(0.5, 1, mesh.n_points)
        own = {k: v for k, v in look.items() if k != 'interpolation'}
        scene.floor = scene.add(mesh, **({'color': None} if 'scalars' in look else {}), **own)
        plain = scene.draw()
        shadows = scene.pl.ibr.add(pvibr.Shadows())
        dark = scene.draw()
        inside = scene.sees_floor() & (shadow_of_disk(scene.floor_points(), AT, True) < -0.1)
        assert shadows.enabled
        assert np.median((dark.sum(-1) / np.maximum(plain.sum(-1), 1))[inside]) < 0.5, look
        scene.pl.close()


def test_composites_glyphs_and_volumes_beside():
    scene = Scene(light(at=AT))
    scene.disk.SetVisibility(False)
    disk = pv.Disc(center=(0, 0, 1), inner=0, outer=0.5, c_res=100)
    scene.pl.add_mesh(pv.MultiBlock([disk, pv.Sphere(radius=0.05, center=(2, 2, 0.1))]))
    mapper = _vtk.vtkGlyph3DMapper()
    mapper.SetInputData(pv.PolyData(np.array([[-1.5, -1.0, 0.8]])))
    mapper.SetSourceData(pv.Sphere(radius=0.3))
    glyph = _vtk.vtkActor()
    glyph.SetMapper(mapper)
    scene.pl.renderer.AddActor(glyph)
    grid = pv.ImageData(dimensions=(8, 8, 8), spacing=(0.05,) * 3, origin=(1.5, -1.5, 0.5))
    grid['v'] = np.ones(grid.n_points)
    scene.pl.add_volume(grid, opacity=[0, 0.2], show_scalar_bar=False)
    lit = scene.lit(scene.pl.ibr.add(pvibr.Shadows()))
    points = scene.floor_points()
    for center in ((-0.2, -0.125), (-1.66, -1.1)):
        near = np.linalg.norm(points - center, axis=-1) < 0.1
        assert np.nanmedian(lit[near]) < 0.05, center


@pytest.mark.parametrize(
    'enable',
    ['ssao', 'eye_dome_lighting', 'depth_peeling', 'anti_aliasing ssaa', 'anti_aliasing msaa'],
)
def test_beside_what_plotters_enable(enable):
    scene = Scene(light(at=AT))
    name, *options = enable.split()
    getattr(scene.pl, f'enable_{name}')(*options)
    lit = scene.lit(scene.pl.ibr.add(pvibr.Shadows()))
    inside = scene.sees_floor() & (shadow_of_disk(scene.floor_points(), AT, True) < -0.1)
    assert np.nanmedian(lit[inside]) < 0.05
    assert np.nanmedian(lit) > 0.97


def test_subplots_have_their_own():
    pl = pv.Plotter(
        off_screen=True, window_size=(300, 100), shape=(1, 3), lighting='none', border=False
    )
    scenes = []
    for k in range(3):
        pl.subplot(0, k)
        scenes.append(Scene(light(at=AT), plotter=pl))
    plain = scenes[0].draw()
    pl.subplot(0, 1)
    shadows = pl.ibr.add(pvibr.Shadows())
    changed = (np.abs(scenes[0].draw() - plain).max(-1) > 30).any(0).nonzero()[0]
    assert len(changed)
    assert changed.min() >= 100
    assert changed.max() < 200
    pl.subplot(0, 2)
    pl.ibr.add(pvibr.Shadows(method='msm'))
    assert (np.abs(scenes[0].draw() - plain).max(-1) > 30).any(0).nonzero()[0].max() >= 200
    pl.ibr.remove(shadows)


def test_a_window_may_be_resized():
    scene = Scene(light(at=AT))
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    scene.draw()
    scene.pl.window_size = (300, 120)
    check(scene, shadows, AT, True)


def test_instances_cast_and_receive():
    scene = Scene(light(at=AT))
    scene.disk.SetVisibility(False)
    places = np.array([[0.0, 0, 1], [-1.5, 0, 1], [1.5, -1, 1]])
    balls = scene.pl.ibr.add_instances(
        pv.Sphere(radius=0.4), places, color='white', cache=False, bake=True
    )
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    lit = scene.lit(shadows)
    points = scene.floor_points()
    for x, y, z in places:
        center = np.array([x - 0.2 * z, y - 0.125 * z])
        near = np.linalg.norm(points - center, axis=-1) < 0.1
        assert np.nanmedian(lit[near]) < 0.05
    before = shadows.report()['views drawn']
    scene.look((1, -7, 5))
    scene.draw()
    assert shadows.report()['views drawn'] == before
    balls.visible = np.array([True, False, True])
    lit = scene.lit(shadows)
    assert shadows.report()['views drawn'] == before + 1
    assert (
        np.nanmedian(lit[np.linalg.norm(scene.floor_points() - [-1.7, -0.12], axis=-1) < 0.1])
        > 0.95
    )
    under = scene.add(pv.Disc(center=(0, 0, 2.5), inner=0, outer=3, c_res=50))
    dark = scene.draw()
    under.SetVisibility(False)
    scene.look((0, -7, 5))
    assert dark[..., 0].sum() < scene.draw()[..., 0].sum()


def test_two_plotters_and_close():
    scenes = [Scene(light(at=AT)) for _ in range(2)]
    effects = [s.pl.ibr.add(pvibr.Shadows()) for s in scenes]
    for _ in range(2):
        first, second = (s.draw() for s in scenes)
    np.testing.assert_array_equal(first, second)
    scenes[0].pl.close()
    np.testing.assert_array_equal(scenes[1].draw(), second)
    assert effects[1].enabled
    assert effects[0].report()['bytes'] == 0


def test_lights_and_actors_come_and_go():
    scene = Scene(light(at=AT))
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    scene.draw()
    scene.pl.add_light(light('point', (0, 1, 3), intensity=0.3))
    late = scene.add(pv.Sphere(radius=0.2, center=(1, 1, 1)))
    scene.draw()
    assert shadows.report()['views'] == 7
    assert shadows.report()['receivers'] == 3
    scene.pl.remove_actor(late)
    scene.pl.remove_all_lights()
    scene.draw()
    assert shadows.report()['views'] in (0, 7)
    scene.pl.add_light(light('spot', (0, 1, 3)))
    scene.draw()
    assert shadows.report()['views'] == 1
    assert shadows.report()['receivers'] == 2


def test_point_light_within_a_closed_box():
    scene = Scene(light('point', (0, 0, 0.5)))
    scene.add(pv.Cube(x_length=20, y_length=20, z_length=20))
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    lit = scene.lit(shadows)
    assert np.nanmedian(lit) > 0.97


@pytest.mark.parametrize(
    ('settings', 'error'),
    [
        ({'method': 'soft'}, ValueError),
        ({'resolution': 0}, ValueError),
        ({'resolution': 2.5}, TypeError),
        ({'filter_radius': -1.0}, ValueError),
        ({'normal_bias': float('nan')}, ValueError),
        ({'angle': 90.0}, ValueError),
        ({'radius': 0.0}, ValueError),
        ({'casts': 3}, TypeError),
        ({'bias': 1.0}, TypeError),
    ],
)
def test_bad_settings_raise_at_the_call(settings, error):
    refused(next(iter(settings)), pvibr.Shadows, kind=error, **settings)


def test_settings_change_and_are_restored():
    scene = Scene(light(at=AT))
    shadows = scene.pl.ibr.add(pvibr.Shadows(method='hard'))
    hard = scene.draw()
    state = scene.pl.ibr.state()
    shadows.method, shadows.filter_radius = 'msm', 8.0
    assert np.abs(scene.draw() - hard).max() > 20
    with warnings.catch_warnings():
        warnings.simplefilter('error', PvibrWarning)
        scene.pl.ibr.restore(state)
    np.testing.assert_array_equal(scene.draw(), hard)
    assert shadows.state()['method'] == 'hard'


@pytest.mark.parametrize('scale', [1.0, 0.2, 30.0])
def test_the_terminator_of_smooth_facets_is_smooth(scale):
    at = (4.0, -1.0, 1.0)
    scene = Scene(light(at=at), height=-5.0)
    scene.floor.SetVisibility(False)
    scene.pl.remove_actor(scene.disk)
    ball = pv.Sphere(radius=1.0 / scale, theta_resolution=24, phi_resolution=24)
    actor = scene.add(ball, smooth_shading=True)
    actor.scale = scale
    scene.look((-2, -4, 1))
    plain = scene.draw()[..., 0]
    scene.pl.ibr.add(pvibr.Shadows())
    shadowed = scene.draw()[..., 0]
    assert np.abs(shadowed - plain)[plain > 12].max() < 6


@pytest.mark.parametrize('faces', ['both', 'back'])
def test_a_ball_throws_a_disk(faces):
    scene = Scene(light(at=(0, 0, 4)))
    scene.pl.remove_actor(scene.disk)
    ball = pv.Sphere(radius=0.5, center=(0, 0, 1), theta_resolution=90, phi_resolution=90)
    scene.disk = scene.add(ball)
    check(scene, scene.pl.ibr.add(pvibr.Shadows(faces=faces)), (0, 0, 4.0), True)


def test_back_faces_alone_cast():
    scene = Scene(light(at=AT))
    plain = scene.draw()
    shadows = scene.pl.ibr.add(pvibr.Shadows(faces='back', casts=[scene.disk]))
    dark = scene.draw()
    scene.disk.mapper.dataset.flip_faces(inplace=True)
    flipped = scene.draw()
    assert shadows.enabled
    # A sheet casts by that side alone which turns away from the light.
    assert sorted([np.abs(dark - plain).max() > 50, np.abs(flipped - plain).max() > 50]) == [0, 1]


def test_volumes_cast_none_and_it_says_so():
    scene = Scene()
    grid = pv.ImageData(dimensions=(5, 5, 5))
    grid['v'] = np.ones(grid.n_points)
    scene.pl.add_volume(grid, show_scalar_bar=False)
    shadows = scene.pl.ibr.add(pvibr.Shadows())
    scene.draw()
    assert shadows.report()['no shadows from'] == ['volume']


@pytest.mark.parametrize('method', MAPS)
def test_a_point_light_that_sees_all_around(method):
    at = (0.3, 0.2, 2.0)
    scene = Scene(light('point', at))
    scene.add(pv.Cube(center=(0, 0, 5), x_length=1, y_length=1, z_length=1))
    shadows = scene.pl.ibr.add(pvibr.Shadows(method=method, radius=1e-4))
    check(scene, shadows, at, False, edge=0.12)
    assert shadows.report()['views'] == 6


def test_shadows_are_added_once():
    scene = Scene()
    first = scene.pl.ibr.add(pvibr.Shadows())
    second = scene.pl.ibr.add(pvibr.Shadows())
    assert scene.pl.ibr.effects == (second,) != (first,)


def test_more_lights_than_texture_units():
    scene = Scene(*[light('spot', (np.cos(k), np.sin(k), 4.0), intensity=0.05) for k in range(40)])
    shadows = scene.pl.ibr.add(pvibr.Shadows(resolution=64))
    assert scene.draw().max() > 60
    assert shadows.enabled
    assert 'texture units' in str(shadows.report()['no shadows from'])


@pytest.mark.parametrize('scale', [(1, 1, 5), (0.3, 1, 1)])
def test_uneven_scale_of_smooth_receivers(scale):
    scene = Scene(light(at=AT))
    scene.pl.remove_actor(scene.floor)
    plane = pv.Plane(i_size=6 / scale[0], j_size=6 / scale[1], i_resolution=8, j_resolution=8)
    scene.floor = scene.add(plane, smooth_shading=True)
    scene.floor.scale = scale
    check(scene, scene.pl.ibr.add(pvibr.Shadows()), AT, True)


@pytest.mark.parametrize('looks', [{'render_points_as_spheres': True, 'point_size': 14}])
def test_spheres_at_several_distances_do_not_shadow_themselves(looks):
    scene = Scene(light(at=(0.0, -4.0, 4.0)))
    scene.floor.SetVisibility(False)
    scene.disk.SetVisibility(False)
    x = np.linspace(-2, 2, 5)
    scene.add(pv.PolyData(np.c_[x, 2 * x, 0 * x + 0.5]), **looks)
    lit = scene.lit(scene.pl.ibr.add(pvibr.Shadows()))
    seen = lit[np.isfinite(lit)]
    assert seen.size > 300
    assert (seen > 0.9).mean() > 0.9


def test_an_actor_of_two_subplots_is_shadowed_in_one():
    pl = pv.Plotter(off_screen=True, window_size=(240, 80), lighting='none', shape=(1, 2))
    scene = Scene(light(at=AT), plotter=pl)
    pl.subplot(0, 1)
    pl.add_light(light(at=AT))
    for actor in (scene.floor, scene.disk):
        pl.renderer.AddViewProp(actor)
    scene.look((0, -7, 5))
    plain = scene.draw()
    pl.subplot(0, 0)
    pl.ibr.add(pvibr.Shadows())
    changed = np.abs(scene.draw() - plain).max(-1) > 30
    assert changed[:, :120].sum() > 20
    assert not changed[:, 120:].any()


def test_fewer_texels_than_asked_are_told(monkeypatch):
    monkeypatch.setattr('pvibr.things.depth_view.texture_limit', lambda _window: 512)
    scene = Scene()
    shadows = scene.pl.ibr.add(pvibr.Shadows(resolution=1024))
    with pytest.warns(PvibrWarning, match='resolution = 1024 would take 4 MiB'):
        scene.draw()
    assert shadows.report()['texels'] <= 512
