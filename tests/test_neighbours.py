"""pvibr beside PyVista's own features: each picture is as without pvibr, or as with meshes."""

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl.driver import renderer_name
from pvibr.things.frame import Frame
from tests.pictures import plotter, shot, shown

pytestmark = pytest.mark.sampled

SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'


def chart():
    made = pv.Chart2D()
    made.line([0, 1], [1, 10])
    return made


def test_closed_plotters_end_as_soon_as_those_without_pvibr():
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.ShaderEffect(SAME))
    pl.show()
    plot, ibr = weakref.ref(pl), pl.ibr
    del pl  # no garbage is searched for here: `conftest` has it off
    assert plot() is None
    assert repr(ibr) == '<plotter.ibr: closed>'
    with pytest.raises(pvibr.ClosedError):
        ibr.add(pvibr.Vignette())


def test_a_chart_may_be_shown_in_one_plotter_after_the_other():
    used, fresh = chart(), chart()

    def picture(chart, effect):
        pl = plotter()
        pl.add_chart(chart)
        gc.collect()  # a scene that ends takes itself from its charts, which crash without one
        if effect:
            pl.ibr.add(pvibr.ShaderEffect(SAME))
        return shown(pl), pl.close()

    for _ in range(2):
        picture(used, True)
    np.testing.assert_array_equal(picture(used, True)[0], picture(fresh, False)[0])


def thin_things(pl, seed):
    """Add points, lines and what is not lit, over a ground, and a light."""
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(3, 2, 6), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='w')
    rng = np.random.default_rng(seed)
    points = rng.uniform([-2.5, -2.5, 0.3], [2.5, 2.5, 1.0], (4, 12, 3))
    pl.add_mesh(points[0], style='points', color='red', point_size=6)
    pl.add_mesh(points[1], style='points_gaussian', color='green', point_size=9)
    pl.add_mesh(points[2], render_points_as_spheres=True, color='orange', point_size=9)
    unlit = {'render_points_as_spheres': True, 'lighting': False}
    pl.add_mesh(points[3], color='cyan', point_size=9, **unlit)
    pl.add_mesh(pv.lines_from_points(points[0]), color='blue', line_width=2)
    ball = pv.Sphere(center=(1, 0, 0.6), radius=0.5)
    pl.add_mesh(ball, color='yellow', lighting=False, smooth_shading=True)
    pl.add_mesh(ball.translate((0, 2, 0)), color='purple', style='wireframe')
    pl.camera_position = [(0, -7, 7), (0, 0, 0), (0, 0, 1)]
    return pl


@pytest.mark.parametrize('seed', [0, 5])
def test_ssao_darkens_what_shadows_draw_as_it_does_without_them(seed):
    def picture(ssao, shadows):
        pl = thin_things(plotter((200, 150)), seed)
        if ssao:
            pl.enable_ssao(radius=1)
        if shadows:
            pl.ibr.add(pvibr.Shadows())
        return shown(pl)

    plain, dark, occluded, both = (
        picture(ssao, shadows) for ssao in (False, True) for shadows in (False, True)
    )
    same = (plain == dark).all(2)
    assert 0.5 < same.mean() < 0.95
    assert np.abs(occluded - both)[same].max() <= 1
    np.testing.assert_allclose((dark * (occluded / np.maximum(plain, 1))), both, atol=4)


PASSES = {
    'lens': lambda pl: pl.enable_depth_of_field(),
    'blur': lambda pl: pl.add_blurring(),
    'blur and lens': lambda pl: (pl.add_blurring(), pl.enable_depth_of_field()),
    'lens and SSAA': lambda pl: (pl.enable_depth_of_field(), pl.enable_anti_aliasing('ssaa')),
}


def hill(pl):
    """Add a ground and a ball, and look at them."""
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='w')
    ball = pv.Sphere(center=(0, 0, 1), theta_resolution=40, phi_resolution=40)
    pl.camera_position = [(0, -8, 5), (0, 0, 0), (0, 0, 1)]
    return pl.add_mesh(ball, color='red')


@pytest.mark.parametrize('name', PASSES)
@pytest.mark.parametrize('parallel', [False, True])
def test_frames_know_what_passes_of_vtk_do_to_the_camera(name, parallel):
    pl, seen = plotter((160, 100)), []
    ball = hill(pl)
    pl.camera.parallel_projection = parallel
    PASSES[name](pl)
    pl.show(auto_close=False)

    def see(*_):
        camera = pl.renderer.GetActiveCamera()
        seen.append(camera.GetProjectionTransformMatrix(pl.renderer.GetTiledAspectRatio(), -1, 1))

    ball.mapper.GetPolyDataMapper().AddObserver('UpdateShaderEvent', see)
    pl.render()
    drawn, _ = Frame.of(pl.renderer).within_passes()
    theirs = np.reshape(seen[0].GetData(), (4, 4))
    np.testing.assert_allclose(
        drawn.clip_from_view[:2], theirs[:2], rtol=1e-2 if 'SSAA' in name else 1e-6
    )


