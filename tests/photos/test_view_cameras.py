"""Every way in and out of a camera against u = K [R t] X, written out in float64."""

import json
import struct

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import Delaunay

import pvibr
from pvibr.maths.camera_views import view_of
from pvibr.maths.cameras import as_camera
from pvibr.things.frame import Frame
from tests.camera_files import pixels
from tests.makers import turn_of
from tests.refusals import refused

BAR = 0.01  # pixels
SIZE = 128, 96
WIDE = 200, 90
EYE = np.array([2.0, -5.0, 3.0])
R = turn_of(-EYE, (0.2, 0.1, 1.0))
POINTS = np.random.default_rng(36).uniform(-1, 1, (20, 3))
INTRINSICS = {  # fx, fy, cx, cy, skew
    'square': (180, 180, 63.5, 47.5, 0),
    'oblong': (900, 700, 63.5, 47.5, 0),
    'tall': (140, 190, 63.5, 47.5, 0),
    'off-centre': (180, 180, 75, 40, 0),
    'oblong off-centre': (180, 140, 55, 52, 0),
    'skew': (180, 150, 60, 45, 9),
}
PLAIN = [name for name in INTRINSICS if name != 'skew']


def pinhole(name):
    fx, fy, cx, cy, skew = INTRINSICS[name]
    return pvibr.Pinhole([[fx, skew, cx], [0, fy, cy], [0, 0, 1.0]], R, -R @ EYE, SIZE)


def by_hand(name, window=SIZE, points=POINTS, *, skewed=True):
    """Pixels in a window whose height the picture fills, and in which it is centred."""
    fx, fy, cx, cy, skew = INTRINSICS[name]
    x, y, z = R @ (np.asarray(points) - EYE).T
    u = np.c_[(fx * x + skewed * skew * y) / z + cx, fy * y / z + cy]
    return (u + 0.5 - np.array(SIZE) / 2) * window[1] / SIZE[1] + np.array(window) / 2 - 0.5


def from_ndc(ndc, size):
    return (np.asarray(ndc)[:, :2] * [1, -1] + 1) / 2 * size - 0.5


def by_matrix(matrix, size, points=POINTS):
    clip = np.c_[points, np.ones(len(points))] @ np.asarray(matrix).T
    return from_ndc(clip / clip[:, 3:], size)


def by_vtk(camera, size, points=POINTS):
    """As VTK's own matrix has it."""
    matrix = camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1, 1)
    return by_matrix(pv.array_from_vtkmatrix(matrix), size, points)


def flown(camera, window=SIZE, frames=1, **settings):
    """A plotter that was flown to a camera, and shown."""
    pl = pv.Plotter(window_size=window)
    pl.add_mesh(pv.Cube())
    for name, value in settings.items():
        getattr(pl.camera, name)(value)
    pl.ibr.fly_to(camera, frames=frames)
    pl.show(auto_close=False)
    return pl


def shown(pl):
    """Pixels as the renderer converts points."""
    found, renderer = [], pl.renderer
    (left, bottom), height = renderer.GetOrigin(), renderer.GetSize()[1]
    for point in POINTS:
        renderer.SetWorldPoint(*point, 1)
        renderer.WorldToDisplay()
        x, y, _ = renderer.GetDisplayPoint()
        found.append((x - left - 0.5, height - (y - bottom) - 0.5))
    return np.array(found)


def read_again(path):
    with pytest.warns(pvibr.PvibrWarning, match='have no picture'):
        (photo,) = pvibr.read_cameras(path)
    return pixels(photo.camera, POINTS)


def written(name, folder, form):
    path = folder / ('transforms.json' if form == 'transforms' else 'model')
    pvibr.write_cameras(path, [pvibr.Photo('a.png', pinhole(name))], format=form)
    return read_again(path)


def written_view(name, folder):
    pvibr.write_cameras(folder, flown(pinhole(name)))
    return read_again(folder)


def depth_map(name, _):
    view = view_of(pinhole(name), [pv.PolyData(POINTS).bounds], 1e12)
    return by_matrix(view.clip_from_view @ view.view_from_world, SIZE)


def frame(name, _):
    view = Frame.of(flown(pinhole(name)).renderer).view
    return by_matrix(view.clip_from_view @ view.view_from_world, SIZE)


def resized(name, window):
    pl = flown(pinhole(name))
    pl.window_size = window
    pl.render()
    return shown(pl)


