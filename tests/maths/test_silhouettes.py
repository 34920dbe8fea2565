"""Shadow volumes: what they count is what rays find, for any mesh, light, place and size."""

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.maths.silhouettes import LitMesh, edge_table, moved_table

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float), [[0, 1, 2], [0, 2, 3]]
LIGHTS = {
    'direction': (0.3, 0.2, 1, 0),
    'direction in the plane of faces': (0, 0, 1, 0),
    'above': (0.1, 0.2, 3, 1),
    'inside': (0.05, 0.03, 0.02, 1),
    'in the plane of faces': (2, 0, 0.5, 1),
    'far': (1e9, 2e9, 3e9, 1),
}


def of(mesh):
    return np.array(mesh.vertices, float), np.array(mesh.faces)


def joined(*meshes):
    starts = np.cumsum([0] + [len(p) for p, _ in meshes])
    faces = [np.add(f, start) for (_, f), start in zip(meshes, starts, strict=False)]
    return np.concatenate([p for p, _ in meshes]), np.concatenate(faces)


def moved(mesh, offset):
    return mesh[0] + offset, mesh[1]


def cut(mesh, keep):
    points, faces = mesh
    return points, faces[keep(points[faces].mean(axis=1))]


def flipped(mesh, seed=0):
    faces = np.array(mesh[1])
    some = np.random.default_rng(seed).random(len(faces)) < 0.5
    faces[some] = faces[some, ::-1]
    return mesh[0], faces


CUBE = of(trimesh.creation.box())
BALL = of(trimesh.creation.icosphere(subdivisions=2, radius=0.7))
TORUS = of(trimesh.creation.torus(0.6, 0.25, major_sections=14, minor_sections=9))
TUBE = cut(of(trimesh.creation.cylinder(0.5, 1, sections=12)), lambda c: abs(c[:, 2]) < 0.4)
CLOSED = {
    'cube': CUBE,
    'ball': BALL,
    'torus': TORUS,
    'two balls, one in the other': joined(BALL, moved(BALL, 0.2)),
}
OPEN = {
    'sheet': moved(SQUARE, -0.5),
    'half ball': cut(BALL, lambda c: c[:, 2] > 0),
    'tube': TUBE,
    'three sheets at an edge': (
        np.array([[0, 0, -1], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float),
        [[0, 1, 2], [0, 1, 3], [1, 0, 4]],
    ),
    'two cubes at an edge': joined(CUBE, moved(CUBE, [1, 1, 0])),
    'each triangle twice': joined(BALL, BALL),
    'each triangle on both sides': joined(CUBE, (CUBE[0], CUBE[1][:, ::-1])),
    'wound anyhow': flipped(TORUS),
    'inside out': (BALL[0], BALL[1][:, ::-1]),
    'hollow': joined(BALL, (0.5 * BALL[0], BALL[1][:, ::-1])),
    'soup': (np.random.default_rng(3).normal(0, 0.7, (60, 3)), np.arange(60).reshape(20, 3)),
}


def hits(points, triangles, starts, ends):
    """Count what lies between; Moeller and Trumbore, an end may be a direction."""
    corner, u_axis, v_axis = points[triangles[:, 0]], *_axes(points, triangles)
    # What has no area hides nothing, whatever rounding makes of it.
    area, most = np.cross(u_axis, v_axis), np.abs(u_axis).max(axis=1) * np.abs(v_axis).max(axis=1)
    some = np.abs(area).max(axis=1) > 1e-12 * most
    corner, u_axis, v_axis = corner[some], u_axis[some], v_axis[some]
    ways = ends[..., :3] - ends[..., 3:] * starts
    across = np.cross(ways[:, None], v_axis)
    det = np.einsum('tj,ptj->pt', u_axis, across)
    origin = starts[:, None] - corner
    turned = np.cross(origin, u_axis)
    with np.errstate(divide='ignore', invalid='ignore'):
        u = np.einsum('ptj,ptj->pt', origin, across) / det
        v = np.einsum('pj,ptj->pt', ways, turned) / det
        t = np.einsum('tj,ptj->pt', v_axis, turned) / det
        last = np.where(ends[..., 3:] > 0, 1 - 1e-9, np.inf)
        found = (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < last)
    return found.sum(axis=1)


def _axes(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return b - a, c - a


def lines(a, b):
    """Return the lines through homogeneous points, in Pluecker's coordinates."""
    i, j = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [3, 1], [2, 3]]).T
    return a[..., i] * b[..., j] - a[..., j] * b[..., i]


