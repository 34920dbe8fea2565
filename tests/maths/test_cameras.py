"""Cameras: OpenCV's formulas written out, VTK's own matrices, published calibrations."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pvibr.maths.cameras import as_camera
from pvibr.maths.distortion import distort, undistort, valid_radius
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole
from tests.refusals import refused

SIZE = 640, 480
K = np.array([[600.0, 3.0, 350.0], [0.0, 580.0, 220.0], [0.0, 0.0, 1.0]])
TURN = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
SHIFT = np.array([0.1, -0.4, 2.0])
LENSES = {
    'none': [],
    'barrel': [-0.3, 0.05, 1e-3, -2e-3],
    'cushion': [0.2, 0.05, 1e-3, -2e-3, 0.01],
    'rational': [0.8, 0.3, 1e-3, -5e-4, 0.02, 0.9, 0.4, 0.05],
    'folding': [-0.9, 0.0, 2e-2, 1e-2],
}
terms = st.floats(-0.3, 0.3)
small = st.floats(-0.02, 0.02)
lenses = st.one_of(
    st.tuples(terms, terms, small, small),
    st.tuples(terms, terms, small, small, terms),
    st.tuples(terms, terms, small, small, terms, terms, terms, terms),
)


def pinhole(lens='none'):
    return Pinhole(K, TURN, SHIFT, SIZE, LENSES[lens])


def opencv(x, y, z, d):
    """One point at a time, as OpenCV's manual writes it: pixels from the top left centre."""
    d = list(d) + [0.0] * (8 - len(d))
    a, b = x / z, y / z
    r2 = a**2 + b**2
    f = (1 + d[0] * r2 + d[1] * r2**2 + d[4] * r2**3) / (
        1 + d[5] * r2 + d[6] * r2**2 + d[7] * r2**3
    )
    a2 = a * f + 2 * d[2] * a * b + d[3] * (r2 + 2 * a**2)
    b2 = b * f + d[2] * (r2 + 2 * b**2) + 2 * d[3] * a * b
    return K[0, 0] * a2 + K[0, 1] * b2 + K[0, 2], K[1, 1] * b2 + K[1, 2]


@pytest.mark.parametrize('lens', LENSES)
def test_projection_is_that_of_opencv(lens):
    camera = pinhole(lens)
    rng = np.random.default_rng(1)
    local = np.column_stack([rng.uniform(-0.5, 0.5, (200, 2)), np.ones(200)])
    local *= rng.uniform(0.1, 9, (200, 1))
    uv, depth = camera.project((local - SHIFT) @ TURN)
    pixels = [opencv(*p, LENSES[lens]) for p in local]
    np.testing.assert_allclose(depth, local[:, 2])
    inside = np.hypot(*(local[:, :2] / local[:, 2:]).T) < camera.valid_radius
    assert inside.sum() > 100
    assert np.isnan(uv[~inside]).all()
    expected = (np.array(pixels) + 0.5) / SIZE
    expected[:, 1] = 1 - expected[:, 1]
    np.testing.assert_allclose(uv[inside], expected[inside], atol=1e-12)


def test_the_corner_pixel_and_the_edges():
    camera = Pinhole(K, np.eye(3), np.zeros(3), SIZE)
    corner = np.linalg.solve(K, [0, 0, 1])  # the centre of the top left pixel
    uv, _ = camera.project([corner])
    np.testing.assert_allclose(uv, [[0.5 / 640, 1 - 0.5 / 480]])


@pytest.mark.parametrize('kind', [np.float64, np.float32])
@pytest.mark.parametrize('lens', LENSES)
def test_behind_is_never_in_the_picture(lens, kind):
    """Nor is a point in the plane of the camera, whichever sign rounding gives its depth."""
    camera, eps = pinhole(lens), np.finfo(kind).eps
    steps = np.concatenate([[-2.0], np.linspace(-eps, eps, 9), [2.0]])
    for beside in (0.0, 3.0):
        points = camera.position + beside * TURN[1] + np.outer(steps, TURN[2])
        uv, depth = camera.project(points.astype(kind))
        assert np.isnan(uv[:-1]).all()
        np.testing.assert_allclose(depth, steps, atol=20 * eps)
    uv, _ = camera.project(camera.position + np.outer([1e-6, 2.0], TURN[2]))
    assert np.isfinite(uv).all()


