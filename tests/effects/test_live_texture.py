"""Live textures: the picture that the camera would take, drawn only when it changes."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import place, shot, shown
from tests.refusals import refused

SIZE = (128, 96)


def camera(position=(4, -3, 3)):
    found = pv.Camera()
    found.position, found.focal_point, found.up = position, (0, 0, 0), (0, 0, 1)
    return found


def plotter(**kwargs):
    pl = pv.Plotter(**({'window_size': SIZE} | kwargs))
    pl.set_background('#203040')
    return pl


def scene(pl):
    ball = pl.add_mesh(pv.Sphere(), color='red', smooth_shading=True)
    box = pv.Cube(center=(0.4, 0.7, 0.2), x_length=0.6, y_length=0.6, z_length=0.6)
    pl.add_mesh(box, color='lime', opacity=0.5)
    return ball


def screen(pl, live, center=(0.0, 0.0, 9.0), side=2.0):
    """A plate that faces up and fills a view from above."""
    plate = pv.Plane(center=center, i_size=side, j_size=side * SIZE[1] / SIZE[0])
    actor = pl.add_mesh(plate, color='white', lighting=False)
    actor.texture = live.texture
    return actor


def look_down(pl, height, side=2.0):
    half = side / 2 * SIZE[1] / SIZE[0]
    place(pl, (0, 0, height), up=(0, 1, 0), parallel=half, clip=(0.5, 30))


def worn(**settings):
    """Return a plotter whose window is filled by a live texture of a scene."""
    pl = plotter()
    ball = scene(pl)
    seen = list(pl.actors.values())
    live = pl.ibr.add(pvibr.LiveTexture(camera(), actors=seen, size=SIZE, **settings))
    screen(pl, live)
    look_down(pl, 12)
    pl.show(auto_close=False)
    return pl, live, ball


def test_it_is_what_the_camera_sees():
    pl, _, _ = worn()
    found = shot(pl)
    other = plotter()
    scene(other)
    other.camera = camera()
    other.renderer.ResetCameraClippingRange()
    expected = shown(other)
    off = np.abs(found - expected).max(axis=2)
    assert np.median(off) <= 1
    assert off.mean() < 3  # edges are smooth in one of them
    assert (found[..., 0] > 150).mean() == pytest.approx((expected[..., 0] > 150).mean(), abs=0.01)


def test_it_is_drawn_only_when_something_changed():
    pl, live, ball = worn()
    for _ in range(2):
        pl.render()
    draws, before = live.draws, shot(pl)
    pl.camera.position = (0, 0, 12.5)  # not seen by the other camera
    shot(pl)
    assert live.draws == draws
    ball.position = (0, -0.5, 0)
    moved = shot(pl)
    assert live.draws == draws + 1
    assert np.abs(moved - before).max() > 50
    live.camera.position = (5, 0, 1)
    assert np.abs(shot(pl) - moved).max() > 50
    assert live.draws == draws + 2
    live.background = (1, 1, 0, 1)
    assert (shot(pl) == [255, 255, 0]).all(axis=2).mean() > 0.3
    ball.prop.color = 'blue'
    assert (shot(pl)[..., 2] > 150).mean() > 0.02


def test_depth_is_white_near():
    pl, _, _ = worn(what='depth')
    found = shot(pl)
    assert (found[..., 0] == found[..., 1]).all()
    assert found[0, 0].tolist() == [0, 0, 0]
    assert found[40:56, 56:72].min() > 60
    assert found.max() <= 255


def test_one_live_texture_in_another_and_in_itself_settle():
    pl = plotter()
    scene(pl)
    lives = [
        pl.ibr.add(pvibr.LiveTexture(camera(p), size=(64, 48))) for p in [(4, -3, 3), (-4, -3, 3)]
    ]
    for k, live in enumerate(lives):
        screen(pl, live, center=(2.0 * k - 1, 1.5, 0.5), side=1.0)
    place(pl, (0, -6, 4))
    pl.show(auto_close=False)
    for _ in range(3):
        shot(pl)
    draws, one = [live.draws for live in lives], shot(pl)
    assert np.array_equal(shot(pl), one)
    assert [live.draws for live in lives] == draws


def hang_mirror(pl, y, width, height, **settings):
    """Add a mirror in the plane of a y, which looks towards -y, or +y if its width is negative."""
    corner = (-width / 2, y, -height / 2)
    live = pl.ibr.add(pvibr.Mirror(corner, (width, 0, 0), (0, 0, height), **settings))
    plate = pv.Plane(center=(0, y, 0), direction=(0, -1, 0), i_size=height, j_size=abs(width))
    uv = (plate.points[:, [0, 2]] - [corner[0], corner[2]]) / [width, height]
    plate.active_texture_coordinates = uv.astype(np.float32)
    pl.add_mesh(plate, lighting=False, color='white').texture = live.texture
    return live


def test_a_mirror_shows_what_a_twin_behind_it_would():
    def make(mirrored):
        pl = plotter(window_size=(300, 200))
        ball = pv.Sphere(radius=0.5, center=(0.4, 0.0, 0.3))
        cone = pv.Cone(center=(-0.6, -0.2, 0), direction=(0, 0, 1), resolution=24)
        for mesh, color in ((ball, 'red'), (cone, 'gold')):
            looks = {'color': color, 'lighting': False}
            real = pl.add_mesh(mesh, **looks)
            if not mirrored:
                real.visibility = False
                twin = mesh.copy()
                twin.points = twin.points * [1, -1, 1] + [0, 4, 0]
                pl.add_mesh(twin, **looks)
        if mirrored:
            assert 'Mirror' in repr(hang_mirror(pl, 2, 6, 4).name)
        # From between, so that what is mirrored is not in the way.
        place(pl, (0.3, 1.0, 1.0), (0, 2.5, 0.5), angle=60, clip=(0.1, 20))
        pl.show(auto_close=False)
        return shot(pl)

    mirror, twin = make(True), make(False)
    seen = (twin != twin[0, 0]).any(axis=2)
    assert 0.02 < seen.mean() < 0.6
    off = np.abs(mirror - twin).max(axis=2)
    assert (off > 60).mean() < 0.1 * seen.mean()


def unfolded(pl, count):
    """Two balls and what two mirrors show of them, as that many copies behind one."""
    for (x, y, z), color in (((0.5, 0.3, 0.2), 'red'), ((-0.5, -0.5, -0.1), 'gold')):
        for k in range(count):
            center = (x, 4 * k + (y if k % 2 == 0 else -y), z)
            pl.add_mesh(pv.Sphere(radius=0.3, center=center), color=color, lighting=False)


@pytest.mark.parametrize('depth', [0, 1, 3])
def test_mirrors_that_face_each_other_show_the_unfolded_scene(depth):
    found = []
    for mirrored in (True, False):
        pl = plotter(window_size=(160, 120))
        unfolded(pl, 1 if mirrored else depth + 2)
        for y, right in ((2, 6), (-2, -6)) if mirrored else ():
            hang_mirror(pl, y, right, 6, recursion=depth)
        place(pl, (0, -1.5, 0.6), (0, 2, 0.2), angle=35, clip=(0.1, 60))
        pl.show(auto_close=False)
        found.append(shot(pl))
    psnr = 10 * np.log10(255**2 / ((found[0] - found[1]) ** 2).mean())
    assert psnr > 33


def test_instances_are_seen_too():
    pl = plotter()
    trees = pl.ibr.add_instances(
        pv.Sphere(radius=0.4), [[0, 0, 0], [1, 0, 0]], color='lime', bake=True
    )
    live = pl.ibr.add(pvibr.LiveTexture(camera(), actors=[trees], size=SIZE))
    screen(pl, live)
    look_down(pl, 12)
    found = shown(pl)
    assert (found[..., 1] > 100).mean() > 0.03


def test_removed_and_added_again():
    pl, live, _ = worn()
    on = shot(pl)
    pl.ibr.remove(live)
    shot(pl)
    pl.ibr.add(live)
    assert np.array_equal(shot(pl), on)


@pytest.mark.parametrize(
    ('match', 'call'),
    [
        *(
            ('size must be', lambda size=size: pvibr.LiveTexture(camera(), size=size))
            for size in [(0, 4), (4,), 'big', (4.5, 4)]
        ),
        ('camera', lambda: pvibr.LiveTexture('left')),
        ('perpendicular', lambda: pvibr.Mirror((0, 0, 0), (1, 0, 0), (1, 1, 0))),
        ('what', lambda: pvibr.LiveTexture(camera(), what='heat')),
    ],
)
def test_bad_arguments(match, call):
    refused(match, call, kind=(TypeError, ValueError))


def test_seen_small_it_is_a_mean():
    """It has levels: a fine chessboard that it shows is grey on a monitor far away."""
    pl = plotter()
    board = pv.Plane(i_size=8, j_size=8, i_resolution=128, j_resolution=128)
    board.cell_data['v'] = np.indices((128, 128)).sum(axis=0).ravel() % 2
    chess = pl.add_mesh(
        board, scalars='v', cmap='gray', lighting=False, show_scalar_bar=False, clim=[0, 1]
    )
    above = camera((0, 0, 5))
    above.up, above.parallel_projection, above.parallel_scale = (0, 1, 0), True, 4
    live = pl.ibr.add(pvibr.LiveTexture(above, actors=[chess], size=(256, 256)))
    pl.add_mesh(pv.Plane(center=(0, 0, 9)), lighting=False, color='w').texture = live.texture
    look_down(pl, 12, side=8.0)
    pl.show(auto_close=False)
    found = shot(pl)[44:52, 60:68]
    assert np.abs(found - 127.5).max() < 20


def test_it_can_be_projected_and_read():
    pl, live, _ = worn(background=(0, 0, 1, 1))
    pl.ibr.remove(live)
    refused('add it to a subplot', live.image, kind=RuntimeError)
    wall = pl.add_mesh(pv.Plane(center=(0, 0, 9.5), i_size=2, j_size=1.5), color='white')
    down = pv.Camera()
    down.position, down.focal_point, down.up = (0, 0, 12), (0, 0, 0), (0, 1, 0)
    down.parallel_projection, down.parallel_scale = True, 0.5
    projector = pl.ibr.add(pvibr.Projector(live, down, actors=[wall], occlusion=False, lit=False))
    before = shot(pl)
    assert 'live texture' in pl.ibr.report().rows[0].why
    pl.ibr.add(live)
    after = shot(pl)
    assert np.abs(after - before).max() > 50
    image = live.image()
    assert image.shape == (96, 128, 4)
    assert (image == [0, 0, 255, 255]).all(axis=2).mean() > 0.3
    # Twice as large as the window is the projector's picture: 64 x 64 pixels in the middle.
    found = after[32:64, 43:85]
    assert (found == [0, 0, 255]).all(axis=2).mean() > 0.2
    pl.ibr.remove(live)
    np.testing.assert_array_equal(shot(pl), before)
    assert projector.enabled
    with pytest.raises(ValueError, match='mask must be None for a live texture'):
        pvibr.Projector(live, down, mask=np.ones((4, 4)))


def test_one_that_sees_where_it_is_projected_settles():
    pl = plotter()
    scene(pl)
    wall = pl.add_mesh(pv.Plane(center=(0, 1.5, 0.5), direction=(0, -1, 0), i_size=3, j_size=4))
    live = pl.ibr.add(pvibr.LiveTexture(camera((1, -4, 2)), size=(64, 48)))
    front = camera((0, -5, 0.5))
    front.focal_point, front.view_angle = (0, 1.5, 0.5), 18
    pl.ibr.add(pvibr.Projector(live, front, actors=[wall], occlusion=False))
    place(pl, (1, -6, 3))
    pl.show(auto_close=False)
    for _ in range(3):
        shot(pl)
    draws, one = live.draws, shot(pl)
    assert [r.state for r in pl.ibr.report().rows] == ['ran', 'ran']
    assert np.array_equal(shot(pl), one)
    assert live.draws == draws


def in_a_room(pl, mirrors, depth, side, seed):
    """Add things between two walls: their mirrors, or what these show as meshes."""
    rng = np.random.default_rng(seed)
    for _ in range(5):
        mesh = pv.Sphere(radius=rng.uniform(0.15, 0.35)).translate(rng.uniform(-0.9, 0.9, 3))
        color = rng.uniform(0, 1, 3)
        for k in range(1 if mirrors else depth + 2):
            twin = mesh.copy()
            twin.points = twin.points * [1, (-1) ** k, 1] + [0, 2 * side * k, 0]
            pl.add_mesh(twin, color=color, lighting=False)
    for sign in (1, -1) if mirrors and depth else (1,) if mirrors else ():
        hang_mirror(pl, side * sign, 8 * sign, 8, size=(1024, 1024), recursion=depth)


@pytest.mark.sampled
@pytest.mark.parametrize(('seed', 'focus'), [(0, (0, 1.2, 0)), (3, (0.5, 1.2, 0.15))])
@pytest.mark.parametrize('depth', [0, 1, 3])
def test_mirrors_in_parallel_projection_show_the_unfolded_scene(depth, seed, focus):
    found = []
    for mirrors in (True, False):
        pl = plotter(window_size=(200, 150))
        pl.render_window.SetMultiSamples(0)
        in_a_room(pl, mirrors, depth, 1.2, seed)
        place(pl, (0.1, -0.9, 0.25), focus, parallel=1.3, clip=(0.01, 60))
        pl.show(auto_close=False)
        found.append(shot(pl))
    assert (found[1] != found[1][0, 0]).any(-1).mean() > 0.1
    psnr = 10 * np.log10(255**2 / ((found[0] - found[1]) ** 2).mean())
    assert psnr > 30


def test_a_mirror_follows_from_one_projection_to_the_other_and_when_the_view_turns():
    pl = plotter(window_size=(100, 75))
    in_a_room(pl, True, 0, 1.2, 2)
    place(pl, (0.1, -3, 0.25), (0, 1.2, 0), clip=(0.01, 60))
    pl.show(auto_close=False)
    (live,) = pl.ibr.effects
    seen = [shot(pl)]
    for change in (
        lambda: setattr(pl.camera, 'parallel_projection', True),
        lambda: pl.camera.Azimuth(15),
        lambda: setattr(pl.camera, 'parallel_projection', False),
    ):
        draws = live.draws
        change()
        seen.append(shot(pl))
        assert live.draws == draws + 1
        assert (seen[-1] != seen[-2]).any()
    shot(pl)
    assert live.draws == draws + 1


def test_a_mirror_of_an_actor_lies_where_it_is():
    pl = pv.Plotter(window_size=(60, 40))
    plane = pv.Plane(center=(1, 2, 3), direction=(0, -1, 1), i_size=2, j_size=5)
    actor = pl.add_mesh(plane)
    actor.position = (0, 0, 7)
    live = pvibr.Mirror(actor)
    uv, points = plane.active_texture_coordinates, plane.points + np.array([0, 0, 7])
    found = live.corner + uv[:, :1] * live.right + uv[:, 1:] * live.up
    np.testing.assert_allclose(found, points, atol=1e-5)
    refused('corner must', pvibr.Mirror, pl.add_mesh(pv.Sphere()))
    refused('right and up must be given', pvibr.Mirror, (0, 0, 0), kind=TypeError)
