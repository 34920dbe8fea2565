"""Many photographs on one mesh: what is painted, by rays; what it looks like, by known colours."""

import re

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from scipy import ndimage

import pvibr
from benchmarks.common.rays import Rays, edge_band
from pvibr.capture.adaptive_quality import AdaptiveQuality
from pvibr.photos.photo_choice import Surface, Visibility, choose
from pvibr.photos.photo_sources import load_small, sources_of
from pvibr.photos.picture_sheet import Squares
from pvibr.things.frame import Frame
from pvibr.visibility.embree_rays import Rays as Occlusion
from tests.makers import turn_of
from tests.pictures import places
from tests.refusals import refused

SIZE = (200, 150)


def colour_of(points):
    """Smooth colours of places."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    waves = np.stack([np.sin(3 * x + z), np.sin(3 * y), np.cos(2 * x + 2 * y)], axis=-1)
    return 120 + 60 * waves


def ground(seed):
    """Hills with a wall and a ball on them, which hide parts of each other."""
    rng = np.random.default_rng(seed)
    plane = pv.Plane(i_size=4, j_size=4, i_resolution=40, j_resolution=40).triangulate()
    points = np.array(plane.points, float)
    for _ in range(6):
        x, y = rng.uniform(-2, 2, 2)
        away = (points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2
        points[:, 2] += rng.uniform(0.1, 0.4) * np.exp(-4 * away)
    plane.points = points
    wall = pv.Cube(center=(0.4, 0.3, 0.4), x_length=0.2, y_length=1.5, z_length=1.2)
    wall = wall.triangulate().subdivide(3)
    ball = pv.Sphere(radius=0.3, center=(-0.8, -0.5, 0.7), theta_resolution=20, phi_resolution=20)
    return (plane + wall + ball).extract_surface(algorithm=None).triangulate().clean()


def cameras(count, seed):
    rng = np.random.default_rng(seed)
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        eye = np.array([3.5 * np.cos(angle), 3.5 * np.sin(angle), 2.5]) + rng.normal(0, 0.1, 3)
        R = turn_of(-eye)
        K = [[175.0, 0, 99.5], [0, 175.0, 74.5], [0, 0, 1]]
        lens = (-0.08, 0.01, 1e-3, 0)
        yield pvibr.Pinhole(K, R, -R @ eye, SIZE, lens)


def photographs(mesh, folder, count, seed, exposures=True, colors_at=None):
    """Photographs of known colours by rays, each of another exposure."""
    rng = np.random.default_rng(seed)
    found = []
    for k, camera in enumerate(cameras(count, seed)):
        origins, ahead = camera.rays(places(SIZE).reshape(-1, 2))
        points = first_hits(mesh, origins, ahead)
        colors = colors_at(points, camera.position) if colors_at else colour_of(points)
        colors = np.nan_to_num(colors, nan=30.0)
        colors = colors * (rng.uniform(0.8, 1.2) if exposures else 1.0)
        picture = np.rint(np.clip(colors, 0, 255)).astype(np.uint8).reshape(SIZE[1], SIZE[0], 3)
        Image.fromarray(picture).save(folder / f'{k}.png')
        found.append(pvibr.Photo(f'{k}.png', camera, folder / f'{k}.png'))
    return pvibr.Photos(found)


def first_hits(mesh, origins, ahead):
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    corners = np.ascontiguousarray(mesh.points[mesh.regular_faces], np.float32)
    TriangleMesh(scene, corners)
    ways = origins.astype(np.float32), ahead.astype(np.float32)
    away = scene.run(*ways, query='DISTANCE')
    return np.where((away < 1e6)[:, None], origins + away[:, None] * ahead, np.nan)


def window(mesh, photos, place=((1.0, -4.5, 3.5), (0, 0, 0.2), (0, 0, 1)), **settings):
    pl = pv.Plotter(off_screen=True, window_size=(200, 150), lighting='none')
    painted = pl.ibr.add_photos(mesh, photos, color='magenta', **settings)
    pl.camera_position = place
    pl.show(auto_close=False)
    return pl, painted


@pytest.fixture(scope='module')
def made(tmp_path_factory):
    mesh = ground(3)
    return mesh, photographs(mesh, tmp_path_factory.mktemp('photos'), 10, 3)


def seen_by(mesh, photos, surface):
    """Return whether each camera sees the place of each pixel, (photos, h, w), by rays."""
    rays, found = Occlusion([mesh]), []
    points, normals = surface.points.reshape(-1, 3), surface.normals.reshape(-1, 3)
    for photo in photos:
        toward = photo.camera.toward(points)
        uv, _ = photo.camera.project(points)
        with np.errstate(invalid='ignore'):
            inside = ((uv >= 0) & (uv <= 1)).all(1)
        facing = np.einsum('ij,ij->i', normals, toward)
        out = np.where(facing[:, None] < 0, -normals, normals)
        reach = np.linalg.norm(photo.position - points, axis=1)
        ok = inside & (facing > np.cos(np.radians(85))) & surface.hit.ravel()
        ok[ok] = rays.free(points[ok], out[ok], toward[ok], reach[ok])
        found.append(ok.reshape(surface.hit.shape))
    return np.array(found)


def settled(shown, true, where):
    """Return a picture with the exposure of another, which photographs alone do not tell."""
    return shown * np.median(true[where] / np.maximum(shown[where], 1), axis=0)


def house():
    """Few large triangles: a floor, a wall and a roof, of which each hides parts of others."""
    floor = pv.Plane(i_size=4, j_size=4, i_resolution=1, j_resolution=1)
    wall = pv.Cube(center=(0.4, 0.3, 0.6), x_length=0.2, y_length=1.5, z_length=1.2)
    roof = pv.Cone(center=(-0.9, -0.5, 0.45), direction=(0, 0, 1), height=0.9, resolution=4)
    return pv.merge([floor, wall, roof]).extract_surface(algorithm=None).triangulate().clean()


@pytest.mark.parametrize('large', [False, True])
def test_one_surface_of_what_cameras_see(made, large, tmp_path):
    """By rays: all that is seen is painted and nothing else, in one exposure, without steps."""
    mesh, photos = (house(), photographs(house(), tmp_path, 8, 77)) if large else made
    pl, painted = window(mesh, photos)
    surface = Rays([mesh]).surface(Frame.of(pl.renderer))
    seen = seen_by(mesh, photos, surface).any(0)
    inside = ndimage.binary_erosion(surface.hit & ~edge_band(surface.hit.astype(float), surface))
    assert inside.mean() > 0.3
    true = np.nan_to_num(colour_of(surface.points))
    steps, losses = {}, {}
    for level in ('seams', 'none'):
        painted.level = level
        pl.render()
        shown = pl.screenshot(return_img=True).astype(float)
        bare = np.abs(shown - [255, 0, 255]).max(-1) < 2
        assert (bare & seen & inside).sum() / inside.sum() < 1e-3
        assert (~bare & ~seen & inside).sum() / inside.sum() < 1e-3
        where = inside & seen & ~bare
        off = settled(shown, true, where) - true
        step = np.abs(np.diff(off, axis=1)).max(-1)[where[:, 1:] & where[:, :-1]]
        steps[level], losses[level] = np.percentile(step, 99), np.mean(off[where] ** 2)
    assert painted.pick(100, 60).index < mesh.n_cells
    assert steps['seams'] <= 8
    assert losses['seams'] < 0.5 * losses['none']


def test_what_has_moved_is_left_out(made, tmp_path):
    mesh, photos = made
    changed = []
    for k, photo in enumerate(photos):
        picture = np.asarray(Image.open(photo.path)).copy()
        if k == 7:
            picture[56:125, 38:162] = 255
        Image.fromarray(picture).save(tmp_path / photo.name)
        changed.append(pvibr.Photo(photo.name, photo.camera, tmp_path / photo.name))
    worst = {}
    for name, given in (('before', photos), ('after', changed)):
        pl, _ = window(mesh, given)
        worst[name] = pl.screenshot(return_img=True).astype(float)
        pl.close()
    assert (np.abs(worst['after'] - worst['before']).max(-1) > 60).mean() < 0.01
    mask = np.full((SIZE[1], SIZE[0]), 255, np.uint8)
    mask[56:125, 38:162] = 0
    masked = pvibr.PhotoMesh(mesh, changed, masks=[mask if k == 7 else None for k in range(10)])
    there = masked.choice.photos == 7
    middles = masked.choice.points[masked.choice.faces].mean(1)
    uv, _ = photos[7].camera.project(middles[there.any(1)])
    x, y = uv[:, 0] * SIZE[0], (1 - uv[:, 1]) * SIZE[1]
    assert not ((x > 39) & (x < 161) & (y > 57) & (y < 124)).any()


def glossy(points, eye):
    """Colours of places with a light's reflection, which is elsewhere for another eye."""
    away = eye - points
    away /= np.linalg.norm(away, axis=-1, keepdims=True)
    shine = np.clip(away @ [0.0, -0.86, 0.51], 0, 1) ** 24
    return colour_of(points) + 60 * shine[..., None]