def crossings(vertices, triangles, starts, ends):
    """Count ways into a volume minus ways out between homogeneous points."""
    corners = vertices[triangles]
    ways = lines(starts, ends)
    sides = [
        ways @ lines(corners[:, k], corners[:, (k + 1) % 3])[:, [5, 4, 3, 2, 1, 0]].T
        for k in range(3)
    ]
    planes = np.stack(
        [(-1) ** (k + 1) * np.linalg.det(np.delete(corners, k, axis=2)) for k in range(4)], axis=1
    )
    # From outside in: 1. A line that meets the opposite of a corner at infinity turns otherwise.
    inward = np.sign(ends @ planes.T) / 2 - np.sign(starts @ planes.T) / 2
    through = np.all(np.multiply(sides, inward) > 0, axis=0)
    return (through * inward).sum(axis=1).round().astype(int)


def homogeneous(points):
    return np.column_stack([points, np.ones(len(points))])


def check(mesh, light, *, offset=0.0, scale=1.0, seed=0):
    """Compare with rays; all is compared in the units and the frame of the mesh as it was made."""
    points, faces = np.asarray(mesh[0]) * scale + offset, np.asarray(mesh[1])
    light = np.array(light, float)
    world = light * [scale, scale, scale, 1]
    world[:3] += light[3] * offset
    table = edge_table(points, faces)
    # What the rounding at the offset left of mesh and light, exactly.
    near = (points - table.origin) / scale
    light[:3] = (world[:3] - light[3] * table.origin) / (scale if light[3] else 1)
    vertices, triangles = LitMesh(table, world).volume()
    vertices[:, :3] /= np.where(vertices[:, 3:] > 0, scale, 1)
    rng = np.random.default_rng(seed)
    targets = rng.uniform(-2, 2, (150, 3))
    shade = hits(near, faces, targets, np.broadcast_to(light, (150, 4)))
    eye = _lit(rng, near, faces, light)
    eyes, ends = homogeneous(np.repeat(eye, 150, axis=0)), homogeneous(targets)

    # A closed body may leave out what it hides with its back.
    exact = not table.closed or (LitMesh(table, world).weights < 0).any()

    def agrees(count, rows=slice(None)):
        if exact:
            np.testing.assert_array_equal(count[rows], shade[rows])
        else:
            np.testing.assert_array_equal(count[rows] > 0, shade[rows] > 0)
            assert (count[rows] >= 0).all()

    agrees(crossings(vertices, triangles, eyes, ends))
    # Depth-fail: from the point to beyond infinity.
    beyond = np.column_stack([targets - eye, np.full(150, -1e-10)])
    agrees(-crossings(vertices, triangles, ends, beyond))
    # Depth-pass: no caps, for what the eye can see.
    vertices, triangles = LitMesh(table, world).volume(caps=False)
    vertices[:, :3] /= np.where(vertices[:, 3:] > 0, scale, 1)
    seen = hits(near, faces, targets, eyes) == 0
    agrees(crossings(vertices, triangles, eyes, ends), seen)


def _lit(rng, points, faces, light):
    eyes = rng.uniform(-1, 1, (200, 3)) * np.geomspace(0.01, 40, 200)[:, None]
    lit = hits(points, faces, eyes, np.broadcast_to(light, (200, 4))) == 0
    return eyes[lit][:1]


@pytest.mark.parametrize('light', LIGHTS)
@pytest.mark.parametrize('name', [*CLOSED, *OPEN])
def test_volumes_count_what_rays_find(name, light):
    check((CLOSED | OPEN)[name], LIGHTS[light])


@pytest.mark.parametrize(('offset', 'scale'), [(1e6, 1), (1e9, 1), (0, 1e-9), (0, 1e9), (1, 1e-9)])
@pytest.mark.parametrize('light', LIGHTS)
@pytest.mark.parametrize('name', ['cube', 'torus', 'half ball', 'soup'])
def test_at_any_offset_and_size(name, light, offset, scale):
    check((CLOSED | OPEN)[name], LIGHTS[light], offset=offset, scale=scale)