@pytest.mark.parametrize('name', ['lens', 'blur'])
@pytest.mark.parametrize('thing', ['instances', 'layers', 'impostor'])
def test_things_are_where_their_meshes_are_beside_passes_of_vtk(name, thing):
    def picture(thing):
        pl = plotter((200, 150))
        ball = hill(pl)
        points = np.random.default_rng(3).uniform([-3, -3, 0.5], [3, 3, 0.5], (9, 3))
        cone = pv.Cone(direction=(0, 0, 1), resolution=12)
        if thing == 'instances':
            pl.ibr.add_instances(cone, points, color='g')
        else:
            pl.add_mesh(pv.merge([cone.translate(p) for p in points]), color='g')
        if thing == 'layers':
            pl.ibr.add_image_layers([ball])
        elif thing == 'impostor':
            pl.ibr.add_impostor(ball)
        PASSES[name](pl)
        return shown(pl)

    assert np.abs(picture(thing) - picture(None)).mean() < 0.2


@pytest.mark.parametrize('name', ['lens', 'blur'])
def test_what_reads_depth_finds_it_beside_passes_of_vtk(name):
    def lines(*passes):
        pl = plotter((180, 180))  # VTK's lens squeezes other windows by some percent
        hill(pl)
        for found in passes:
            PASSES[found](pl)
        plain = shown(pl)
        pl.ibr.add(pvibr.Outline())
        found = np.abs(shown(pl) - plain).max(2) > 60
        return found, pl.ibr.buffer('depth')

    beside, depth = lines(name)
    alone, true = lines()
    near = np.lib.stride_tricks.sliding_window_view(np.pad(alone, 3), (7, 7)).any((2, 3))
    assert alone.sum() > 100
    assert beside.sum() > 0.8 * alone.sum()
    assert near[beside].all()
    both = np.isfinite(depth) & np.isfinite(true)
    assert (np.isfinite(depth) == np.isfinite(true)).mean() > 0.97
    assert np.median(np.abs(depth[both] - true[both])) < 0.05


def test_what_lies_on_the_screen_is_as_sharp_as_without_an_effect():
    def picture(effect, widgets):
        pl = plotter((240, 180))
        pl.background_color = 'gray'
        hill(pl)
        if widgets:
            pl.add_slider_widget(print, [0, 9], title='size', pointa=(0.1, 0.9), pointb=(0.4, 0.9))
            pl.add_checkbox_button_widget(print, value=True, position=(10, 10), size=30)
            pl.add_logo_widget()
            pl.add_text('text', position='lower_right')
        if effect:
            pl.ibr.add(effect)
        return shown(pl)

    bare, drawn = (picture(None, widgets) for widgets in (False, True))
    opaque = (np.abs(drawn - bare).max(2) > 0) & (drawn.max(2) - drawn.min(2) > 240)
    assert opaque.sum() > 300  # of the checkbox, above all
    lens, light = {'radius': 0.5, 'distance': 3.0}, {'threshold': 0.1, 'intensity': 2.0}
    for effect in (pvibr.DepthOfField(**lens), pvibr.Bloom(**light)):
        changed = picture(effect, True)
        without = picture(type(effect)(**(lens if 'Depth' in effect.name else light)), False)
        assert np.abs(without - bare).mean() > 1
        np.testing.assert_array_equal(changed[opaque], drawn[opaque])
        untouched = (drawn == bare).all(2)
        np.testing.assert_array_equal(changed[untouched], without[untouched])


@pytest.mark.parametrize('style', ['wireframe', 'points'])
@pytest.mark.parametrize('seed', [1, 8])
def test_thin_things_that_nothing_hides_from_the_light_have_no_shadow(style, seed):
    rng = np.random.default_rng(seed)
    pl = plotter((200, 150), lighting='none')
    light = rng.uniform([-2, -2, 3], [2, 2, 5])
    pl.add_light(pv.Light(position=light, light_type='scene light'))
    grid = pv.Plane(direction=rng.uniform([-0.5, -0.5, 1], [0.5, 0.5, 1]), i_size=3, j_size=3)
    pl.add_mesh(grid, style=style, color='red', line_width=2, point_size=4)
    pl.camera_position = [(0, -4, 4), (0, 0, 0), (0, 0, 1)]
    plain = shown(pl)
    shadows = pl.ibr.add(pvibr.Shadows())
    assert (np.abs(shown(pl) - plain).max(2) > 8).sum() == 0
    assert shadows.report()['lights'] == 1