@pytest.fixture(scope='module')
def gloss(tmp_path_factory):
    mesh = ground(4)
    return mesh, photographs(mesh, tmp_path_factory.mktemp('gloss'), 24, 4, False, glossy)


def test_an_eye_near_photographs_sees_what_they_do(gloss):
    """Where a photograph that is left out was taken, from those beside it: the truth by rays."""
    mesh, photos = gloss
    for number in (16, 19):
        others = [photo for k, photo in enumerate(photos) if k != number]
        pl, painted = window(mesh, others)
        pl.camera = photos[number].to_pyvista()
        losses = {}
        for painted.blend in ('view', 'feather'):
            pl.render()
            shown = pl.screenshot(return_img=True).astype(float)
            surface = Rays([mesh]).surface(Frame.of(pl.renderer))
            true = np.nan_to_num(glossy(surface.points, photos[number].position))
            inside = ndimage.binary_erosion(surface.hit, iterations=2)
            inside &= np.abs(shown - [255, 0, 255]).max(-1) > 2
            losses[painted.blend] = np.mean((settled(shown, true, inside) - true)[inside] ** 2)
        pl.close()
        assert losses['view'] < 0.7 * losses['feather']


def test_a_choice_made_anew_forgets_the_view(gloss):
    """Its points are others: the next frame at rest finds their shares."""
    mesh, photos = gloss
    pl, painted = window(mesh, photos, max_angle=40.0)
    assert painted._view_photos
    painted.max_angle = 85.0
    painted._choose()
    assert not painted._view_photos
    pl.render()
    shown = pl.screenshot(return_img=True).astype(int)
    pl.close()
    pl, _ = window(mesh, photos)
    np.testing.assert_array_equal(shown, pl.screenshot(return_img=True))