def flown_twice(name, _):
    """Twins that watch the window do not correct it twice."""
    pl = flown(pinhole(name))
    pl.ibr.fly_to(pinhole(name), frames=1)
    for size in (WIDE, (77, 130), SIZE):
        pl.window_size = size
        pl.render()
    return shown(pl)


def in_a_subplot(name, _):
    pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]), border=False)
    pl.subplot(0, 1)
    pl.add_mesh(pv.Cube())
    pl.ibr.fly_to(pinhole(name), frames=1)
    pl.show(auto_close=False)
    return shown(pl)


def corners(name, _):
    """The corners of its card are those of the picture, with or without skew."""
    photo = pvibr.Photo('a.png', pinhole(name))
    at = pvibr.Photos([photo]).frustums(3.0).points.reshape(-1, 5, 3)[0, :4].astype(float)
    wanted = np.array([[-0.5, 95.5], [127.5, 95.5], [127.5, -0.5], [-0.5, -0.5]])
    return by_hand(name) + (by_hand(name, points=at) - wanted).max()


EXACT = {
    'K, R, t': lambda name, _: pixels(as_camera((pinhole(name).K, R, -R @ EYE), SIZE), POINTS),
    'resized': lambda name, _: (pixels(pinhole(name).resized((256, 192)), POINTS) - 0.5) / 2,
    'depth map': depth_map,
    'corners': corners,
}
WAYS = {
    'to_pyvista': lambda name, _: by_vtk(pvibr.Photo('a', pinhole(name)).to_pyvista(), SIZE),
    'read back': lambda name, _: pixels(
        as_camera(pvibr.Photo('a', pinhole(name)).to_pyvista(), SIZE), POINTS
    ),
    'fly_to': lambda name, _: shown(flown(pinhole(name))),
    'over frames': lambda name, _: shown(flown(pinhole(name), frames=3)),
    'from an oblong view': lambda name, _: shown(
        flown(
            pinhole(name),
            frames=3,
            SetUseExplicitAspectRatio=True,
            SetExplicitAspectRatio=3.0,
            SetUseHorizontalViewAngle=True,
        )
    ),
    'to a camera of PyVista': lambda name, _: shown(
        flown(pvibr.Photo('a', pinhole(name)).to_pyvista())
    ),
    'again': flown_twice,
    'subplot': in_a_subplot,
    'frame': frame,
    'plotter': written_view,
    'colmap': lambda name, folder: written(name, folder, 'colmap'),
    'colmap_binary': lambda name, folder: written(name, folder, 'colmap_binary'),
    'transforms': lambda name, folder: written(name, folder, 'transforms'),
}
IN_WINDOWS = {
    'to_pyvista': lambda name, window: by_vtk(
        pvibr.Photo('a', pinhole(name)).to_pyvista(window), window
    ),
    'fly_to': lambda name, window: shown(flown(pinhole(name), window)),
    'resized': resized,
}


@pytest.mark.parametrize('name', INTRINSICS)
@pytest.mark.parametrize('way', EXACT)
def test_what_pvibr_draws_has_all_of_K(way, name, tmp_path):
    assert np.abs(EXACT[way](name, tmp_path) - by_hand(name)).max() < BAR


@pytest.mark.parametrize('name', PLAIN)
@pytest.mark.parametrize('way', WAYS)
def test_a_camera_is_the_same_on_every_way(way, name, tmp_path):
    assert np.abs(WAYS[way](name, tmp_path) - by_hand(name)).max() < BAR


@pytest.mark.parametrize('window', [WIDE, (60, 120)])
@pytest.mark.parametrize('name', PLAIN)
@pytest.mark.parametrize('way', IN_WINDOWS)
def test_pixels_keep_their_shape_in_every_window(way, name, window):
    """The picture fills the height, and is centred."""
    assert np.abs(IN_WINDOWS[way](name, window) - by_hand(name, window)).max() < BAR