@given(lenses)
@settings(deadline=None)
def test_within_the_valid_radius_no_two_points_meet(lens):
    limit = min(valid_radius(lens), 3.0)
    angles, radii = np.meshgrid(np.linspace(0, 2 * np.pi, 24), np.linspace(0, 0.999 * limit, 60))
    plane = (radii * [np.cos(angles), np.sin(angles)]).reshape(2, -1).T
    h = 1e-6
    sides = h * np.eye(2)
    along_x, along_y = (
        (distort(plane + side, lens) - distort(plane - side, lens)) / (2 * h) for side in sides
    )
    jacobian = np.stack([along_x, along_y], axis=2)
    jacobian = jacobian[np.isfinite(jacobian).all(axis=(1, 2))]
    assert (np.linalg.eigvalsh(0.5 * (jacobian + jacobian.swapaxes(1, 2))) > -1e-6).all()


@given(lenses, st.floats(0, 0.97), st.floats(-np.pi, np.pi))
@settings(deadline=None)
def test_undistort_is_the_inverse(lens, share, angle):
    radius = share * min(valid_radius(lens), 3.0)
    plane = radius * np.array([[np.cos(angle), np.sin(angle)]])
    moved = distort(plane, lens)
    back = undistort(moved, lens)
    assert np.isfinite(back).all()
    np.testing.assert_allclose(distort(back, lens), moved, atol=1e-9)
    np.testing.assert_allclose(back, plane, atol=1e-5)


@pytest.mark.parametrize(
    ('lens', 'expected'),
    [
        ([-1 / 3, 0, 0, 0], 1.0),  # r - r^3/3 stops growing at 1
        ([0.1, 0, 0, 0], np.inf),
        ([], np.inf),
        ([0, 0, 0, 0.0, 0, -0.25, 0, 0], 2.0),  # r / (1 - r^2/4) has its pole at 2
        ([0, 0, 0, 1 / 6], 1.0),  # only tangential: the slope 1 - 6 r/6 is 0 at 1
    ],
)
def test_valid_radius_in_closed_form(lens, expected):
    np.testing.assert_allclose(valid_radius(lens), expected, rtol=1e-9)


def test_points_beyond_the_fold_are_outside_not_folded_back():
    lens = [-1 / 3, 0.0, 0.0, 0.0]
    camera = Pinhole(K, np.eye(3), np.zeros(3), SIZE, lens)
    folded = [[1.7, 0.0, 1.0]]  # the formula alone puts it near the middle of the picture
    x, y = opencv(*folded[0], lens)
    assert 0 < x < SIZE[0]
    assert 0 < y < SIZE[1]
    assert np.isnan(camera.project(folded)[0]).all()


@pytest.mark.parametrize('lens', LENSES)
def test_rays_go_back_through_their_place(lens):
    camera = pinhole(lens)
    uv = np.random.default_rng(2).uniform(0, 1, (300, 2))
    origins, directions = camera.rays(uv)
    seen = np.isfinite(directions).all(axis=1)
    assert seen.mean() > (0.5 if lens == 'folding' else 0.999)
    back, _ = camera.project(origins + 3 * directions)
    np.testing.assert_allclose(back[seen], uv[seen], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(directions[seen], axis=1), 1)
    np.testing.assert_allclose(camera.toward((origins + directions)[seen]), -directions[seen])


@pytest.mark.parametrize('lens', LENSES)
@pytest.mark.parametrize('far', [50.0, np.inf])
def test_all_that_the_lens_sees_is_in_the_clip_volume(lens, far):
    camera = pinhole(lens)
    along = np.linspace(0, 1, 333)
    edges = [np.c_[along, along * 0], np.c_[along, along * 0 + 1]]
    uv = np.concatenate([*edges, *(e[:, ::-1] for e in edges)])
    origins, directions = camera.rays(uv)
    points = (origins + 4 * directions)[np.isfinite(directions).all(axis=1)]
    clip = np.c_[points, np.ones(len(points))] @ camera.view_from_world.T
    clip = clip @ camera.clip_from_view(0.1, far).T
    ndc = clip[:, :3] / clip[:, 3:]
    assert np.abs(ndc).max() < 1 + 1e-4
    touched = [ndc[:, :2].min(axis=0), ndc[:, :2].max(axis=0)]
    if lens != 'folding':
        np.testing.assert_allclose(touched, [[-1, -1], [1, 1]], atol=1e-4)