@pytest.mark.parametrize('mode', ['Anaglyph', 'Left', 'Right', 'Interlaced', 'Checkerboard'])
def test_both_eyes_see_things_where_meshes_are_from_the_first_frame_on(mode):
    points = np.random.default_rng(2).uniform([-3, -3, 0.5], [3, 3, 0.5], (9, 3))
    cone = pv.Cone(direction=(0, 0, 1), resolution=12)

    def picture(thing):
        pl = plotter((200, 150))
        hill(pl)
        if thing:
            pl.ibr.add_instances(cone, points, color='g')
        else:
            pl.add_mesh(pv.merge([cone.translate(p) for p in points]), color='g')
        pl.render_window.StereoCapableWindowOn()
        getattr(pl.render_window, f'SetStereoTypeTo{mode}')()
        pl.render_window.StereoRenderOn()
        pl.show(auto_close=False)
        return pl.screenshot(None, return_img=True).astype(int)

    assert (np.abs(picture(True) - picture(False)).max(2) > 40).sum() < 4


def lit_hill(pl):
    """Add a ground, a ball and a spotlight."""
    ball = hill(pl)
    pl.remove_all_lights()
    lamp = {'light_type': 'scene light', 'positional': True, 'cone_angle': 60}
    pl.add_light(pv.Light(position=(3, -2, 6), **lamp))
    return ball


@pytest.mark.parametrize('thing', ['layers', 'impostor', 'shadows'])
def test_shadows_of_vtk_are_drawn_as_without_pvibr(thing):
    def picture(thing):
        pl = plotter((200, 150))
        ball = lit_hill(pl)
        pl.enable_shadows()
        if thing == 'layers':
            pl.ibr.add_image_layers([ball])
        elif thing == 'impostor':
            pl.ibr.add_impostor(ball, only_if_faster=False)
        elif thing == 'shadows':
            pl.ibr.add(pvibr.Shadows())
        if thing == 'shadows':
            with pytest.warns(pvibr.PvibrWarning, match=r'call disable_shadows\(\)'):
                pl.show(auto_close=False)
        return shown(pl)  # a second warning would fail

    np.testing.assert_array_equal(picture(thing), picture(None))


CENTERS = np.array([[0, 0, 0], [2, 0, 0], [1, 1.5, 0.5]])
ENDS = np.add(CENTERS, (-0.5, 0, 0)), np.add(CENTERS, (0.5, 0, 0))
CASTERS = {  # what is added, and the mesh of one at the origin
    'instances': (lambda ibr, **how: ibr.add_instances(CONE, CENTERS, **how), lambda: CONE),
    'far instances': (
        lambda ibr, **how: ibr.add_instances(
            CONE, CENTERS, force_level='flat', cache=False, **how
        ),
        lambda: CONE,
    ),
    'spheres': (lambda ibr, **how: ibr.add_spheres(CENTERS, 0.5, **how), lambda: round_mesh()),
    'cylinders': (
        lambda ibr, **how: ibr.add_cylinders(*ENDS, 0.3, **how),
        lambda: pv.Cylinder(radius=0.3, height=1, resolution=40),
    ),
    'ellipsoids': (
        lambda ibr, **how: ibr.add_ellipsoids(CENTERS, (0.5, 0.3, 0.2), **how),
        lambda: round_mesh().scale((1, 0.6, 0.4)),
    ),
}
CONE = pv.Cone(resolution=20)


def round_mesh():
    return pv.Sphere(theta_resolution=40, phi_resolution=40)


@pytest.mark.parametrize('kind', CASTERS)
@pytest.mark.parametrize('lamp', [False, True])
def test_things_cast_the_shadows_that_vtk_draws_of_their_meshes(kind, lamp):
    def ground(add):
        pl = plotter((200, 150))
        pl.add_mesh(pv.Plane(center=(1, 0.7, -0.5), i_size=4, j_size=4), color='w')
        add(pl)
        if lamp:
            pl.remove_all_lights()
            spot = {'light_type': 'scene light', 'positional': True, 'cone_angle': 40}
            pl.add_light(pv.Light(position=(3, -2, 6), focal_point=(1, 0.7, 0), **spot))
        pl.enable_shadows()
        pl.view_isometric()
        picture = shown(pl)
        np.testing.assert_array_equal(shot(pl), picture)
        gray = (np.ptp(picture, 2) < 40) & (picture.max(2) < 250)
        return gray, gray & (picture.max(2) < 150)

    add, mesh = CASTERS[kind]
    seen, dark = ground(lambda pl: add(pl.ibr, color='red'))
    truth, wanted = ground(
        lambda pl: [pl.add_mesh(mesh().translate(p), color='red') for p in CENTERS]
    )
    both = seen & truth
    assert (wanted & both).sum() > 100
    assert ((dark ^ wanted) & both).sum() < 0.15 * (wanted & both).sum()