def test_photographs_of_a_view_show_what_they_see_and_never_jump(gloss):
    """By rays: no share where something hides the point; an eye that moves changes little."""
    mesh, photos = gloss
    pl, painted = window(mesh, photos)
    views, before, steps = painted._views, None, []
    for angle in np.radians(np.arange(270.0, 286.0, 0.1)):
        pl.camera_position = [
            (3.5 * np.cos(angle), 3.5 * np.sin(angle), 2.5),
            (0, 0, 0),
            (0, 0, 1),
        ]
        needs, shares = views.of(Frame.of(pl.renderer), painted.matrix)
        assert (shares >= 0).all()
        assert (shares.sum(1) < 1).all()
        now = np.zeros((len(shares), len(photos)))
        now[:, list(needs)] = shares[:, : len(needs)]
        assert now.max() > 0.5
        if before is not None:
            steps.append(np.abs(now - before).mean(0).max())
        before = now
    assert max(steps) < 0.01
    points, normals = views.surface.points, views.surface.outward
    for number in needs:
        rows, part = views._coverage(number)
        rows = rows[part > 0]
        assert len(rows) > 100
        toward = photos[number].camera.toward(points[rows])
        reach = np.linalg.norm(photos[number].position - points[rows], axis=1)
        free = Occlusion([mesh]).free(points[rows], normals[rows], toward, reach)
        assert free.mean() > 0.999


def test_memory_holds_small_versions_and_what_the_view_needs(made):
    mesh, photos = made
    plenty = window(mesh, photos)
    scarce = window(mesh, photos, memory=2.0)
    reports = [painted.report() for _, painted in (plenty, scarce)]
    assert reports[0]['small'] == '1/1'
    assert reports[0]['bytes'] >= 10 * 4 * SIZE[0] * SIZE[1]
    assert reports[1]['bytes'] <= 2 << 20
    assert reports[1]['small'] == '1/2'
    assert 1 <= reports[1]['larger'] <= 10
    pictures = [pl.screenshot(return_img=True).astype(int) for pl, _ in (plenty, scarce)]
    assert np.abs(pictures[0] - pictures[1]).mean() < 2
    pl, painted = scarce
    painted.remove()
    assert painted not in pl.actors.values()
    pl.ibr.add(painted)
    pl.render()
    assert np.abs(pl.screenshot(return_img=True).astype(int) - pictures[1]).max() <= 2
    painted.memory = 512.0
    pl.render()
    assert painted.report()['small'] == '1/1'
    painted.opacity = 0.0
    pl.render()
    bare = np.abs(pl.screenshot(return_img=True).astype(int) - [255, 0, 255]).max(-1) < 2
    assert bare.mean() > 0.3
    for pl, _ in (plenty, scarce):
        pl.close()


