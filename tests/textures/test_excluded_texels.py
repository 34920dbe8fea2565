"""Filters mix in nothing that is masked out, transparent or no number, in every mip level.

An object of one colour lies among garbage that is excluded: whatever interpolates, magnified or
minified, shows that colour, or the one of what is behind it, and nothing else.
"""

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from pvibr.gl import MipTexture, Target, release
from pvibr.gl.hidden_window import hidden_window
from pvibr.gl.mipmaps import Level, copy
from pvibr.maths.draping import sample
from pvibr.maths.filled_texels import filled
from pvibr.textures.projected import Shown, resized, upload
from tests.pictures import plotter, shot

GRAY = 200
SIZES = (64, 48), (61, 37)
#: Half heights of views: from 8 pixels per texel to 60 texels per pixel.
SCALES = 0.1, 0.5, 2.0, 30.0
EXTENT = -2, 2, -1.5, 1.5
ABOVE = pvibr.Orthographic.from_extent(*EXTENT, zmax=3)


def cut_out(size, garbage):
    """An object with holes among garbage, (h, w, 3), and its mask, uint8."""
    (width, height), (x, y) = size, np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    mask = np.hypot((x - 0.45 * width) / (0.3 * width), (y - 0.5 * height) / (0.31 * height)) < 1
    mask &= (x // 3 + y // 5) % 4 > 0
    return np.where(
        mask[..., None], np.uint8([GRAY] * 3), np.uint8([garbage] * 3)
    ), mask * np.uint8(255)


def rgba(size, garbage):
    return np.dstack(cut_out(size, garbage))


def plane(resolution=1):
    return pv.Plane(
        i_size=4, j_size=3, i_resolution=resolution, j_resolution=resolution
    ).triangulate()


@pytest.fixture
def stage():
    """Return a plotter that looks down on the object's place."""
    pl = plotter(lighting='none')
    pl.enable_parallel_projection()
    pl.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
    yield pl
    pl.close()


def photograph(picture, folder):
    Image.fromarray(picture).save(folder / 'photo.png')
    height, width = picture.shape[:2]
    K = [[1.25 * width, 0, width / 2 - 0.5], [0, 1.25 * width, height / 2 - 0.5], [0, 0, 1]]
    R = np.diag([1.0, -1.0, -1.0])
    camera = pvibr.Pinhole(K, R, R @ [0, 0, -5.0], (width, height))
    return pvibr.Photo('photo.png', camera, folder / 'photo.png')


def add_masked_projector(pl, size, garbage, color, folder):
    picture, mask = cut_out(size, garbage)
    pl.add_mesh(plane(), color=color, lighting=False)
    pl.ibr.add(pvibr.Projector(picture, ABOVE, mask=mask))


def add_decal(pl, size, garbage, color, folder):
    pl.add_mesh(plane(), color=color, lighting=False)
    pl.ibr.add(pvibr.Projector(rgba(size, garbage), ABOVE, mode='decal'))


def add_film(pl, size, garbage, color, folder):
    pl.add_mesh(plane(), color=color, lighting=False)
    frames = [rgba(size, 255 - garbage), rgba(size, garbage)]
    pl.ibr.add(pvibr.Projector(frames, ABOVE, mode='decal', fps=1))
    pl.ibr.time = 1.0


def add_photos(pl, size, garbage, color, folder):
    picture, mask = cut_out(size, garbage)
    pl.ibr.add_photos(plane(20), [photograph(picture, folder)], masks=[mask], color=color)


def add_overlay(pl, size, garbage, color, folder):
    pl.ibr.add(pvibr.ImageOverlay(rgba(size, garbage)))


def add_small_overlay(pl, size, garbage, color, folder):
    pl.ibr.add(pvibr.ImageOverlay(rgba(size, garbage), place=(0.3, 0.3, 0.4, 0.5)))


def add_billboard(pl, size, garbage, color, folder):
    look = {'size': [[4, 3]], 'facing': 'screen', 'lighting': False}
    pl.ibr.add_billboards([[0, 0, 0]], rgba(size, garbage), **look)


def add_live(pl, garbage):
    """Return a live texture of a ball elsewhere, before a transparent background."""
    elsewhere = pvibr.Orthographic.from_extent(98, 102, -1.5, 1.5, zmax=3)
    look = {'color': [GRAY / 255] * 3, 'lighting': False}
    ball = pl.add_mesh(pv.Sphere(center=(100, 0, 0), radius=1), **look)
    background = (garbage / 255,) * 3 + (0.0,)
    return pl.ibr.add(pvibr.LiveTexture(elsewhere, [ball], (64, 48), background=background))


def add_live_mesh(pl, size, garbage, color, folder):
    live = add_live(pl, garbage)
    wall = pl.add_mesh(pv.Plane(i_size=4, j_size=3), color='white', lighting=False)
    wall.texture = live.texture


def add_live_billboard(pl, size, garbage, color, folder):
    look = {'size': [[4, 3]], 'facing': 'screen', 'lighting': False}
    pl.ibr.add_billboards([[0, 0, 0]], add_live(pl, garbage), **look)


def add_live_projector(pl, size, garbage, color, folder):
    wall = pl.add_mesh(plane(), color=color, lighting=False)
    live = add_live(pl, garbage)
    pl.ibr.add(pvibr.Projector(live, ABOVE, mode='decal', actors=[wall]))


def add_live_overlay(pl, size, garbage, color, folder):
    pl.ibr.add(pvibr.ImageOverlay(add_live(pl, garbage)))


DRAWN = [
    add_masked_projector,
    add_decal,
    add_film,
    add_photos,
    add_overlay,
    add_small_overlay,
    add_billboard,
    add_live_mesh,
    add_live_billboard,
    add_live_projector,
    add_live_overlay,
]


@pytest.mark.parametrize(('behind', 'size'), [(30, SIZES[0]), (GRAY, SIZES[1])])
@pytest.mark.parametrize('garbage', [0, 255])
@pytest.mark.parametrize('add', DRAWN, ids=lambda add: add.__name__[4:])
def test_pictures_show_the_object_alone(stage, add, garbage, behind, size, tmp_path):
    stage.set_background([behind / 255] * 3)
    add(stage, size, garbage, [behind / 255] * 3, tmp_path)
    stage.show(auto_close=False)
    for scale in SCALES:
        stage.camera.parallel_scale = scale
        shown = shot(stage)
        assert behind - 1 <= shown.min() <= shown.max() <= GRAY + 1, scale
        assert scale > 2 or shown.max() > GRAY - 50, scale


def bake_projector(mesh, picture, mask, folder, **where):
    return pvibr.Projector(picture, ABOVE, mask=mask).bake(mesh, **where)


def bake_decal(mesh, picture, mask, folder, **where):
    return pvibr.Projector(np.dstack([picture, mask]), ABOVE, mode='decal').bake(mesh, **where)


def bake_photos(mesh, picture, mask, folder, **where):
    pl = pv.Plotter(off_screen=True)
    photos = [photograph(picture, folder)]
    painted = pl.ibr.add_photos(mesh, photos, masks=[mask], color=[GRAY / 255] * 3)
    baked = painted.bake(**where)
    pl.close()
    return baked


@pytest.mark.parametrize('size', SIZES, ids='{0[0]}x{0[1]}'.format)
@pytest.mark.parametrize('garbage', [0, 255])
@pytest.mark.parametrize('to', ['points', 'cells', 'texture'])
@pytest.mark.parametrize(
    'bake', [bake_projector, bake_decal, bake_photos], ids=lambda bake: bake.__name__[5:]
)
def test_baked_colours_are_of_the_object_alone(bake, to, garbage, size, tmp_path):
    picture, mask = cut_out(size, garbage)
    where = {'to': to} | ({'size': (128, 96)} if to == 'texture' else {})
    baked = bake(plane(40), picture, mask, tmp_path, **where)
    colors = baked[1] if to == 'texture' else baked['projected']
    drawn = colors.reshape(-1, 4).astype(int)
    drawn = drawn[drawn[:, 3] > 0]
    assert len(drawn) > 20
    assert (np.abs(drawn[:, :3] - GRAY) <= 1).all()


@pytest.mark.parametrize('garbage', [0, 255])
@pytest.mark.parametrize('to', ['points', 'texture'])
@pytest.mark.parametrize('bake', [bake_projector, bake_decal], ids=lambda bake: bake.__name__[5:])
def test_baked_colours_drawn_by_vtk_are_of_the_object_alone(stage, bake, to, garbage, tmp_path):
    stage.set_background([GRAY / 255] * 3)
    if to == 'points':
        baked = bake(plane(40), *cut_out(SIZES[0], garbage), tmp_path)
        stage.add_mesh(baked, scalars='projected', rgb=True, lighting=False)
    else:
        where = {'to': to, 'size': (128, 96)}
        baked, image = bake(plane(40), *cut_out(SIZES[0], garbage), tmp_path, **where)
        texture = pv.Texture(image)
        texture.interpolate = texture.mipmap = True
        stage.add_mesh(baked, texture=texture, color='white', lighting=False)
    stage.show(auto_close=False)
    for scale in SCALES:
        stage.camera.parallel_scale = scale
        assert (np.abs(shot(stage) - GRAY) <= 1).all(), scale


@pytest.mark.parametrize('garbage', [0, 255])
def test_thumbnails_show_no_neighbour(stage, garbage, tmp_path):
    """Nor do transparent texels of the last row."""
    photos = []
    for k, gray in enumerate([GRAY, garbage, garbage]):
        (tmp_path / f'{k}').mkdir()
        photos.append(photograph(np.full((12, 16, 3), gray, np.uint8), tmp_path / f'{k}'))
    cards, image = pvibr.Photos(photos).thumbnails(1.0, texels=16)
    texture = pv.Texture(image)
    texture.interpolate = True
    stage.set_background([GRAY / 255] * 3)
    stage.add_mesh(cards.extract_cells([0]), texture=texture, color='white', lighting=False)
    stage.show(auto_close=False)
    for scale in (0.1, 0.4, 1.0):
        stage.camera.parallel_scale = scale
        assert (np.abs(shot(stage) - GRAY) <= 1).all(), scale


def test_the_fourth_channel_of_data_weights_nothing():
    """Images of effects in GLSL may be no colours; of panoramas alpha is ignored."""
    data = np.random.default_rng(0).integers(0, 256, (8, 8, 4), dtype=np.uint8)
    data[:4, :, 3] = 0
    with hidden_window() as (window, _):
        shown = Shown(data)
        texels = shown.texture(window).download()
        shown.release()
    assert (texels == data[::-1]).all()


def level_of(picture, level):
    """The mip level of straight RGBA in float64: colours weighted by alpha, NaN where none are."""
    alpha = picture[..., 3:] / 255.0
    values = np.concatenate([picture[..., :3] * alpha, alpha], 2)
    for _ in range(level):
        for axis in (0, 1):
            values = halved(values, axis)
    with np.errstate(invalid='ignore'):
        return values[..., :3] / values[..., 3:], values[..., 3]


def halved(values, axis):
    """Means of equal parts of an axis, of which there are half as many as texels."""
    count = values.shape[axis]
    parts = max(count // 2, 1)
    edges = np.arange(parts + 1) * count / parts
    texels = np.arange(count)
    shares = np.minimum(texels + 1, edges[1:, None]) - np.maximum(texels, edges[:-1, None])
    return np.moveaxis(np.tensordot(shares.clip(0) * parts / count, values, (1, axis)), 0, axis)


def level_texels(texture, k):
    width, height = (max(n >> k, 1) for n in texture.size)
    level = Level(texture.window, texture.object, k, width, height)
    target = Target(texture.window, width, height)
    copy(level, target)
    texels = target.colors[0].download()[:height, :width]
    release(level, target)
    return texels


@pytest.mark.parametrize('size', [*SIZES, (7, 2), (3, 5)], ids='{0[0]}x{0[1]}'.format)
def test_mip_levels_are_means_weighted_by_alpha(size):
    rng = np.random.default_rng(size[0])
    picture = rng.integers(0, 256, (size[1], size[0], 4), dtype=np.uint8)
    picture[..., 3] = rng.choice([0, 0, 60, 255], picture.shape[:2])
    with hidden_window() as (window, _):
        texture = MipTexture(window)
        upload(texture, picture, keep=False)
        for k in range(max(size).bit_length()):
            shown = level_texels(texture, k).astype(float)
            colors, alpha = level_of(picture[::-1], k)
            np.testing.assert_allclose(shown[..., 3], 255 * alpha, atol=1.1)
            covered = alpha > 0
            assert (np.abs(shown[..., :3] - colors)[covered] <= 1.1).all(), k
            included = picture[picture[..., 3] > 0, :3]
            assert (shown[..., :3] >= included.min(0) - 1.1).all()
            assert (shown[..., :3] <= included.max(0) + 1.1).all()
        texture.release()


def test_points_between_texels_are_weighted_by_alpha():
    rng = np.random.default_rng(3)
    picture = rng.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    picture[..., 3] = rng.choice([0, 0, 90, 255], picture.shape[:2])
    uv = rng.uniform(0, 1, (500, 2))
    alpha = picture[..., 3:].astype(float)
    sums, total = sample(picture[..., :3] * alpha, uv), sample(alpha, uv)
    covered = total[:, 0] > 0
    found = sample(picture, uv)
    np.testing.assert_allclose(found[covered, :3], sums[covered] / total[covered])
    np.testing.assert_allclose(found[:, 3], total[:, 0])
    assert 0.5 < covered.mean() < 1


@pytest.mark.parametrize('garbage', [0, 255])
@pytest.mark.parametrize('to', [(32, 24), (31, 20), (5, 3), (1, 1)])
def test_smaller_pictures_are_of_the_object_alone(garbage, to):
    small = resized(rgba((64, 48), garbage), to)
    assert small.shape[:2] == to[::-1]
    drawn = small[small[..., 3] > 0].astype(int)
    assert len(drawn)
    assert (np.abs(drawn[:, :3] - GRAY) <= 1).all()
    assert (filled(small)[..., :3] == small[small[..., 3] > 0, :3].min()).all()