def test_depth_peeling_of_samples_is_warned_of_once_and_the_remedy_works():
    def red(pl):
        picture = shown(pl)
        return ((picture[..., 0] - picture[..., 1]) > 40).sum()

    def ghost(pl):
        pl.add_mesh(pv.Sphere(), color='red', opacity=0.5)
        pl.ibr.add(pvibr.ShaderEffect(SAME))
        return pl

    pl = ghost(pv.Plotter(window_size=(120, 90)))
    pl.enable_depth_peeling()
    pl.enable_anti_aliasing('msaa', multi_samples=4)
    known = plotter()
    shown(known)
    if 'llvmpipe' not in renderer_name(known.render_window):
        pytest.skip('a driver that peels samples')
    with pytest.warns(pvibr.PvibrWarning, match=r'disable_anti_aliasing\(\)'):
        pl.show(auto_close=False)
    assert red(pl) == 0  # a second warning would fail
    pl.disable_anti_aliasing()
    assert red(pl) > 0.9 * red(ghost(plotter())) > 500


def test_what_pyvista_lists_of_a_subplot_is_what_users_added():
    pl = plotter()
    pl.ibr.add(pvibr.ShaderEffect(SAME))
    listed = pl.renderer._actors
    assert len(listed) == 0
    assert list(listed) == []
    ball = pl.add_mesh(pv.Sphere(), name='ball')
    balls = pl.ibr.add_spheres([[2, 0, 0]], name='balls')
    cube = pl.add_mesh(pv.Cube(), name='cube')
    assert listed.keys() == ['ball', 'balls', 'cube']
    assert list(listed) == [listed[k] for k in range(3)] == [ball, balls, cube]
    assert list(pl.renderer.GetActors()) == [ball, balls, cube]
    assert listed[-1] is listed['cube'] is cube
    with pytest.raises(IndexError):
        listed[3]
    with pytest.raises(KeyError, match='none'):
        listed['none']
    del listed['ball']
    assert listed.keys() == ['balls', 'cube']
    del listed[-1]
    assert dict(pl.actors) == {'balls': balls}


@pytest.mark.parametrize('effect', [False, True])
def test_a_closed_plotter_exports_nothing_in_pyvistas_words(effect, tmp_path):
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    if effect:
        pl.ibr.add(pvibr.ShaderEffect(SAME))
    pl.show(auto_close=False)
    pl.close()
    with pytest.raises(RuntimeError, match='This plotter has been closed'):
        pl.export_vrml(tmp_path / 'scene.wrl')


def test_numbers_of_a_scalar_bar_are_in_the_first_frame_where_they_stay():
    """VTK alone puts them elsewhere in the first frame, if nothing opaque is in the scene."""

    def pictures(effect):
        pl = plotter((200, 150))
        ball = pv.Sphere()
        pl.add_mesh(ball, scalars=ball.points[:, 2], opacity=ball.points[:, 2] + 0.5)
        if effect:
            pl.ibr.add(pvibr.ShaderEffect(SAME))
        pl.show(auto_close=False)
        return pl.screenshot(None, return_img=True), shot(pl)

    first, later = pictures(True)
    np.testing.assert_array_equal(first, later)
    np.testing.assert_array_equal(later, pictures(False)[1])