def test_moving_frames_are_near_and_still_ones_as_before(made, monkeypatch):
    """Of small triangles the colours of corners; of large ones two photographs."""
    mesh, photos = made
    quality = [1.0]
    monkeypatch.setattr(AdaptiveQuality, 'quality', lambda *_: quality[0])
    for place in (
        ((1.0, -25.0, 18.0), (0, 0, 0.2), (0, 0, 1)),
        ((1.0, -4.5, 3.5), (0, 0, 0), (0, 0, 1)),
    ):
        pl, _ = window(mesh, photos, place)
        pictures = []
        for quality[0] in (1.0, 0.8, 1.0):
            pl.render()
            pictures.append(pl.screenshot(return_img=True).astype(int))
        fine, moving, again = pictures
        np.testing.assert_array_equal(fine, again)
        assert (np.abs(moving - fine).max(-1) > 20).mean() < 0.01
        assert (moving != fine).any()
        pl.close()


def test_translucent_with_peeling_as_without(made):
    mesh, photos = made
    pictures = []
    for peels in (0, 4):
        pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
        if peels:
            pl.enable_depth_peeling(peels)
        painted = pl.ibr.add_photos(mesh, photos, color='magenta')
        painted.prop.opacity = 0.5
        pl.camera_position = [(0, 0, 9), (0, 0, 0), (0, 1, 0)]
        pl.show(auto_close=False)
        pictures.append(pl.screenshot(return_img=True).astype(int))
        pl.close()
    assert (np.abs(pictures[1] - pictures[0]).max(-1) > 8).mean() < 0.03  # the ball has two sides


def test_others_are_in_its_shadow(made):
    """Beside Shadows and Ground, whose shader text is in the same program."""
    mesh, photos = made[:2]
    pictures = []
    for casts in (True, False):
        pl, _ = window(mesh, photos, lit=True)
        pl.add_light(pv.Light(position=(3, -2, 6), light_type='scene light'))
        pl.ibr.add(pvibr.Ground(height=-0.6))
        pl.ibr.add(pvibr.Shadows(casts=None if casts else []))
        pl.render()
        pictures.append(pl.screenshot(return_img=True).astype(int))
    darker = (pictures[1] - pictures[0]).mean(2) > 10
    assert darker.sum() > 200


def test_choice_without_rays_is_alike(made):
    mesh, photos = made
    sources = load_small(sources_of(photos))
    surface = Surface(mesh.points, mesh.regular_faces)
    found = []
    for method in ('rays', 'map'):
        with Visibility([mesh], method) as visibility:
            choice = choose(surface, sources, visibility)
        painted = np.bincount(choice.origin, choice.photos[:, 0] >= 0) > 0
        found.append(painted)
    assert 0.5 < found[0].mean() < 1
    assert (found[0] != found[1]).mean() < 0.02


def test_baked_with_what_it_is_worth(made):
    mesh, photos = made
    painted = pvibr.PhotoMesh(mesh, photos)
    cells = painted.bake('cells')
    rows = np.flatnonzero(cells['photo'] >= 0)
    middles = cells.cell_centers().points[rows]
    true = colour_of(middles)
    off = settled(cells['projected'][rows, :3].astype(float), true, slice(None)) - true
    assert np.sqrt(np.mean(off**2)) < 8
    for k in np.unique(cells['photo'][rows]):
        mine = rows[cells['photo'][rows] == k]
        places, normals = cells.cell_centers().points[mine], cells.face_normals[mine]
        cosine = np.einsum('ij,ij->i', photos[k].camera.toward(places), normals)
        angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        assert np.abs(cells['angle'][mine] - angles).max() < 1
        away = np.linalg.norm(photos[k].position - places, axis=1)
        pixel = away / 175 * np.sqrt(1 / cosine)  # in the middle of a picture without a lens
        assert np.abs(np.median(cells['resolution'][mine] / pixel) - 1) < 0.1
    assert np.isnan(cells['angle'][cells['photo'] < 0]).all()
    plane = pv.Plane(i_size=2, j_size=2, i_resolution=6, j_resolution=6)
    flat = pvibr.PhotoMesh(plane, photos, level='none')
    _, image, quality = flat.bake(size=32, quality=True)
    assert image.shape == (32, 32, 4)
    assert image[..., 3].all()
    assert (quality['photo'] >= 0).all()
    assert set(quality) == {'photo', 'resolution', 'angle'}


