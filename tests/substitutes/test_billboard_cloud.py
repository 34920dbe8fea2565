import numpy as np
import pytest
import pyvista as pv
import trimesh
from scipy import ndimage

import pvibr
from pvibr.core import _vtk
from pvibr.maths.image_error import silhouette_iou
from pvibr.scenes.trees import tree_parts
from pvibr.substitutes.billboard_cloud import billboard_cloud
from tests.makers import full_disk, lamp
from tests.marks import slow
from tests.refusals import refused

VIEWS = [(1, 2, 0.8), (-2, 0.6, -0.7), (0.2, -1, 2)]


def looked_at(pl, view, bounds):
    """Look at the middle of what has bounds; return its middle and its size."""
    low, high = np.reshape(bounds, (3, 2)).T
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    direction = np.array(view) / np.linalg.norm(view)
    pl.background_color = 'white'
    pl.camera_position = [tuple(middle + 2.2 * size * direction), tuple(middle), (0, 0, 1)]
    return middle, size


def picture(add, view, bounds, **looks):
    pl = pv.Plotter(off_screen=True, window_size=(120, 120))
    add(pl, **looks)
    looked_at(pl, view, bounds)
    return taken(pl)


def coverage(image):
    return (image.min(-1) < 250).astype(float)


@pytest.fixture(scope='module')
def torus():
    return pv.ParametricTorus(u_res=40, v_res=20, w_res=20).triangulate()


@pytest.fixture(scope='module')
def cloud(torus):
    return torus.ibr.billboard_cloud(
        epsilon=0.03, size=256, supersample=2, color='red', smooth_shading=True
    )


@pytest.mark.slow
def test_no_vertex_is_displaced_beyond_the_bound(torus, cloud):
    assert isinstance(cloud, pvibr.BillboardCloud)
    diagonal = np.linalg.norm(np.ptp(torus.points, axis=0))
    assert cloud.epsilon == pytest.approx(0.03 * diagonal)
    away = cloud.planes.displacements(torus.points, torus.regular_faces)
    assert away.max() <= cloud.epsilon
    assert cloud.displacement <= cloud.epsilon
    assert 0.2 < cloud.fill <= 1
    assert 0.2 < cloud.packing <= 1
    assert 'planes' in repr(cloud)


def test_rectangles_lie_on_their_planes(cloud):
    mesh = cloud.mesh
    plane = mesh.cell_data['plane'][mesh.cell_data['plane'] >= 0]
    faces = mesh.faces[: 5 * len(plane)].reshape(-1, 5)[:, 1:]
    points = mesh.points[faces]
    away = np.abs(cloud.planes.distances(points)[np.arange(len(plane)), :, plane])
    assert away.max() <= 0.011 * cloud.epsilon
    right, up = points[:, 1] - points[:, 0], points[:, 3] - points[:, 0]
    normals = mesh.point_data.active_normals[faces[:, 0]]
    assert (np.einsum('nd,nd->n', np.cross(right, up), normals) > 0).all()


@pytest.mark.parametrize('view', VIEWS)
def test_it_looks_like_the_mesh(torus, cloud, view):
    def add(pl, **looks):
        pl.add_mesh(torus, color='red', **({'smooth_shading': True} | looks))

    one, other = (picture(a, view, torus.bounds) for a in (add, cloud.add_to))
    assert silhouette_iou(coverage(one), coverage(other)) > 0.85
    both = (coverage(one) * coverage(other)).astype(bool)
    assert np.abs(one - other)[both].mean() < 25
    flat = [picture(a, view, torus.bounds, lighting=False) for a in (add, cloud.add_to)]
    assert np.abs(flat[0] - flat[1])[both].mean() < 8


def test_any_backend_shows_it_by_add_mesh(cloud, torus):
    def add(pl):
        pl.add_mesh(cloud.mesh, texture=cloud.texture, lighting=False)

    drawn = coverage(picture(add, VIEWS[0], torus.bounds))
    own = coverage(picture(cloud.add_to, VIEWS[0], torus.bounds, lighting=False))
    assert silhouette_iou(drawn, own) > 0.9