@pytest.mark.parametrize('kind', ['spheres', 'cylinders', 'ellipsoids'])
@pytest.mark.parametrize('mode', ['RedBlue', 'Interlaced', 'SplitViewportHorizontal'])
def test_both_eyes_see_curved_things_where_meshes_are(kind, mode):
    middles = np.random.default_rng(len(kind)).uniform([-2, -2, 0.5], [2, 2, 2], (5, 3))
    half = np.array((0, 0, 0.5))
    fine = {'theta_resolution': 60, 'phi_resolution': 60}

    def picture(thing):
        pl = plotter((200, 150))
        hill(pl)
        look = {'color': 'g'}
        if thing and kind == 'spheres':
            pl.ibr.add_spheres(middles, 0.5, **look)
        elif thing and kind == 'cylinders':
            pl.ibr.add_cylinders(middles, middles + 2 * half, 0.3, **look)
        elif thing:
            pl.ibr.add_ellipsoids(middles, np.full((5, 3), (0.3, 0.4, 0.6)), **look)
        for at in () if thing else middles:
            rod = pv.Cylinder(center=at + half, direction=(0, 0, 1), radius=0.3, height=1)
            ball = pv.Sphere(radius=1, **fine).scale((0.3, 0.4, 0.6)).translate(at)
            made = {'spheres': pv.Sphere(center=at, **fine), 'cylinders': rod, 'ellipsoids': ball}
            pl.add_mesh(made[kind], smooth_shading=True, split_sharp_edges=True, **look)
        pl.render_window.StereoCapableWindowOn()
        getattr(pl.render_window, f'SetStereoTypeTo{mode}')()
        pl.render_window.StereoRenderOn()
        pl.camera.SetEyeAngle(6)
        return shown(pl)

    assert (np.abs(picture(True) - picture(False)).max(2) > 40).mean() < 0.01


@pytest.mark.parametrize('thing', ['layers', 'impostor'])
@pytest.mark.parametrize('lights', ['none', 'off'])
def test_images_of_actors_are_drawn_where_no_light_is_on(thing, lights):
    def picture(thing):
        pl = plotter((160, 120))
        ball = hill(pl)
        if lights == 'none':
            pl.remove_all_lights()
        else:
            for light in pl.renderer.lights:
                light.switch_off()
        if thing == 'layers':
            pl.ibr.add_image_layers([ball], only_if_faster=False)
        elif thing == 'impostor':
            pl.ibr.add_impostor(ball, only_if_faster=False)
        found = shown(pl), *((row.state for row in pl.ibr.report().rows) if thing else ())
        for light in pv.Plotter(lighting='light kit').renderer.lights:
            pl.add_light(light)
        return *found, shot(pl)

    (dark, state, light), (true, lit) = picture(thing), picture(None)
    assert state == 'ran'
    for found, meant in ((dark, true), (light, lit)):
        assert (np.abs(found - meant).max(2) > 15).mean() < 0.01
    assert np.abs(true - lit).mean() > 5


BOX = (-2, 2, -2, 2, -2, 2)
HANDLES = (
    lambda pl: pl.add_plane_widget(lambda *_: None, bounds=BOX),
    lambda pl: pl.add_box_widget(lambda *_: None, bounds=BOX),
    lambda pl: pl.add_sphere_widget(lambda *_: None, center=(0.7, -0.7, 2), radius=0.4),
    lambda pl: pl.add_spline_widget(lambda *_: None, bounds=BOX),
    lambda pl: pl.add_affine_transform_widget(pl.actors['ball'], scale=0.4, line_radius=0.05),
)


@pytest.mark.parametrize('first', [False, True])
@pytest.mark.parametrize('name', ['Shadows', 'Projector'])
def test_handles_of_widgets_cast_no_shadow_and_get_no_light_of_effects(name, first):
    pl = plotter((160, 120), lighting='none')
    pl.add_light(pv.Light(position=(3, -2, 8), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='#405060')
    pl.add_mesh(pv.Sphere(center=(0, 0, 1)), color='orange', name='ball')
    pl.camera_position = [(0, -9, 7), (0, 0, 0), (0, 0, 1)]
    lens = pv.Camera()
    lens.position, lens.focal_point, lens.up = (3, -3, 8), (0, 0, 0), (0, 0, 1)
    stripes = np.full((2, 2, 3), [0, 90, 250], np.uint8)
    effect = pvibr.Shadows() if name == 'Shadows' else pvibr.Projector(stripes, lens)
    plain = shown(pl)
    pl.ibr.add(effect)
    lit = shot(pl)
    assert (lit != plain).any(2).sum() > 100
    for add in HANDLES:
        effect.enabled = first  # a widget comes before or after its first frame
        widget = add(pl)
        effect.enabled = False
        alone = shot(pl)
        effect.enabled = True
        both = shot(pl)
        (getattr(widget, 'Off', None) or widget.remove)()
        ours, same = (alone != plain).any(2), (abs(both - alone) <= 2).all(2)
        assert ours.sum() > 20
        assert ((both != lit).any(2) & ~ours).sum() <= 0.02 * ours.sum()  # as light as behind it
        assert same[ours].mean() > 0.9 or 'ImplicitPlane' in type(widget).__name__  # translucent