def test_bad_input_is_refused(made):
    mesh, photos = made
    for error, match, wrong, masks in (
        (TypeError, 'must be photographs', ['a.jpg'], None),
        (ValueError, 'at least one', [], None),
        (ValueError, 'masks must have', photos, [None]),
        (ValueError, 'has no picture', pvibr.Photo('a.jpg', photos[0].camera), None),
    ):
        refused(match, pvibr.PhotoMesh, mesh, wrong, kind=error, masks=masks)
    refused(r"to must .*got 'paper'", pvibr.PhotoMesh(pv.Plane(), photos[:1]).bake, 'paper')


def test_that_a_mesh_is_inside_out_is_said(made):
    plane = pv.Plane(i_size=2, j_size=2).triangulate()
    with pytest.warns(pvibr.PvibrWarning, match='flip_faces'):
        pvibr.PhotoMesh(plane.flip_faces(), made[1][:1])
    assert (pvibr.PhotoMesh(plane, made[1][:1]).choice.photos >= 0).any()


@pytest.mark.parametrize('method', ['rays', 'map'])
def test_that_much_faces_inwards_is_said(made, method, recwarn):
    """Photographs see the backs of a quarter of the ground, or of a hundredth."""
    mesh, photos = made
    sources, points = load_small(sources_of(photos)), np.asarray(mesh.points)
    middles = points[mesh.regular_faces].mean(1)
    low = middles[:, 2] < 0.2
    corner, half = (middles[:, :2] < -1.6).all(1), middles[:, 0] < 0
    found = []
    for turned in (low & False, low & corner, low & half):
        faces = np.where(turned[:, None], mesh.regular_faces[:, ::-1], mesh.regular_faces)
        with Visibility([mesh], method) as visibility:
            choose(Surface(points, faces), sources, visibility)
        found.append([str(warning.message) for warning in recwarn.list])
        recwarn.clear()
    assert found[:2] == [[], []]
    assert re.match(r'[1-4]\d% of the surface in view of photographs is bare', found[2][0])


@pytest.mark.parametrize('seed', [1, 2])
def test_squares_come_back_whole(seed):
    rng, squares, taken = np.random.default_rng(seed), Squares(256, 2, 2), []
    for _ in range(300):
        side = int(2 ** rng.integers(4, 9))
        place = squares.take(side)
        if place is None or rng.random() < 0.3:
            for old in taken[: len(taken) // 2 + 1]:
                squares.give(*old)
            taken = taken[len(taken) // 2 + 1 :]
        if place is not None:
            taken.append((side, place))
            grid = np.zeros((512, 512), int)
            for width, (x, y) in taken:
                grid[y : y + width, x : x + width] += 1
            assert grid.max() == 1
    for old in taken:
        squares.give(*old)
    assert all(squares.take(256) for _ in range(4))


def test_masks_of_wide_lenses_cover_what_they_mask(tmp_path):
    size = (240, 120)
    K = [[240 / (2 * np.pi), 0, 119.5], [0, 240 / (2 * np.pi), 59.5], [0, 0, 1]]
    camera = pvibr.LensCamera(K, np.eye(3), np.zeros(3), size, pvibr.Lens('spherical'))
    Image.new('RGB', size, 'teal').save(tmp_path / 'round.png')
    mask = np.zeros((120, 240), np.uint8)
    mask[:60] = 255  # what is above the horizon
    sources = sources_of([pvibr.Photo('round', camera, tmp_path / 'round.png')], [mask])
    assert len(sources) == 6
    for source in sources:
        seen = source.load(0)[..., 3] > 0
        grid = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in source.size)), -1)
        uv = (grid / source.size).reshape(-1, 2) * [1, -1] + [0, 1]
        down = source.camera.rays(uv)[1][:, 1].reshape(seen.shape)
        clear = np.abs(down) > 0.1 * np.abs(down).max()
        np.testing.assert_array_equal(seen[clear], (down < 0)[clear])