def test_skew_is_refused_or_said():
    """The pixels named are those by which the farthest corner is off."""
    camera = pinhole('skew')
    for look in (pvibr.Photo('a', camera).to_pyvista, lambda: flown(camera).camera):
        with pytest.warns(pvibr.PvibrWarning, match=r'off by up to 3\.03 px.* skew, here 9 px'):
            view = look()
        assert np.abs(by_vtk(view, SIZE) - by_hand('skew', skewed=False)).max() < BAR
    at_corners = camera.position + camera.rays([[0, 0], [1, 0], [1, 1], [0, 1]])[1]
    off = by_vtk(view, SIZE, at_corners) - by_hand('skew', points=at_corners)
    assert np.hypot(*off.T).max() == pytest.approx(3.03, abs=0.005)
    for form in ('colmap', 'transforms'):
        refused('K must have no skew', pvibr.write_cameras, 'x', [camera], format=form)


@pytest.mark.parametrize(('name', 'finer'), [('oblong', 900), ('tall', 190), ('square', 180)])
def test_levels_are_chosen_by_the_finer_side_of_pixels(name, finer):
    assert Frame.of(flown(pinhole(name)).renderer).pixel_scale == pytest.approx(finer)


def test_a_view_that_is_no_pinhole_is_refused():
    pl = flown(pinhole('square'))
    pl.camera.SetViewShear(0.1, 0, 1)
    refused(r'camera\.GetViewShear\(\) must be', pl.ibr.fly_to, pinhole('oblong'))


def test_what_is_set_afterwards_is_left_alone():
    """A resized window corrects the view of the flight, and no other."""
    pl = flown(pinhole('oblong off-centre'))
    pl.camera.SetExplicitAspectRatio(2.0)
    pl.window_size = WIDE
    assert pl.camera.GetExplicitAspectRatio() == 2.0
    pl.ibr.fly_to(pinhole('square'), frames=2)
    assert not pl.camera.GetUseExplicitAspectRatio()
    assert pl.camera.GetWindowCenter() == (0, 0)


@pytest.mark.parametrize('window', [SIZE, WIDE])
@pytest.mark.parametrize('ratio', [1.0, 1.5])
def test_orthophotos_with_oblong_pixels(ratio, window):
    camera = pvibr.Orthographic.from_extent(-2, -2 + 4 * ratio, -1, 2, 0, 5, size=SIZE)
    wanted = (POINTS[:, :2] - camera.origin[:2]) / (4 * ratio, 3) * [1, -1] + [0, 1]
    wanted = (wanted * SIZE - np.array(SIZE) / 2) * window[1] / SIZE[1] + np.array(window) / 2
    photo = pvibr.Photo('a', camera)
    for view in (photo.to_pyvista(window), flown(camera, window).camera):
        assert np.abs(by_vtk(view, window) - (wanted - 0.5)).max() < BAR
        assert np.abs(pixels(as_camera(view, window), POINTS) - (wanted - 0.5)).max() < BAR


def test_pixels_of_a_plan_without_a_size_are_square():
    view = flown(pvibr.Orthographic.from_extent(-2, 2, -1, 2)).camera
    assert (view.parallel_scale, view.GetUseExplicitAspectRatio()) == (1.5, False)


def glb_camera(path):
    data = path.read_bytes()
    (length,) = struct.unpack_from('<I', data, 12)
    document = json.loads(data[20 : 20 + length])
    node = next(n for n in document['nodes'] if 'camera' in n)
    return document['cameras'][0], np.reshape(node['matrix'], (4, 4)).T


@pytest.mark.parametrize('parallel', [False, True])
def test_glb_files_have_the_shape_of_the_pixels(parallel, tmp_path):
    pl = flown(pinhole('oblong'))
    pl.camera.parallel_projection = parallel
    pl.ibr.export_glb(tmp_path / 'a.glb')
    lens, _ = glb_camera(tmp_path / 'a.glb')
    matrix = pv.array_from_vtkmatrix(
        pl.camera.GetProjectionTransformMatrix(SIZE[0] / SIZE[1], -1, 1)
    )
    if parallel:
        found = 1 / lens['orthographic']['xmag'], 1 / lens['orthographic']['ymag']
    else:
        y = 1 / np.tan(lens['perspective']['yfov'] / 2)
        found = y / lens['perspective']['aspectRatio'], y
    np.testing.assert_allclose(found, matrix.diagonal()[:2])
    pl.ibr.fly_to(pinhole('off-centre'), frames=1)
    with pytest.warns(pvibr.PvibrWarning, match=r'off by 11\.5 and 7\.5 px.* no off-centre'):
        pl.ibr.export_glb(tmp_path / 'b.glb')


# -- pictures ----------------------------------------------------------------------------------