small = st.integers(-2, 2)


def touches_a_triangle(corners, light):
    """Tell whether a light is in a triangle or on its edge: its prism has no thickness there."""
    starts = corners - light[:3]
    ends = np.roll(starts, -1, axis=1)
    turns = np.cross(starts, ends)
    on_edge = (turns == 0).all(axis=2) & ((starts * ends).sum(axis=2) < 0)
    normals = turns.sum(axis=1)
    in_plane = (starts[:, 0] * normals).sum(axis=1) == 0
    inside = in_plane & ((turns * normals[:, None]).sum(axis=2) > 0).all(axis=1)
    return bool(light[3] and (on_edge.any() or inside.any()))


@given(
    arrays(np.int64, (8, 3), elements=small),
    arrays(np.int64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.integers(0, 7)),
    st.tuples(small, small, small, st.integers(0, 1)).filter(any),
    st.integers(0, 99),
)
def test_any_soup_and_light(points, faces, light, seed):
    # On a grid, so that points coincide, triangles lie in a plane and the light in it.
    assume(not touches_a_triangle(points[faces], np.array(light)))
    check((points / 1.7, faces), np.array(light) / [1.7, 1.7, 1.7, 1], seed=seed)


@pytest.mark.parametrize('name', CLOSED)
def test_closed_bodies_are_known(name):
    assert edge_table(*CLOSED[name]).closed


@pytest.mark.parametrize('name', OPEN)
def test_what_is_not_closed_or_not_outward_is_known(name):
    assert not edge_table(*OPEN[name]).closed


@pytest.mark.parametrize('power', [-500, -100, 100, 500])
def test_no_size_leaves_the_range(power):
    factor = 2.0**power
    table, large = edge_table(*BALL), edge_table(BALL[0] * factor, BALL[1])
    assert large.closed
    for light in ((3, 2, 1, 1), (0.1, 0, 0.2, 1)):
        place = np.array(light) * [factor, factor, factor, 1]
        found, expected = LitMesh(large, place).silhouette, LitMesh(table, light).silhouette
        np.testing.assert_array_equal(found[0], expected[0])
    assert np.isfinite(LitMesh(large, place).volume()[0]).all()


@pytest.mark.parametrize('light', [(1, 2, 3, 0), (10, 20, 30, 1)])
def test_the_outline_of_a_cube_is_a_hexagon(light):
    ends, multiplicities = LitMesh(edge_table(*CUBE), light).silhouette
    assert multiplicities.tolist() == [1] * 6
    assert np.unique(ends).size == 6
    # One loop: each corner is once a first and once a second end.
    assert all(len(np.unique(column)) == 6 for column in ends.T)


def test_inside_a_closed_body_nothing_is_an_outline():
    table = edge_table(*CUBE)
    assert not len(LitMesh(table, (0, 0, 0, 1)).silhouette[0])
    assert len(LitMesh(table, (0, 0, 0, 1)).volume()[1]) == 2 * len(CUBE[1])


def test_multiplicities_add_what_meets():
    for copies in (1, 2, 5, 130):
        table = edge_table(*joined(*[SQUARE] * copies))
        ends, multiplicities = LitMesh(table, (0, 0, 1, 0)).silhouette
        assert (len(ends), set(multiplicities.tolist())) == (4, {copies})
        assert len(LitMesh(table, (0, 0, 1, 0)).volume_triangles(caps=False)) == 4 * copies
    # Bodies that are wound inward count their backs too: the outline twice.
    inward = edge_table(CUBE[0], CUBE[1][:, ::-1])
    assert LitMesh(inward, (1, 2, 3, 0)).silhouette[1].tolist() == [2] * 6


@given(st.integers(0, 9999), st.sampled_from([*CLOSED, *OPEN]), st.sampled_from([*LIGHTS]))
def test_winding_changes_no_shadow(seed, name, light):
    points, faces = OPEN[name] if name in OPEN else flipped(CLOSED[name], 1)
    straight, turned = edge_table(points, faces), edge_table(*flipped((points, faces), seed))
    if straight.closed or turned.closed:
        return
    # A triangle that is seen edge-on has no side: what it adds is flat.
    flat = np.abs(straight.planes @ [*LIGHTS[light][:3], LIGHTS[light][3]]) < 1e-9
    if flat.any():
        return
    one, other = (LitMesh(table, LIGHTS[light]).silhouette for table in (straight, turned))
    assert dict(zip(map(tuple, one[0]), one[1], strict=True)) == dict(
        zip(map(tuple, other[0]), other[1], strict=True)
    )


