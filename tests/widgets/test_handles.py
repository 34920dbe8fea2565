"""Handles in the scene: what mouse and keys do to projectors, lights and lenses."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.maths.cameras import as_camera
from pvibr_widgets import light_handles, pick_focus, projector_handles, time_bar
from pvibr_widgets.handles_marks import HOVERED
from tests.refusals import refused
from tests.widgets.conftest import colour

pytestmark = pytest.mark.sampled

SIZE = 320, 240
PICTURE = np.full((30, 40, 3), (255, 0, 0), np.uint8)
YELLOW, BLUE = [255, 205, 60], [90, 220, 255]
KINDS = ['camera', 'parallel', 'pinhole', 'lens', 'orthographic', 'tuple']


def camera_of(kind, shift=0.0):
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (shift + 1, -2, 3), (shift, 0, 0), (0, 1, 0)
    camera.view_angle = 40
    if kind == 'camera':
        return camera
    if kind in ('parallel', 'orthographic'):
        camera.parallel_projection, camera.parallel_scale = True, 1.0
        return camera if kind == 'parallel' else as_camera(camera, (40, 30))
    found = as_camera(camera, (40, 30))
    lens = (-0.2, 0.05) if kind == 'lens' else ()
    if kind == 'tuple':
        return found.K, found.R, found.t
    return pvibr.Pinhole(found.K, found.R, found.t, (40, 30), (*lens, 0, 0) if lens else ())


def scene(shift=0.0, **settings):
    pl = pv.Plotter(window_size=SIZE, **settings)
    fill(pl, shift)
    return pl


def fill(pl, shift=0.0):
    floor = pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='tan')
    ball = pl.add_mesh(pv.Sphere(), color='white')
    floor.position, ball.position = (shift, 0, 0), (shift, 0, 0.5)
    pl.camera_position = [(shift + 8, -9.5, 8), (shift, 0, 1), (0, 0, 1)]


def projector(pl, kind='camera', shift=0.0, **settings):
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of(kind, shift), **settings))
    handles = projector_handles(pl, photo)
    pl.show(auto_close=False)
    return photo, handles


def seen(photo):
    return as_camera(photo.cameras[0], photo.size_of())


def ways(camera):
    return np.stack(camera.rays(np.array([[0.5, 0.5], [1.0, 0.5], [0.5, 1.0]])))


def near(a, b, pixels=1.5):
    return np.linalg.norm(np.subtract(a, b)) <= pixels


def red(pl):
    picture = pl.screenshot().astype(int)
    return (picture[..., 0] - picture[..., 1] > 200).sum()


def flat_props(renderer):
    return [p for p in renderer.GetViewProps() if p.IsA('vtkActor2D')]


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('name', ['position', 'aim'])
def test_free_handles_go_with_the_finger(hand, kind, name):
    pl = scene()
    photo, handles = projector(pl, kind)
    before, start = ways(seen(photo)), np.array(handles.pixels[name])
    hand(pl).drag(start + 3, np.add(start, [13, 8]), np.add(start, [23, -9]))
    assert near(handles.pixels[name], np.add(start, [20, -12]))  # it was not touched in its middle
    assert np.abs(ways(seen(photo)) - before).max() > 1e-2


@pytest.mark.parametrize('kind', KINDS)
def test_the_angle_widens_the_picture(hand, kind):
    pl = scene()
    photo, handles = projector(pl, kind)
    start, middle = np.array(handles.pixels['angle']), np.array(handles.pixels['aim'])
    painted, before = red(pl), ways(seen(photo))
    goal = start + 0.3 * (start - middle)
    hand(pl).drag(start, goal)
    assert near(handles.pixels['angle'], goal, 5)  # lenses bend the way there
    assert np.allclose(ways(seen(photo))[:, 0], before[:, 0], atol=1e-6)
    assert red(pl) > 1.2 * painted


@pytest.mark.parametrize('kind', KINDS)
def test_the_roll_turns_about_the_axis(hand, kind):
    pl = scene()
    photo, handles = projector(pl, kind)
    before = ways(seen(photo))
    start = np.array(handles.pixels['roll'])
    hand(pl).drag(start, np.add(start, [-25, 10]))
    after = ways(seen(photo))
    assert np.allclose(after[1, 0], before[1, 0], atol=1e-6)  # it looks the same way
    assert np.abs(after[:, 2] - before[:, 2]).max() > 0.02
    aim, roll = (np.array(handles.pixels[n]) for n in ('aim', 'roll'))
    wanted = np.add(start, [-25, 10]) - aim
    cosine = wanted @ (roll - aim) / np.linalg.norm(wanted) / np.linalg.norm(roll - aim)
    assert cosine > 0.99


def test_lens_and_proportions_of_a_calibrated_camera_are_kept(hand):
    pl = scene()
    photo, handles = projector(pl, 'lens')
    old = photo.cameras[0]
    for pixel in handles.pixels.values():
        hand(pl).drag(pixel, np.add(pixel, [9, 7]))
    new = photo.cameras[0]
    assert new != old
    assert np.array_equal(new.distortion, old.distortion)
    assert new.size == old.size
    assert np.isclose(new.K[0, 0] / new.K[1, 1], old.K[0, 0] / old.K[1, 1])
    assert np.allclose(new.R @ new.R.T, np.eye(3), atol=1e-9)


def test_a_camera_of_pyvista_is_moved_itself_and_stays_upright(hand):
    pl = scene()
    photo, handles = projector(pl)
    camera = photo.cameras[0]
    hand(pl).drag(handles.pixels['position'], (100, 200))
    assert photo.cameras[0] is camera
    assert camera.position != (1, -2, 3)
    assert camera.focal_point == (0, 0, 0)
    assert camera.up == (0, 1, 0)


def test_a_camera_that_is_none_changes_nothing():
    photo = pvibr.Projector(PICTURE, camera_of('pinhole'))
    before = photo.cameras
    refused(r'camera must be .* got 3', photo.set_camera, 3)
    with pytest.raises(IndexError):
        photo.set_camera(camera_of('camera'), 1)
    assert photo.cameras == before
    photo.set_camera(camera_of('tuple'))
    assert photo.cameras != before
    assert photo.size_of() == (40, 30)


def test_several_pictures_have_handles_each(hand):
    pl = scene()
    cameras = [camera_of('camera'), camera_of('pinhole')]
    photos = pl.ibr.add(pvibr.Projector([PICTURE] * 2, cameras))
    handles = projector_handles(pl, photos, view=1)
    pl.show(auto_close=False)
    hand(pl).drag(handles.pixels['aim'], (150, 100))
    assert photos.cameras[0] is cameras[0]
    assert photos.cameras[1] != cameras[1]


def test_the_picture_is_seen_where_it_is_dragged_to_while_it_is_dragged(hand):
    pl = scene()
    _, handles = projector(pl)
    before, mouse = pl.screenshot(), hand(pl)
    frames = []
    pl.renderer.AddObserver('EndEvent', lambda *_: frames.append(1))
    mouse.press(handles.pixels['aim'])
    drawn = len(frames)
    mouse.move((200, 90))
    assert len(frames) > drawn
    assert (pl.screenshot() != before).any()
    mouse.release((200, 90))


def test_code_moves_the_handles():
    pl = scene()
    photo, handles = projector(pl)
    before = handles.pixels
    photo.cameras[0].position = (2, -1, 3)
    pl.render()
    after = handles.pixels
    assert not near(before['position'], after['position'], 5)
    assert colour(pl, after['position']) == YELLOW


def test_what_cannot_be_is_left_as_it_was(hand):
    pl = scene()
    photo, handles = projector(pl)
    camera = photo.cameras[0]
    place = camera.position
    handles._try('aim', np.array(place))  # a camera that looks at itself
    handles._try('aim', np.add(place, (0, 1, 0)))  # and one that looks along its up
    assert camera.focal_point == (0, 0, 0)
    camera.focal_point = camera.position  # code may do so: the effect is off, no handle is there
    with pytest.warns(pvibr.PvibrWarning, match='Projector is off'):
        pl.render()
    assert handles.pixels == {}


def test_callbacks_are_called_with_the_thing(hand):
    pl, told = scene(), []
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    handles = projector_handles(pl, photo, callback=told.append)
    pl.show(auto_close=False)
    hand(pl).drag(handles.pixels['aim'], (150, 100))
    assert told == [photo]
    handles.callbacks.clear()
    hand(pl).drag(handles.pixels['aim'], (160, 100))
    assert told == [photo]


def test_tab_goes_round_and_out(hand):
    pl = scene()
    _, handles = projector(pl)
    keys, been = hand(pl), []
    for _ in range(6):
        keys.keys('Tab')
        been.append(handles.focused)
    assert been == ['position', 'aim', 'roll', 'angle', None, 'position']
    keys.keys('Tab', shift=True)
    assert handles.focused is None
    keys.keys('Tab', 'Tab', 'Escape')
    assert handles.focused is None
    handles.focus('angle')
    assert handles.focused == 'angle'
    keys.keys('comma')  # where Tab is taken
    assert handles.focused == 'roll'
    keys.keys('period', 'period')
    assert handles.focused is None


def test_arrows_move_the_handle_and_not_the_camera(hand):
    pl = scene()
    _, handles = projector(pl)
    keys, start, angle = hand(pl), handles.pixels['aim'], pl.camera.view_angle
    keys.keys('Tab', 'Tab', 'Right', 'Up')
    assert near(handles.pixels['aim'], np.add(start, 10), 0.01)
    keys.keys('Left', 'Down', shift=True)
    assert near(handles.pixels['aim'], np.add(start, 9), 0.01)
    assert pl.camera.view_angle == angle
    keys.keys('Escape', 'Up')  # now it is the plotter's, which zooms
    assert pl.camera.view_angle != angle
    assert near(handles.pixels['aim'], np.add(start, 9), 3)


def test_page_keys_move_away_and_nearer(hand):
    pl = scene()
    photo, handles = projector(pl)
    camera, keys = photo.cameras[0], hand(pl)
    eye = np.array(pl.camera.position)
    away = [np.linalg.norm(eye - camera.position)]
    at = handles.pixels['position']
    keys.keys('Tab')
    for key in ('Prior', 'Next', 'Next'):
        keys.keys(key)
        away.append(np.linalg.norm(eye - camera.position))
    assert np.allclose(np.array(away[1:]) / away[:-1], [1 / 0.95, 0.95, 0.95])
    assert near(handles.pixels['position'], at, 0.01)


def test_a_touched_handle_has_the_keys_and_its_name_is_shown(hand):
    pl = scene()
    _, handles = projector(pl)
    hand(pl).drag(handles.pixels['roll'])
    assert handles.focused == 'roll'
    assert colour(pl, handles.pixels['roll']) == BLUE


def test_two_sets_share_the_keys(hand):
    pl = scene(lighting='none')
    light = pv.Light(position=(1, 1, 3), light_type='scene light')
    pl.add_light(light)
    _, first = projector(pl)
    second = light_handles(pl, light)
    pl.render()
    keys = hand(pl)
    keys.keys(*['Tab'] * 5)
    assert (first.focused, second.focused) == (None, 'direction')
    second.remove()
    keys.keys('Tab')
    assert first.focused == 'position'


def test_they_go_with_the_effect(hand):
    pl = scene()
    photo, handles = projector(pl)
    at = handles.pixels['aim']
    pl.ibr.remove(photo)
    pl.render()
    assert not handles.enabled
    assert not flat_props(pl.renderer)
    place = pl.camera.position
    hand(pl).drag(at, np.add(at, 20))
    assert pl.camera.position != place
    handles.remove()


def test_they_go_with_image_effects_in_the_way():
    pl = scene()
    photo, _ = projector(pl)
    pl.ibr.add(pvibr.Bloom(threshold=0.2))
    pl.render()
    pl.ibr.remove(photo)
    pl.render()
    pl.render()
    assert not flat_props(pl.renderer)


def test_off_they_let_the_camera_turn_and_on_they_are_back(hand):
    pl = scene()
    photo, handles = projector(pl)
    at = handles.pixels['aim']
    assert colour(pl, at) == YELLOW
    handles.enabled = False
    assert colour(pl, at) != YELLOW
    place, aim = pl.camera_position, photo.cameras[0].focal_point
    hand(pl).drag(at, np.add(at, 20))
    assert pl.camera_position != place
    assert photo.cameras[0].focal_point == aim
    pl.camera_position = place
    handles.enabled = True
    assert colour(pl, at) == YELLOW
    hand(pl).drag(at, np.add(at, 20))
    assert photo.cameras[0].focal_point != aim


def test_they_can_be_removed_and_put_there_again(hand):
    pl = scene()
    photo, handles = projector(pl)
    handles.remove()
    handles.remove()
    handles.enabled = True
    assert not handles.enabled
    handles = projector_handles(pl, photo)
    pl.render()
    hand(pl).drag(handles.pixels['aim'], (150, 100))
    assert photo.cameras[0].focal_point != (0, 0, 0)
    pl.close()
    assert not handles.enabled
    with pytest.raises(pvibr.ClosedError):
        projector_handles(pl, photo)


def test_nobody_must_hold_them(hand):
    pl = scene()
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    at = projector_handles(pl, photo).pixels['aim']
    pl.show(auto_close=False)
    hand(pl).drag(at, np.add(at, 20))
    assert photo.cameras[0].focal_point != (0, 0, 0)


def test_a_plain_renderer_has_them_too():
    from pvibr.core import _vtk

    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetSize(64, 48)
    window.AddRenderer(renderer)
    with pvibr.attach(renderer) as ibr:
        photo = ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
        refused('interactor', projector_handles, renderer, photo)
        interactor = type(pv.Plotter().iren.interactor)()
        interactor.SetRenderWindow(window)
        handles = projector_handles(renderer, photo)
        window.Render()
        interactor.SetEventInformation(1, 1, 0, 0, '\0', 0, 'Tab')
        interactor.KeyPressEvent()
        assert handles.focused is not None
    assert not handles.enabled


def test_far_from_the_origin_they_are_at_the_same_pixels(hand):
    found = []
    for shift in (0.0, 1e6):
        pl = scene(shift)
        _, handles = projector(pl, 'pinhole', shift)
        hand(pl).drag(handles.pixels['aim'], (150, 100))
        found.append(np.array([*handles.pixels.values()]))
        pl.close()
    assert np.allclose(found[0], found[1], atol=0.01)


def test_they_work_in_any_subplot(hand):
    pl = pv.Plotter(shape=(2, 2), window_size=(480, 360))
    pl.subplot(1, 1)
    fill(pl)
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    pl.subplot(0, 0)
    fill(pl)
    handles = projector_handles(pl, photo)
    pl.show(auto_close=False)
    start = handles.pixels['aim']
    hand(pl).drag(start, np.add(start, [12, 9]))
    assert near(handles.pixels['aim'], np.add(start, [12, 9]))
    assert colour(pl, handles.pixels['aim']) == BLUE
    assert not flat_props(pl.renderers[0])


def test_behind_the_eye_there_is_nothing_to_touch(hand):
    pl = scene()
    photo, handles = projector(pl)
    photo.cameras[0].position = (16, -19, 16)  # behind the one who looks
    pl.render()
    assert np.isnan(handles.pixels['position']).all()
    hand(pl).keys('Tab')
    assert handles.focused == 'aim'


def test_effects_leave_their_colours():
    pl = scene()
    _, handles = projector(pl)
    pl.ibr.add(pvibr.Bloom(threshold=0.0, intensity=2.0))
    pl.ibr.add(pvibr.DepthOfField(radius=1.0))
    for pixel in handles.pixels.values():
        assert colour(pl, pixel) == YELLOW


def test_large_screenshots_have_them_in_their_places():
    pl = scene()
    _, handles = projector(pl)
    picture = pl.screenshot(scale=2)
    for pixel in handles.pixels.values():
        x, y = (round(2 * v) for v in pixel)
        assert picture[2 * SIZE[1] - 1 - y, x].tolist() == YELLOW


def test_they_are_no_part_of_the_scene():
    pl = scene(lighting='none')
    pl.add_light(pv.Light(position=(1, 1, 3), light_type='scene light'))
    shadows, lens = pl.ibr.add(pvibr.Shadows()), pl.ibr.add(pvibr.DepthOfField())
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    pl.show(auto_close=False)

    def facts():
        pl.render()
        report = [e.report()['receivers'] for e in (shadows, photo)]
        return *report, pl.ibr.buffer('id').tobytes(), pl.ibr.buffer('depth').tobytes(), pl.bounds

    before = facts()
    projector_handles(pl, photo)
    light_handles(pl, pl.renderer.lights[0])
    focus = pick_focus(pl, lens)
    assert facts() == before
    assert focus.enabled


@pytest.mark.parametrize(
    ('arguments', 'error', 'words'),
    [
        ({'photo': 3}, TypeError, 'photo = 3'),
        ({'view': 1}, ValueError, 'view = 1'),
        ({'size': 2}, ValueError, 'size = 2'),
        ({'callback': 7}, TypeError, 'callback = 7'),
        ({'pl': 5}, TypeError, 'pl = 5'),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(arguments, error, words):
    pl = scene()
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    given = {'pl': pl, 'photo': photo} | arguments
    refused(words, projector_handles, kind=error, **given)
    assert not flat_props(pl.renderer)
    refused('in no subplot', projector_handles, pl, pvibr.Projector(PICTURE, camera_of('camera')))


def lit(shift=0.0, **settings):
    pl = scene(shift, lighting='none')
    light = pv.Light(light_type='scene light', **settings)
    pl.add_light(light)
    shadows = pl.ibr.add(pvibr.Shadows(resolution=256))
    handles = light_handles(pl, light)
    pl.show(auto_close=False)
    return pl, light, shadows, handles


SPOT = {'positional': True, 'cone_angle': 25.0, 'position': (1, -1, 4), 'focal_point': (0, 0, 0)}


@pytest.mark.parametrize(
    ('settings', 'names'),
    [
        ({'position': (1, 1, 3)}, ['direction']),
        ({'position': (1, 1, 3), 'positional': True, 'cone_angle': 90}, ['position']),
        (SPOT, ['position', 'aim', 'angle']),
    ],
)
def test_each_kind_of_light_has_its_handles(hand, settings, names):
    pl, light, _, handles = lit(**settings)
    assert list(handles.pixels) == names
    for name in names:
        start = np.array(handles.pixels[name])
        before, picture = (light.position, light.focal_point, light.cone_angle), pl.screenshot()
        goal = np.add(start, {'angle': (14, 0), 'direction': (-14, -12)}.get(name, (14, -3)))
        hand(pl).drag(start, goal)
        assert near(handles.pixels[name], goal, 4 if name == 'angle' else 1.5)
        assert (light.position, light.focal_point, light.cone_angle) != before
        assert (pl.screenshot() != picture).any()


def test_the_handles_are_those_of_the_kind_that_it_is_now():
    pl, light, _, handles = lit(**SPOT)
    light.positional = False
    pl.render()
    assert list(handles.pixels) == ['direction']
    light.positional = True
    light.cone_angle = 90
    pl.render()
    assert list(handles.pixels) == ['position']


def test_a_direction_keeps_its_length_and_is_on_either_side(hand):
    pl, light, _, handles = lit(position=(10, 10, 30))
    length, eye = np.linalg.norm(light.position), np.array(pl.camera.position)
    keys = hand(pl)
    keys.keys('Tab')
    away = []
    for key in ('Prior', 'Next', 'Prior'):
        keys.keys(key)
        away.append(np.linalg.norm(handles._look()['direction'] - eye))
        assert np.isclose(np.linalg.norm(light.position), length)
    assert away[1] < away[0] - 1
    assert np.isclose(away[0], away[2])


def test_a_camera_light_is_moved_where_it_is_seen(hand):
    pl = scene(lighting='none')
    light = pv.Light(position=(0.5, 0.3, 1), light_type='camera light')
    pl.add_light(light)
    handles = light_handles(pl, light)
    pl.show(auto_close=False)
    start = np.array(handles.pixels['direction'])
    hand(pl).drag(start, np.add(start, [15, 10]))
    assert near(handles.pixels['direction'], np.add(start, [15, 10]))
    assert light.is_camera_light


def test_the_frustum_of_its_shadows_holds_the_scene(hand):
    pl, light, shadows, handles = lit(**SPOT)
    (view,) = shadows.views_of(light)
    assert not len(handles._lines()[1][0])  # until one of its handles is selected
    handles.focus('aim')
    _, (edges, _), _ = handles._lines()
    assert edges.shape == (12, 2, 3)
    texture = view.texture_from_world() @ np.column_stack([edges.reshape(-1, 3), np.ones(24)]).T
    texture = (texture[:3] / texture[3]).T
    assert np.allclose(np.minimum(texture, 1 - texture), 0, atol=1e-6)  # corners, all of them
    hand(pl).drag(handles.pixels['position'], (100, 200))
    (moved,) = shadows.views_of(light)
    assert moved.key() != view.key()
    shadows.enabled = False
    pl.render()
    assert shadows.views_of(light) == []
    assert len(handles._lines()[1][0]) == 0


def test_hovering_names_and_highlights(hand):
    pl, _, _, handles = lit(**SPOT)
    lens = pl.ibr.add(pvibr.DepthOfField())
    focus, bar = pick_focus(pl, lens), time_bar(pl, 0, 4)
    mouse = hand(pl)
    assert focus.pick((SIZE[0] // 2, SIZE[1] // 2))
    pl.render()
    plain = pl.screenshot()
    shown = {
        'aim': (handles, handles.pixels['aim']),
        'focus': (focus, focus._pixel + 4),
        'play': (bar, (28, 28)),
        'time 0.00 s': (bar, (70, 28)),
    }
    for word, (overlay, pixel) in shown.items():
        mouse.move(pixel)
        assert overlay._marks._text.GetInput().strip() == word
        picture = pl.screenshot().astype(int)
        assert (picture != plain).any()
        y, x = SIZE[1] - 1 - round(pixel[1]), round(pixel[0])
        around = picture[max(y - 14, 0) : y + 14, max(x - 14, 0) : x + 14]
        assert (np.abs(around - HOVERED).max(2) < 12).sum() > 20
    assert len(handles._lines()[1][0]) == 0
    mouse.move(handles.pixels['position'])
    assert len(handles._lines()[1][0]) == 12
    frames = []
    pl.renderer.AddObserver('EndEvent', lambda *_: frames.append(1))
    mouse.move(np.add(handles.pixels['position'], 2))
    assert not frames  # the same
    mouse.move((SIZE[0] - 2, SIZE[1] - 2))
    np.testing.assert_array_equal(pl.screenshot(), plain)
    handles.remove()
    mouse.move((100, 100))


def test_lights_go_and_headlights_have_no_handles():
    pl, light, _, handles = lit(**SPOT)
    pl.renderer.RemoveLight(light)
    pl.render()
    assert not handles.enabled
    head = pv.Light(light_type='headlight')
    refused('in no subplot', light_handles, pl, head)
    pl.add_light(head)
    refused('headlight', light_handles, pl, head)
    refused('light = 4', light_handles, pl, 4, kind=TypeError)


def lens_scene(parallel=False, **settings):
    pl = pv.Plotter(window_size=SIZE, **settings)
    for k, x in enumerate((-1.0, 0.0, 1.0)):
        pl.add_mesh(pv.Plane(center=(x, 0, k), direction=(0, 0, 1)), color='white', lighting=False)
    pl.camera_position = [(0, 0, 8), (0, 0, 0), (0, 1, 0)]
    if parallel:
        pl.enable_parallel_projection()
        pl.camera.parallel_scale = 2
    lens = pl.ibr.add(pvibr.DepthOfField(radius=0.01))
    focus = pick_focus(pl, lens)
    pl.show(auto_close=False)
    return pl, lens, focus


def pixel_of(pl, point):
    pl.renderer.SetWorldPoint(*point, 1)
    pl.renderer.WorldToDisplay()
    return pl.renderer.GetDisplayPoint()[:2]


@pytest.mark.parametrize('parallel', [False, True])
def test_what_is_clicked_on_is_in_focus(hand, parallel):
    pl, lens, _ = lens_scene(parallel)
    place = pl.camera.position
    for k, x in enumerate((-1.0, 0.0, 1.0)):
        hand(pl).drag(pixel_of(pl, (x, 0, k)))
        assert np.isclose(lens.distance, 8 - k, rtol=1e-4)
    assert pl.camera.position == place


def test_a_drag_goes_on_with_one_look_at_the_depth(hand, monkeypatch):
    pl, lens, focus = lens_scene()
    told, looks = [], []
    focus.callbacks.append(lambda lens: told.append(round(lens.distance)))
    read = type(lens.pipeline).buffer
    monkeypatch.setattr(type(lens.pipeline), 'buffer', lambda *a: looks.append(1) or read(*a))
    hand(pl).drag(*(pixel_of(pl, (x, 0, k)) for k, x in enumerate((-1.0, 0.0, 1.0))))
    assert told == [8, 7, 6]
    assert len(looks) == 1


def test_the_background_turns_the_camera(hand):
    pl, lens, _ = lens_scene()
    place = pl.camera.position
    hand(pl).drag((5, 5), (40, 30))
    assert pl.camera.position != place
    assert lens.distance is None


def test_what_is_behind_the_plane_is_tinted_while_it_is_picked(hand):
    pl, lens, focus = lens_scene()
    hand(pl).drag(pixel_of(pl, (0.3, 0.3, 1)))
    lens.distance = 7.01

    def colours():
        pl.render()
        picture = pl.screenshot()
        at = [pixel_of(pl, (x, -0.3, k)) for k, x in enumerate((-1.0, 0.0, 1.0))]
        return [picture[SIZE[1] - 1 - round(y), round(x)].tolist() for x, y in at]

    far, middle, front = colours()
    assert far != [255, 255, 255]
    assert middle == front == [255, 255, 255]
    lens.distance = 6.99
    assert colours()[1] == far
    focus.enabled = False
    assert colours() == [[255, 255, 255]] * 3
    focus.enabled = True
    assert colours()[0] == far
    focus.remove()
    assert colours() == [[255, 255, 255]] * 3


def test_escape_ends_it_and_the_focus_stays(hand):
    pl, lens, focus = lens_scene()
    hand(pl).drag(pixel_of(pl, (0, 0, 1)))
    hand(pl).keys('Escape')
    assert not focus.enabled
    assert np.isclose(lens.distance, 7)
    place = pl.camera.position
    hand(pl).drag(pixel_of(pl, (1, 0, 2)), (40, 40))
    assert pl.camera.position != place
    assert np.isclose(lens.distance, 7)
    assert not flat_props(pl.renderer)
    assert not [p for p in pl.renderer.GetViewProps() if p.HasTranslucentPolygonalGeometry()]


def test_focus_by_keys(hand):
    pl, lens, _ = lens_scene()
    keys = hand(pl)
    keys.keys('Tab', 'Right')
    assert np.isclose(lens.distance, 7)  # ten pixels beside the middle
    keys.keys('Prior')
    assert np.isclose(lens.distance, 7 / 0.95)
    keys.keys('Next', 'Next')
    assert np.isclose(lens.distance, 7 * 0.95)
    keys.keys(*['Left'] * 6)
    assert np.isclose(lens.distance, 8)


def test_handles_go_before_the_scene(hand):
    pl, lens, _ = lens_scene()
    photo = pl.ibr.add(pvibr.Projector(PICTURE, camera_of('camera')))
    handles = projector_handles(pl, photo)
    pl.render()
    hand(pl).drag(handles.pixels['aim'], (200, 130))
    assert lens.distance is None
    assert photo.cameras[0].focal_point != (0, 0, 0)


def test_focus_goes_with_the_lens():
    pl, lens, focus = lens_scene()
    pl.ibr.remove(lens)
    pl.render()
    assert not focus.enabled
    refused('lens = 1', pick_focus, pl, 1, kind=TypeError)
    refused('in no subplot', pick_focus, pl, lens)