def test_clip_without_a_lens_is_the_picture():
    camera = pinhole()
    points = camera.position + TURN.T @ [0.2, -0.1, 3.0] * np.array([[1.0], [2.0]])
    clip = np.c_[points, [1, 1]] @ (camera.clip_from_view(1.0, 10.0) @ camera.view_from_world).T
    uv, depth = camera.project(points)
    np.testing.assert_allclose(clip[:, :2] / clip[:, 3:] / 2 + 0.5, uv)
    np.testing.assert_allclose(clip[:, 3], depth)
    wide = camera.clip_from_view(1.0, 10.0, margin=0.5)
    np.testing.assert_allclose(wide[:2], camera.clip_from_view(1.0, 10.0)[:2] / 2)


@pytest.mark.parametrize('offset', [0.0, 1e3, 1e6, 1e9])
def test_far_from_the_origin(offset):
    at = np.array([1.0, -2.0, 3.0]) * offset
    camera = Pinhole(K, TURN, SHIFT - TURN @ at, SIZE, LENSES['barrel'])
    near = pinhole('barrel')
    points = near.position + TURN.T @ [0.2, -0.1, 3.0]
    tolerance = 1e-12 + 10 * offset * np.finfo(float).eps
    np.testing.assert_allclose(
        camera.project([points + at])[0], near.project([points])[0], atol=tolerance
    )
    np.testing.assert_allclose(camera.position - at, near.position, atol=tolerance)


def test_resized_keeps_every_place():
    camera, points = pinhole('cushion'), [[0.1, 0.2, 1.0], [0.3, -0.2, 2.0]]
    smaller = camera.resized((320, 120))
    np.testing.assert_allclose(smaller.project(points)[0], camera.project(points)[0])
    np.testing.assert_allclose(smaller.texel(points), camera.texel(points) * np.sqrt(2 * 4))


def test_orthographic_in_closed_form():
    right, up = TURN[0], TURN[1]
    camera = Orthographic(SHIFT, 3 * right, up, 4.0, 2.0, near=0.0, far=9.0, size=(400, 100))
    ahead = -np.cross(right, up)
    points = SHIFT + np.array([[1.0, 0.5, 3.0], [1.0, 0.5, 10.0], [-1.0, 0.5, 3.0]]) @ [
        right,
        up,
        ahead,
    ]
    uv, depth = camera.project(points)
    np.testing.assert_allclose(uv, [[0.25, 0.25], [np.nan] * 2, [-0.25, 0.25]])
    np.testing.assert_allclose(depth, [3, 10, 3])
    np.testing.assert_allclose(camera.texel(points), np.sqrt(0.01 * 0.02))
    origins, directions = camera.rays(uv[:1])
    np.testing.assert_allclose(origins + 3 * directions, points[:1])
    clip = np.c_[points, [1, 1, 1]] @ (camera.clip_from_view(0, 9) @ camera.view_from_world).T
    np.testing.assert_allclose(clip[0, :2] / 2 + 0.5, uv[0])
    np.testing.assert_allclose(clip[:, 2], depth / 4.5 - 1)


def vtk_ndc(camera, points, size, near, far):
    """What VTK's own matrices do."""
    camera.SetClippingRange(near, far)
    matrix = camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1, 1)
    matrix = pv.array_from_vtkmatrix(matrix)
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    return clip[:, :3] / clip[:, 3:]


@pytest.mark.parametrize('size', [(720, 720), (1280, 720), (400, 1200), (1, 1)])
@pytest.mark.parametrize('kind', ['perspective', 'parallel', 'sideways'])
@given(
    position=arrays(float, 3, elements=st.floats(-5, 5)),
    angle=st.floats(1, 170),
    window=arrays(float, 2, elements=st.floats(-0.9, 0.9)),
)
@settings(deadline=None, max_examples=15)
def test_a_pyvista_camera_is_read_as_vtk_reads_it(size, kind, position, angle, window):
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = position, (7.0, 1.0, 2.0), (0.1, 0.2, 1.0)
    camera.view_angle, camera.parallel_scale = angle, angle / 40
    camera.parallel_projection = kind == 'parallel'
    camera.SetUseHorizontalViewAngle(kind == 'sideways')
    camera.SetWindowCenter(*window)
    points = np.random.default_rng(3).uniform((7.0, 0.0, 1.0), (9.0, 2.0, 3.0), (20, 3))
    found = as_camera(camera, size)
    expected = vtk_ndc(camera, points, size, 0.1, 100.0)
    uv, depth = found.project(points)
    assert (depth > 0).all()
    np.testing.assert_allclose(uv * 2 - 1, expected[:, :2], atol=1e-6, rtol=1e-6)
    clip = np.c_[points, np.ones(len(points))] @ found.view_from_world.T
    clip = clip @ found.clip_from_view(0.1, 100.0).T
    np.testing.assert_allclose(clip[:, :3] / clip[:, 3:], expected, atol=1e-6, rtol=1e-6)