BALL = np.array([[0.4, 0.3, 0.2]])


def middle(picture):
    """Where red is, in pixels."""
    red = np.maximum(picture[..., 0].astype(float) - picture[..., 1], 0)
    y, x = np.indices(red.shape)
    return np.array([np.average(x, weights=red), np.average(y, weights=red)])


def ball(pl, kind):
    if kind == 'mesh':
        mesh = pv.Sphere(radius=0.25, center=BALL[0], theta_resolution=40, phi_resolution=40)
        return pl.add_mesh(mesh, color='red', lighting=False)
    return pl.ibr.add_spheres(BALL, radius=0.25, color='red', lighting=False)


def middle_of_ball(name, *, skewed=True):
    """The middle of the pixels within the projections of its points."""
    mesh = pv.Sphere(radius=0.25, center=BALL[0], theta_resolution=60, phi_resolution=60)
    at = by_hand(name, points=mesh.points, skewed=skewed)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    where = np.c_[x.ravel(), y.ravel()]
    return where[Delaunay(at).find_simplex(where) >= 0].mean(0)


@pytest.mark.parametrize('kind', ['mesh', 'spheres'])
@pytest.mark.parametrize('options', [{}, {'scale': 2}, {'samples': 4}], ids=str)
def test_pictures_of_oblong_views(options, kind):
    pl = pv.Plotter(window_size=SIZE)
    ball(pl, kind)
    pl.ibr.fly_to(pinhole('oblong off-centre'), frames=1)
    found = (middle(pl.ibr.screenshot(**options)) + 0.5) / options.get('scale', 1) - 0.5
    assert np.abs(found - middle_of_ball('oblong off-centre')).max() < 0.15
    if kind == 'spheres':
        assert pl.ibr.pick(found[0], SIZE[1] - 1 - found[1]).index == 0


@pytest.mark.parametrize('kind', ['mesh', 'spheres'])
@pytest.mark.parametrize('options', [{}, {'scale': 2}, {'samples': 4}], ids=str)
def test_views_by_a_skewed_matrix(options, kind):
    """VTK takes whole projection matrices too; tiles and samples are parts of them."""
    pl = pv.Plotter(window_size=SIZE)
    ball(pl, kind)
    pl.ibr.fly_to(pinhole('square'), frames=1)
    matrix = pinhole('skew').clip_from_view(*pl.camera.clipping_range)
    pl.camera.SetExplicitProjectionTransformMatrix(pv.vtkmatrix_from_array(matrix))
    pl.camera.SetUseExplicitProjectionTransformMatrix(True)
    scale = options.get('scale', 1)
    found = (middle(pl.ibr.screenshot(**options)) + 0.5) / scale - 0.5
    assert np.abs(found - middle_of_ball('skew')).max() < 0.15


@pytest.mark.parametrize('kind', ['mesh', 'spheres'])
def test_pictures_of_skewed_cameras(kind):
    pl = pv.Plotter(window_size=SIZE)
    ball(pl, kind)
    live = pl.ibr.add(pvibr.LiveTexture(pinhole('skew'), size=SIZE))
    pl.show(auto_close=False)
    found = middle(live.image())
    wanted = middle_of_ball('skew')
    assert np.abs(found - wanted).max() < 0.15
    assert np.abs(wanted - middle_of_ball('skew', skewed=False)).max() > 0.3


@pytest.mark.parametrize('name', ['oblong off-centre', 'skew'])
def test_a_projected_dot_is_where_its_pixel_looks(name):
    """Projector and view have the same eye, and so see the dot in the same direction."""
    column, row = np.rint(by_hand(name, points=BALL)[0]).astype(int)
    picture = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
    picture[row - 3 : row + 4, column - 3 : column + 4] = 255, 0, 0
    dot = EYE + 4 * R.T @ np.linalg.solve(pinhole(name).K, [column, row, 1.0])
    pl = pv.Plotter(window_size=SIZE)
    pl.add_mesh(pv.Plane(center=BALL[0], direction=EYE, i_size=9, j_size=9), lighting=False)
    pl.ibr.add(pvibr.Projector(picture, pinhole(name)))
    pl.ibr.fly_to(pinhole('tall'), frames=1)
    assert np.abs(middle(pl.ibr.screenshot()) - by_hand('tall', points=[dot])[0]).max() < 0.15