def rays(seed):
    """Return the directions toward a viewer, away from axes."""
    found = np.random.default_rng(seed).normal(size=(4, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def share_of_holes(mesh, cloud, views):
    """Return the share of VTK's pixels well inside a mesh that show none of its cloud."""
    inner = holes = 0
    for view in views:
        whole = coverage(picture(lambda pl: pl.add_mesh(mesh, lighting=False), view, mesh.bounds))
        found = coverage(picture(cloud.add_to, view, mesh.bounds, lighting=False))
        deep = ndimage.binary_erosion(whole > 0, iterations=2)
        inner, holes = inner + deep.sum(), holes + (deep & (found == 0)).sum()
    return holes / inner


def knot():
    t = np.linspace(0, 2 * np.pi, 161)
    r = 2.2 + np.cos(3 * t)
    line = np.column_stack([r * np.cos(2 * t), r * np.sin(2 * t), -np.sin(3 * t)])
    return pv.Spline(line, 200).tube(radius=0.35, n_sides=14).triangulate()


def hills(seed=3):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*[np.linspace(0, 1, 40)] * 2)
    z = sum(np.sin(a * x + b * y + c) for a, b, c in rng.normal(0, 8, (5, 3))) * 0.05
    return pv.StructuredGrid(x, y, z).extract_surface(algorithm=None).triangulate()


@pytest.mark.slow
@pytest.mark.parametrize('make', [slow(knot), hills])
def test_no_holes_within_the_outline(make):
    mesh = make()
    open_, closed = (
        mesh.ibr.billboard_cloud(epsilon=0.02, size=256, supersample=1, color='red', patches=p)
        for p in (False, True)
    )
    views = rays(7)
    assert share_of_holes(mesh, open_, views) > 0.03
    assert share_of_holes(mesh, closed, views) < 0.005
    assert open_.holes > 0.03
    assert closed.holes < 0.005
    assert closed.normal_error < open_.normal_error
    assert np.array_equal(closed.planes.normals, open_.planes.normals)
    assert open_.patches == 0
    assert closed.patches == (closed.mesh.cell_data['plane'] < 0).sum() < 0.4 * mesh.n_cells


def test_patches_are_near_the_mesh(torus, cloud):
    first = 4 * (cloud.mesh.cell_data['plane'] >= 0).sum()
    assert cloud.patches > 0
    patches = cloud.mesh.points[first:]
    distances = pv.PolyData(patches).compute_implicit_distance(torus)['implicit_distance']
    assert np.abs(distances).max() <= 0.5 * cloud.epsilon


def test_holes_of_few_given_planes_are_counted(torus):
    cloud = torus.ibr.billboard_cloud(planes=2, size=128, supersample=1, color='red')
    assert cloud.patches == 0
    found = share_of_holes(torus, cloud, rays(5))
    assert cloud.holes == pytest.approx(found, rel=0.5)
    assert cloud.holes > 0.05


@pytest.mark.slow
def test_stray_vertices_and_lines_are_left_out(torus):
    mesh = torus.copy()
    mesh.clear_data()
    rng = np.random.default_rng(2)
    colors = rng.integers(0, 255, (mesh.n_cells, 3)).astype(np.uint8)
    strays = mesh.copy()
    strays.verts, strays.lines = [1, 0, 1, 5], [2, 3, 9]
    mesh.cell_data['c'] = colors
    strays.cell_data['c'] = np.concatenate([np.zeros((3, 3), np.uint8), colors])
    both = [
        m.ibr.billboard_cloud(epsilon=0.1, size=64, supersample=1, scalars='c', rgb=True)
        for m in (mesh, strays)
    ]
    assert len(both[1].planes.owner) == mesh.n_cells
    assert np.array_equal(*(cloud.texture.to_array() for cloud in both))


def test_two_sides_have_two_pictures():
    plate = pv.Box((-1, 1, -1, 1, -0.01, 0.01)).triangulate()
    centers = plate.cell_centers().points[:, 2]
    colors = np.where(centers[:, None] > 0, [255, 0, 0], [0, 0, 255]).astype(np.uint8)
    plate.cell_data['c'] = colors
    cloud = plate.ibr.billboard_cloud(epsilon=0.05, size=64, scalars='c', rgb=True)
    assert (len(cloud.planes), cloud.mesh.n_cells) == (1, 2)
    for view, color in (((0.1, 0.1, 1), [255, 0, 0]), ((0.1, 0.1, -1), [0, 0, 255])):
        image = picture(cloud.add_to, view, plate.bounds, lighting=False)
        assert np.abs(image[60, 60] - color).max() < 3


def test_alpha_is_all_or_nothing_and_keeps_coverage(cloud):
    alpha = cloud.texture.to_array()[..., 3]
    assert set(np.unique(alpha)) == {0, 255}
    normals = cloud.normal_texture.to_array() / 127.5 - 1
    assert np.abs(np.linalg.norm(normals, axis=-1) - 1).max() < 0.02


@pytest.mark.slow
def test_leaves_with_holes():
    parts = tree_parts('broadleaf', triangles=23_000)
    cloud = billboard_cloud(parts, epsilon=0.1, size=256, supersample=2)
    points = np.concatenate([part.mesh.points for part in parts]).astype(float)
    first = np.cumsum([0, parts[0].mesh.n_points])
    faces = np.concatenate([p.mesh.regular_faces + k for p, k in zip(parts, first, strict=True)])
    assert cloud.planes.displacements(points, faces).max() <= cloud.epsilon
    shown = cloud.texture.to_array()
    shown = shown[shown[..., 3] > 0][:, :3].astype(int)
    assert (shown[:, 1] >= shown[:, 2]).mean() > 0.9  # leaves and bark, no black of no texture


def test_so_many_planes(torus):
    cloud = torus.ibr.billboard_cloud(planes=5, size=64)
    assert len(cloud.planes) <= 5
    assert cloud.epsilon is None
    away = cloud.planes.displacements(torus.points, torus.regular_faces)
    assert cloud.displacement == pytest.approx(away.max(), rel=0.02)


@pytest.mark.slow
def test_far_from_the_origin(torus):
    far = torus.copy()
    far.points = np.asarray(torus.points, float) + 1e6
    cloud = far.ibr.billboard_cloud(epsilon=0.03, size=64)
    assert np.abs(np.array(cloud.mesh.center) - 1e6).max() < 0.1
    assert cloud.displacement <= cloud.epsilon


def test_a_full_disk_leaves_no_part_of_a_cloud(cloud, tmp_path, monkeypatch):
    monkeypatch.setattr('os.fsync', full_disk)
    for name in ('a.obj', 'a.glb'):
        refused('the disk is full', cloud.save, tmp_path / name, kind=OSError)
    assert not list(tmp_path.iterdir())


def test_it_is_written_and_read_again(cloud, tmp_path):
    (glb,) = cloud.save(tmp_path / 'a.glb')
    scene = trimesh.load(glb)
    assert np.allclose(scene.bounds.T.ravel(), cloud.mesh.bounds, atol=1e-5)
    material = next(iter(scene.geometry.values())).visual.material
    assert (material.alphaMode, material.doubleSided) == ('MASK', True)
    assert np.array_equal(np.asarray(material.baseColorTexture), cloud.texture.to_array())
    assert np.array_equal(np.asarray(material.normalTexture), cloud.normal_texture.to_array())
    body = pvibr.read_gltf(glb).meshes[0]
    assert body.look['alpha_cutoff'] == 0.5
    files = cloud.save(tmp_path / 'two words.obj')
    assert len(files) == 4
    assert all(file.stat().st_size for file in files)
    mesh = trimesh.load(files[0])
    assert np.allclose(mesh.bounds.T.ravel(), cloud.mesh.bounds, atol=1e-5)
    assert np.array_equal(np.asarray(mesh.visual.material.image), cloud.texture.to_array())
    refused(r'\.glb or \.obj', cloud.save, tmp_path / 'a.stl')


def test_a_read_glb_looks_the_same(cloud, torus, tmp_path):
    (glb,) = cloud.save(tmp_path / 'a.glb')

    def add(pl):
        pl.ibr.add_animated(pvibr.read_gltf(glb))

    read = coverage(picture(add, VIEWS[0], torus.bounds))
    own = coverage(picture(cloud.add_to, VIEWS[0], torus.bounds))
    assert silhouette_iou(read, own) > 0.97


@pytest.mark.parametrize(
    ('wrong', 'name'),
    [
        ({'epsilon': 0}, 'epsilon'),
        ({'epsilon': np.nan}, 'epsilon'),
        ({'epsilon': 2}, 'epsilon'),
        ({'planes': 0}, 'planes'),
        ({'planes': 1.5}, 'planes'),
        ({'size': 8}, 'size'),
        ({'supersample': 3}, 'supersample'),
    ],
)
def test_bad_input_is_named(torus, wrong, name):
    refused(name, torus.ibr.billboard_cloud, **wrong)


def test_a_texture_too_small_for_its_planes_is_named():
    ball = pv.Sphere(theta_resolution=8, phi_resolution=8)
    refused(r'size must have room.*got 16', ball.ibr.billboard_cloud, epsilon=0.01, size=16)


def test_a_point_is_no_cloud():
    refused('all coincide', pv.PolyData(np.ones((3, 3)), faces=[3, 0, 1, 2]).ibr.billboard_cloud)
    refused('empty', pv.PolyData().ibr.billboard_cloud)
    refused('only points or lines', pv.Line().ibr.billboard_cloud)


def scene(add, bounds, view, *, light=(1, -1, 2), floor=False, **kwargs):
    """Return a plotter with one light and what is added, looked at as in :func:`picture`."""
    pl = pv.Plotter(off_screen=True, window_size=(120, 120), lighting='none', **kwargs)
    middle, size = looked_at(pl, view, bounds)
    pl.add_light(lamp(tuple(middle + 5 * size * np.array(light)), tuple(middle)))
    if floor:
        below = pv.Plane(center=(0, 0, bounds[4] - 0.1), i_size=9, j_size=9)
        pl.add_mesh(below, color='lightblue')
    add(pl)
    looked_at(pl, view, bounds)
    return pl


def taken(pl):
    pl.reset_camera_clipping_range()
    image = pl.screenshot().astype(float)
    pl.close()
    return image


@pytest.fixture(scope='module')
def ways(torus, cloud):
    """Functions that add the mesh, and its cloud, to a plotter."""
    return lambda pl: pl.add_mesh(torus, color='red', smooth_shading=True), cloud.add_to


def test_its_normals_follow_a_light_that_moves(torus, ways):
    lights = [(1, 0, 0.5), (-1, 0.3, 0.5), (0, 1, 1), (0.2, -1, 0.1), (0.3, 0.2, -1)]
    mesh, card = (
        [taken(scene(add, torus.bounds, VIEWS[0], light=light)) for light in lights]
        for add in ways
    )
    both = coverage(mesh[0]) * coverage(card[0]) > 0
    away = np.array([[np.abs(a - b)[both].mean() for b in mesh] for a in card])
    assert (away.argmin(1) == np.arange(len(lights))).all()
    assert away.diagonal().max() < 30
    others = away[~np.eye(len(lights), dtype=bool)]
    assert others.mean() > 2 * away.diagonal().mean()


BESIDE = {
    'shadows': lambda pl: pl.ibr.add(pvibr.Shadows()),
    'shadows of VTK': lambda pl: pl.enable_shadows(),
    'outlines': lambda pl: pl.ibr.add(pvibr.Outline()),
    'a lens': lambda pl: pl.ibr.add(pvibr.DepthOfField()),
    'SSAO': lambda pl: pl.enable_ssao(radius=0.3),
    'EDL': lambda pl: pl.enable_eye_dome_lighting(),
    'SSAA': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'glass': lambda pl: pl.add_mesh(pv.Sphere(center=(1, 1, 1)), color='lime', opacity=0.5),
    'glass, peeled': lambda pl: (
        pl.enable_depth_peeling(8),
        pl.add_mesh(pv.Sphere(center=(1, 1, 1)), color='lime', opacity=0.5),
    ),
}


@pytest.mark.parametrize('enable', BESIDE.values(), ids=BESIDE.keys())
def test_it_stands_beside_everything_as_the_mesh_does(enable, torus, ways):
    pictures = []
    for add in ways:
        pl = scene(add, torus.bounds, VIEWS[0], floor=True)
        enable(pl)
        pictures.append(taken(pl))
    away = np.abs(pictures[0] - pictures[1]).max(2)
    assert away.mean() < 12
    assert (away > 60).mean() < 0.08


def test_its_shadow_is_that_of_the_mesh_with_its_hole(torus, ways):
    lit, dark = [], []
    for add in ways:
        for found in (lit, dark):
            pl = scene(add, torus.bounds, VIEWS[0], light=(0.8, 0.8, 1), floor=True)
            pl.camera_position = [(0.1, 0, 14), (-0.5, -0.5, 0), (0, 1, 0)]
            if found is dark:
                pl.ibr.add(pvibr.Shadows())
            found.append(taken(pl))
    floor = np.all([image[..., 2] > image[..., 0] + 5 for image in lit], 0)
    masks = [((a - b).max(2) > 40) & floor for a, b in zip(lit, dark, strict=True)]
    assert masks[0].sum() > 200
    assert silhouette_iou(*(m.astype(float) for m in masks)) > 0.75


def test_holes_are_not_picked(cloud, torus):
    pl = pv.Plotter(off_screen=True, window_size=(120, 120))
    actor = cloud.add_to(pl)
    pl.camera_position = [(0, 0, 8), (0, 0, 0), (0, 1, 0)]
    pl.show(auto_close=False)
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)

    def found(x, y):
        selector.SetArea(x, y, x, y)
        nodes = selector.Select()
        props = [nodes.GetNode(k).GetProperties() for k in range(nodes.GetNumberOfNodes())]
        return [p.Get(_vtk.vtkSelectionNode.PROP()) for p in props]

    ring = np.flatnonzero(coverage(pl.screenshot())[60])
    assert not ((ring > 55) & (ring < 65)).any()
    assert found(60, 60) == []
    assert found(int(ring[len(ring) // 8]), 60) == [actor]


def test_it_is_taken_out_and_put_in_two_plotters(cloud, torus):
    images = []
    for _ in range(2):
        pl = scene(cloud.add_to, torus.bounds, VIEWS[0])
        pl.show(auto_close=False)
        (actor,) = pl.actors.values()
        pl.remove_actor(actor)
        assert (pl.screenshot() == 255).all()
        cloud.add_to(pl, reset_camera=False)
        images.append(taken(pl))
    assert np.array_equal(*images)
    assert coverage(images[0]).sum() > 100