@pytest.mark.parametrize('light', LIGHTS)
@pytest.mark.parametrize('name', [*CLOSED, *OPEN])
def test_volumes_close(name, light):
    """Each side of a triangle of the volume is there once the other way, or is not a side."""
    triangles = LitMesh(edge_table(*(CLOSED | OPEN)[name]), LIGHTS[light]).volume_triangles()
    ways = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    sums = {}
    for a, b in ways.tolist():
        key, sign = ((a, b), 1) if a < b else ((b, a), -1)
        sums[key] = sums.get(key, 0) + sign
    assert not any(sums.values())


def test_seams_are_welded_and_flat_triangles_dropped():
    points, faces = BALL
    table = edge_table(points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    assert table.closed
    assert len(table.points) == len(points)
    signed = edge_table([[0, 0.0, 0], [1, 0, 0], [0, 1, 0], [0, -0.0, 0]], [[0, 1, 2], [3, 2, 1]])
    assert len(signed.points) == 3
    folded = edge_table(SQUARE[0], [[0, 1, 2], [1, 1, 2], [0, 2, 3], [3, 0, 3]])
    assert folded.sources.tolist() == [0, 2]
    assert len(LitMesh(folded, (0, 0, 1, 0)).silhouette[0]) == 4


def test_a_moved_mesh_keeps_its_topology():
    mesh = trimesh.creation.icosphere(subdivisions=2)
    mesh.unmerge_vertices()
    points, spare = np.array(mesh.vertices), [[9.0, 9.0, 9.0]]
    points = np.concatenate([spare, points])
    table = edge_table(points, mesh.faces + 1)
    moved = points * [1.0, 2.0, 3.0] + np.sin(5 * points)
    ours, anew = moved_table(table, moved), edge_table(moved, mesh.faces + 1)
    assert ours.closed == anew.closed
    for name in ('origin', 'half_box', 'points', 'planes', 'unit', 'triangles', 'sources'):
        np.testing.assert_array_equal(getattr(ours, name), getattr(anew, name), name)
    for a, b in zip(ours.groups, anew.groups, strict=True):
        np.testing.assert_array_equal(np.sort(a[0], 1), np.sort(b[0], 1))
    moved[7] += 1e-9  # a seam opens
    assert moved_table(table, moved) is None
    assert moved_table(table, np.full_like(points, np.nan)) is None
    assert moved_table(table, points[:5]) is None


def test_points_that_nothing_uses_do_not_matter():
    points = np.append(SQUARE[0], [[1e30, np.nan, np.inf]], axis=0)
    table = edge_table(points, SQUARE[1])
    np.testing.assert_array_equal(table.origin, [0.5, 0.5, 0])
    np.testing.assert_array_equal(table.half_box, [0.5, 0.5, 0])


def test_edge_on_faces_away():
    table = edge_table(*SQUARE)
    for light in ((1, 0, 0, 0), (5, 3, 0, 1), (0.5, 0.5, 0, 1), (0, 0, 0, 1)):
        assert not LitMesh(table, light).facing.any()
        assert np.isfinite(LitMesh(table, light).volume()[0]).all()


def test_a_light_at_a_corner_skips_what_it_touches():
    table = edge_table(*CUBE)
    corner = np.append(CUBE[0][0], 1)
    touched = (CUBE[1] == 0).any(axis=1)
    np.testing.assert_array_equal(LitMesh(table, corner).weights == 0, touched)
    assert np.isfinite(LitMesh(table, corner).volume()[0]).all()


def test_no_triangles():
    table = edge_table(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert not table.closed
    for light in ((1, 0, 0, 0), (0, 0, 0, 1)):
        vertices, triangles = LitMesh(table, light).volume()
        assert vertices.shape[1:] == (4,)
        assert triangles.shape == (0, 3)