def test_as_camera_takes_what_users_have():
    camera = pinhole('barrel')
    same = [
        camera,
        (K, TURN, SHIFT, LENSES['barrel']),
        {'K': K, 'R': TURN, 't': SHIFT[:, None], 'distortion': [LENSES['barrel']]},
        {'K': K, 'R': TURN, 't': SHIFT, 'distortion': LENSES['barrel'], 'size': SIZE},
    ]
    assert all(as_camera(given, SIZE) == camera for given in same)
    assert as_camera((K, TURN, SHIFT), SIZE) == pinhole() != camera
    plan = Orthographic.from_extent(0.0, 1.0, 0.0, 1.0)
    assert as_camera(plan, SIZE).size == SIZE
    assert as_camera(as_camera(plan, SIZE), SIZE) == as_camera(plan, SIZE) != plan


def changed(matrix, *cells):
    matrix = np.array(matrix, dtype=float)
    for i, j, value in cells:
        matrix[i, j] = value
    return matrix


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'K': np.zeros((3, 3))}, 'K must have a diagonal above 0'),
        ({'K': changed(K, (0, 0, 0))}, 'K must have a diagonal above 0'),
        ({'K': K.T}, 'upper triangular'),
        ({'K': changed(K, (0, 0, np.nan))}, r'K\[0, 0\] must be finite, got nan'),
        ({'K': np.eye(4)}, r'K must have shape .* got \(4, 4\)'),
        ({'K': 'abc'}, 'K must be numbers'),
        ({'K': changed(K, (0, 2, 5000))}, 'principal point'),
        ({'R': 2 * np.eye(3)}, 'R must be a rotation'),
        ({'R': np.diag([1.0, 1.0, -1.0])}, r'R must be .* determinant is -1'),
        ({'R': changed(TURN, (1, 1, TURN[1, 1] + 1e-4))}, 'R must be a rotation'),
        ({'R': changed(TURN, (0, 0, np.inf))}, r'R\[.*\] must be finite, got inf'),
        ({'R': [0.1, 0.2, 0.3]}, 'R must have shape'),
        ({'t': [0, 0]}, 't must have shape'),
        ({'t': [0, np.nan, 0]}, r't\[1\] must be finite, got nan'),
        ({'size': (0, 480)}, 'size must be'),
        ({'size': (640.5, 480)}, 'size must be'),
        ({'size': 640}, 'size must be'),
        ({'distortion': [0.1, 0.2]}, 'distortion must be .* got 2'),
        ({'distortion': np.zeros(14)}, 'distortion must be .* got 14'),
        ({'distortion': [np.nan, 0, 0, 0]}, r'distortion\[0\] must be finite, got nan'),
    ],
)
def test_bad_cameras_are_named(values, message):
    good = {'K': K, 'R': TURN, 't': SHIFT, 'size': SIZE}
    refused(message, Pinhole, **{**good, **values})


@pytest.mark.parametrize('factor', [0.5, 2.0, 4.0])
def test_a_calibration_for_another_size_is_noticed(factor):
    width, height = (int(side * factor) for side in SIZE)
    refused('another size', as_camera, (K, TURN, SHIFT), (width, height))
    refused(rf'camera.size must be \({width}, {height}\)', as_camera, pinhole(), (width, height))
    assert as_camera(pinhole().resized((width, height)), (width, height)).size == (width, height)


def of_pyvista(**values):
    camera = pv.Camera()
    for name, value in values.items():
        setattr(camera, name, value)
    return camera


def sheared():
    camera = pv.Camera()
    camera.SetViewShear(0.5, 0.0, 1.0)
    return camera


def off_axis():
    camera = pv.Camera()
    camera.UseOffAxisProjectionOn()
    return camera


@pytest.mark.parametrize(
    ('bad', 'message'),
    [
        ('photo', 'camera must be'),
        (None, 'camera must be'),
        ((K, TURN), 'camera must be'),
        ({'K': K, 'R': TURN}, 'keys'),
        ({'K': K, 'R': TURN, 't': SHIFT, 'fov': 30}, 'keys'),
        (of_pyvista(position=(1.0,) * 3, focal_point=(1.0,) * 3), 'focal_point'),
        (of_pyvista(position=(0, 0, 1), focal_point=(0, 0, 0), up=(0, 0, 1)), 'camera.up'),
        (of_pyvista(model_transform_matrix=np.diag([2.0, 1, 1, 1])), 'ModelTransform'),
        (sheared(), 'ViewShear'),
        (off_axis(), 'OffAxis'),
    ],
)
def test_what_is_no_camera_is_named(bad, message):
    refused(message, as_camera, bad, SIZE)


PLAN = Orthographic.from_extent(0.0, 1.0, 0.0, 1.0)
AXES = {'origin': (0, 0, 0), 'right': (1, 0, 0), 'up': (0, 1, 0), 'width': 1, 'height': 1}


@pytest.mark.parametrize(
    ('message', 'call'),
    [
        ('perpendicular', lambda: Orthographic(**AXES | {'up': (1.0, 0.0, 0.0)})),
        ('right must not be zero', lambda: Orthographic(**AXES | {'right': (0.0, 0.0, 0.0)})),
        ('width must be', lambda: Orthographic(**AXES | {'width': 0.0})),
        ('height must be', lambda: Orthographic(**AXES | {'height': np.inf})),
        ('near must be below far', lambda: Orthographic(**AXES, near=1.0, far=1.0)),
        (r'origin\[1\] must .*got nan', lambda: Orthographic(**AXES | {'origin': (0, np.nan, 0)})),
        ('xmin', lambda: Orthographic.from_extent(1.0, 1.0, 0.0, 1.0)),
        (r'size must be .* got None', lambda: PLAN.texel([[0.0, 0.0, 0.0]])),
        ('near must be', lambda: PLAN.clip_from_view(0.0, np.inf)),
        ('near must be', lambda: pinhole().clip_from_view(0.0, 1.0)),
        ('points must have shape', lambda: PLAN.project([0.0, 0.0, 0.0])),
    ],
)
def test_other_bad_input_is_named(message, call):
    refused(message, call)


def test_a_bundle_adjusted_scene_reprojects(berlin):
    points, _, views = berlin
    misses = []
    for _, camera, pixels in views:
        uv, depth = camera.project(points)
        found = np.column_stack([uv[:, 0], 1 - uv[:, 1]]) * camera.size - 0.5
        misses.append(np.hypot(*(found - pixels).T)[np.isfinite(pixels[:, 0])])
        assert (depth > 0).all()
    misses = np.concatenate(misses)
    assert len(misses) == 3082
    assert np.median(misses) == pytest.approx(0.80, abs=0.005)


def test_a_liver_lies_in_its_published_overlay(data_dir):
    folder = data_dir / 'projection' / 'sksurgery_liver'
    pose = np.loadtxt(folder / 'model_to_camera.txt')
    intrinsics = np.loadtxt(folder / 'calib.left.intrinsics.txt')
    camera = as_camera((intrinsics, pose[:3, :3], pose[:3, 3]), (1920, 1080))
    uv, _ = camera.project(pv.read(folder / 'liver_sub.ply').points)
    uv = uv[((uv >= 0) & (uv <= 1)).all(axis=1)]
    overlay = pv.read(folder / 'fig06_case1b_overlay.png')
    width, height, _ = overlay.dimensions
    drawn = (overlay.active_scalars[:, :3] < 255).any(axis=1).reshape(height, width)
    column, row = (uv * (width, height)).astype(int).T  # VTK's rows go from the bottom
    assert drawn[row, column].mean() > 0.99
    rows, columns = np.nonzero(drawn)
    outline = [columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]
    np.testing.assert_allclose(
        [uv.min(axis=0) * (width, height), uv.max(axis=0) * (width, height)], outline, atol=2
    )
