"""Plotters of plain actors that show what pvibr shows: pictures, numbers of triangles, files."""

import numpy as np
import pytest
import pyvista as pv
import trimesh

import pvibr
from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Skeleton, Track
from pvibr.core import _vtk
from pvibr.export.copies import Copies, chosen_levels
from pvibr.export.drawn_surfaces import surface_of_part, tiled
from pvibr.export.paint import Lamps, cut
from pvibr.meshes.parts import as_parts
from pvibr.points.unit_meshes import balls
from pvibr.substitutes.billboard_cloud import billboard_cloud
from pvibr.things.frame import Frame
from tests.animation.conftest import document
from tests.refusals import refused

SIZE = (160, 120)


@pytest.fixture(autouse=True)
def _quick_bakes(monkeypatch):
    monkeypatch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)


def plotter(*contents, **kwargs):
    pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none', **kwargs)
    pl.set_background('white')
    pl.add_light(pv.Light(position=(2, -3, 5), light_type='scene light', intensity=0.8))
    pl.add_light(pv.Light(light_type='headlight', intensity=0.2))
    for add in contents:
        add(pl)
    return pl


def look(pl, shift=(0, 0, 0)):
    shift = np.array(shift)
    pl.camera_position = [np.array([5, -8, 5.0]) + shift, shift, (0, 0, 1)]


def ground(pl, shift=(0, 0, 0)):
    return pl.add_mesh(pv.Plane(center=shift, i_size=8, j_size=8), color='tan')


def ball(pl, shift=(0, 0, 0)):
    mesh = pv.Sphere(radius=0.8, center=np.array([0, 0, 1.0]) + shift)
    return pl.add_mesh(mesh, color='orange', smooth_shading=True)


def shown(pl):
    pl.show(auto_close=False)
    return pl


def triangles(pl):
    actors = [a for r in pl.renderers for a in r.actors.values()]
    return sum(a.mapper.dataset.n_cells for a in actors if getattr(a, 'mapper', None) is not None)


def pictures(pl, **options):
    """Return what is shown before, and by what is baked."""
    pl.show(auto_close=False)
    before = pl.screenshot().astype(int)
    made = pl.ibr.to_plain_plotter(**options)
    made.show(auto_close=False)
    after = made.screenshot().astype(int)
    again = pl.screenshot().astype(int)
    assert np.array_equal(before, again)  # the input is as it was
    return before, after


def differ(pl, **options):
    before, after = pictures(pl, **options)
    return np.abs(before - after).mean()


def test_a_scene_without_effects_is_copied():
    pl = plotter(ground)
    mesh = pv.Sphere()
    mesh['height'] = mesh.points[:, 2]
    pl.add_mesh(mesh, scalars='height', show_edges=True)
    pl.add_mesh(pv.Line((-2, 0, 0), (2, 0, 2)), color='red', line_width=3)
    pl.add_mesh(pv.Cube().translate((2, 0, 0.5)), style='wireframe', color='blue')
    pl.add_text('text')
    look(pl)
    assert differ(pl) < 0.02


def test_volumes_and_axes_are_there():
    pl = plotter()
    grid = pv.ImageData(dimensions=(8, 8, 8))
    grid['v'] = np.linspace(0, 1, 512)
    pl.add_volume(grid, show_scalar_bar=False, opacity='linear')
    pl.show_grid()
    look(pl, (4, 4, 4))
    assert differ(pl) < 3


def test_subplots_cameras_lights_and_sizes_are_the_same():
    pl = plotter(shape='1|2')
    for k in range(3):
        pl.subplot(k)
        pl.set_background((k / 4, 0, 0), top='white' if k else None)
        pl.add_mesh(pv.Sphere(radius=1 + k))
    pl.link_views([0, 1])
    pl.subplot(2)
    pl.enable_parallel_projection()
    pl.ibr.add_spheres([[2, 0, 0]])
    made = shown(pl).ibr.to_plain_plotter()
    assert made.window_size == pl.window_size
    assert [r.viewport for r in made.renderers] == [r.viewport for r in pl.renderers]
    cameras = [r.camera for r in made.renderers]
    assert cameras[0] is cameras[1]
    assert cameras[0] is not pl.renderers[0].camera
    assert cameras[2].parallel_projection
    for old, new in zip(pl.renderers, made.renderers, strict=True):
        assert np.allclose(old.camera.position, new.camera.position)
        assert old.GetBackground() == new.GetBackground()
        assert old.GetGradientBackground() == new.GetGradientBackground()
        assert len(old.lights) == len(new.lights)


@pytest.mark.parametrize(
    ('name', 'value', 'error'),
    [
        ('triangles', 0, ValueError),
        ('triangles', 1.5, ValueError),
        ('triangles', True, TypeError),
        ('texture', -1, ValueError),
        ('detail', 0, ValueError),
        ('detail', 'fine', TypeError),
    ],
)
def test_bad_numbers(name, value, error):
    pl = plotter()
    refused(name, pl.ibr.to_plain_plotter, kind=error, **{name: value})


def test_what_is_lost_is_named_once():
    pl = plotter(ground)
    pl.ibr.add(pvibr.Bloom())
    pl.ibr.add(pvibr.Vignette())
    with pytest.warns(pvibr.PvibrWarning, match='Bloom .*Vignette') as said:
        pl.ibr.to_plain_plotter()
    assert len(said) == 1


def test_what_is_off_or_not_visible_is_left_out():
    pl = plotter(ground)
    balls = pl.ibr.add_spheres([[0, 0, 1]])
    balls.visibility = False
    pl.ibr.add(pvibr.Bloom()).enabled = False
    made = shown(pl).ibr.to_plain_plotter()
    assert triangles(made) == 100


@pytest.mark.parametrize('shift', [(0, 0, 0), (1e6, -1e6, 0)])
def test_shadows_become_colours(shift):
    pl = plotter()
    pl.renderer.lights[0].position = np.array([2, -3, 5.0]) + shift
    pl.renderer.lights[0].focal_point = shift
    ground(pl, shift)
    ball(pl, shift)
    pl.ibr.add(pvibr.Shadows())
    look(pl, shift)
    before, after = pictures(pl)
    assert np.abs(before - after).mean() < 0.5
    dark = (before.sum(2) < 200) & (before.sum(2) > 0)
    assert dark.sum() > 50  # there is a shadow
    assert np.abs(before - after)[dark].mean() < 12


def test_shadows_on_flat_coloured_and_textured_things():
    pl = plotter()
    mesh = pv.Plane(i_size=8, j_size=8, i_resolution=8, j_resolution=8)
    mesh.cell_data['check'] = np.add.outer(np.arange(8), np.arange(8)).ravel() % 2
    pl.add_mesh(mesh, scalars='check', cmap='coolwarm', show_scalar_bar=False)
    image = np.zeros((4, 4, 3), np.uint8)
    image[::2] = 255
    wall = pv.Plane(center=(0, 3, 1), direction=(0, -1, 0), i_size=2, j_size=6)
    pl.add_mesh(wall, texture=pv.Texture(image))
    pl.add_mesh(pv.Cube(center=(1, 0, 0.5)), color='green')
    pl.ibr.add(pvibr.Shadows(method='pcss'))
    look(pl)
    assert differ(pl, detail=1 / 128) < 2.5


@pytest.mark.sampled
@pytest.mark.parametrize('mode', ['replace', 'modulate', 'decal', 'add'])
@pytest.mark.parametrize('texture', [0, 256])
def test_projected_pictures(mode, texture):
    pl = plotter(ground, ball)
    image = np.zeros((16, 16, 3), np.uint8)
    image[:8, :8], image[8:, 8:], image[:8, 8:] = (255, 0, 0), (0, 0, 255), (200, 200, 0)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, -2, 6), (0, 0, 0), (0, 1, 0)
    pl.ibr.add(pvibr.Projector(image, camera, mode=mode, lit=mode == 'decal'))
    look(pl)
    assert differ(pl, texture=texture, triangles=60_000) < 5


def test_sky_becomes_a_dome_and_outlines_lines():
    pl = plotter(ball)
    pl.add_mesh(pv.Cube(center=(2, 0, 0.5)), color='green')
    pl.ibr.add(pvibr.Sky())
    outline = pl.ibr.add(pvibr.Outline(color=(1, 0, 0)))
    look(pl)
    made = shown(pl).ibr.to_plain_plotter()
    lines = [a for a in made.actors.values() if a.mapper.dataset.n_lines]
    assert len(lines) == 1
    assert lines[0].prop.color == 'red'
    assert lines[0].prop.line_width == outline.width
    assert 'sky' in made.actors
    before, after = pictures(pl)
    assert np.abs(before - after).mean() < 4.5  # lines are thinner where a ball bulges before them
    assert np.abs(before - after)[:20].mean() < 1.5  # sky alone


def test_instances_keep_places_colours_and_holes():
    pl = plotter(ground)
    cones = pl.ibr.add_instances(
        pv.Cone(direction=(0, 0, 1)),
        [[2, 2, 0.5], [-2, 1, 0.5], [0, -1, 0.5], [0, 2, 0.5]],
        colors=[[255, 0, 0], [0, 255, 0], [0, 0, 255], [0, 0, 0]],
        cache=False,
    )
    cones.update([3], visible=False)
    look(pl)
    assert differ(pl) < 1.5
    made = pl.ibr.to_plain_plotter()
    cone = pv.Cone(direction=(0, 0, 1)).triangulate()
    assert triangles(made) == 100 + 3 * cone.n_cells


@pytest.mark.slow
def test_a_number_of_triangles_is_kept_to():
    pl = plotter()
    look(pl)
    pl.show(auto_close=False)
    frame = Frame.of(pl.renderer)
    heavy = [as_parts(pv.Sphere(theta_resolution=n, phi_resolution=n)) for n in (40, 20)]
    places = np.array([[x, y, 0.0] for x in range(-4, 5) for y in range(-4, 5)])
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, 3] = places
    away = np.linalg.norm(places - frame.eye, axis=1)
    for most in (400_000, 60_000, 9_000, 500):
        group = Copies(None, list(heavy), (np.inf, 30.0), matrices)
        (levels,) = chosen_levels([group], frame, most, billboard_cloud)
        total = sum(group.triangles[k] for k in levels[levels >= 0])
        assert most / 20 < total <= most or (levels >= 0).all()
        assert total <= most
        # Who is nearer is never lighter.
        rank = np.where(levels < 0, 99, levels)[np.argsort(away)]
        assert (np.diff(rank) >= 0).all()
        shown = group.surfaces(levels)
        assert sum(len(s.faces) for s in shown) == total
    assert (levels < 0).any()


def test_what_there_is_no_room_for_is_named():
    pl = plotter()
    pl.ibr.add_spheres(np.random.default_rng(0).uniform(-2, 2, (50, 3)), 0.1)
    pl.show(auto_close=False)
    with pytest.warns(pvibr.PvibrWarning, match=r'\d+ of Spheres, the smallest on the screen'):
        made = pl.ibr.to_plain_plotter(triangles=200)
    assert 0 < triangles(made) <= 200


def test_quadrics_and_their_opacity():
    pl = plotter()
    pl.ibr.add_spheres([[0, 0, 1], [2, 0, 1]], [1.0, 0.5], colors=[[255, 0, 0], [0, 255, 0]])
    pl.ibr.add_cylinders(
        [[-3, 0, 0], [-2, 2, 0], [-2, -2, 1]],
        [[-3, 0, 2], [-2, 3, 1], [-2, -2, 1]],
        0.3,
        caps='round',
        color='blue',
    )
    pl.ibr.add_ellipsoids([[2, -2, 0]], [[1.0, 0.5, 0.3]], opacity=0.5)
    look(pl)
    assert differ(pl) < 2


def test_billboards_and_their_shadows():
    pl = plotter(ground)
    image = np.zeros((32, 32, 4), np.uint8)
    y, x = np.mgrid[:32, :32]
    image[..., 0], image[..., 1] = 255, 8 * y
    image[..., 3] = np.where((x - 16) ** 2 + (y - 16) ** 2 < 200, 255, 0)
    pl.ibr.add_billboards([[-1, 0, 1], [1.5, 0, 1]], image, size=1.5, facing='cylindrical')
    pl.ibr.add_billboards([[0, 2, 1.0]], image[::-1], size=20, size_unit='pixel', cutout=None)
    look(pl)
    assert differ(pl) < 0.6
    pl.ibr.add(pvibr.Shadows())
    before, after = pictures(pl)
    assert np.abs(before - after).mean() < 4  # pvibr turns each to the light


def balloon():
    rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2.0]])])
    body = FigureMesh(pv.Sphere(radius=0.6), node=0)
    return Figure([body], Skeleton([-1], np.eye(4)[None]), [rise])


def test_figures_are_posed_as_they_are_now():
    pl = plotter(ground)
    pl.ibr.add_animated(balloon(), color='red')
    look(pl)
    pl.ibr.time = 0.5
    assert differ(pl) < 0.6
    made = pl.ibr.to_plain_plotter()
    red = [a for a in made.actors.values() if a.prop.color == 'red']
    assert np.isclose(red[0].center[2], 1.0, atol=1e-3)


def test_crowds_are_posed_each_at_its_time():
    pl = plotter(ground)
    pl.ibr.add_animated(
        balloon(),
        [[-2, 0, 0.6], [2, 0, 0.6]],
        times=[0.0, 0.5],
        max_error=8,
        cache=False,
        colors=[[255, 0, 0], [0, 0, 255]],
    )
    look(pl)
    made = shown(pl).ibr.to_plain_plotter()
    tops = sorted(a.bounds[5] for a in made.actors.values())
    assert np.allclose(tops[1:], [1.2, 2.2], atol=0.01)
    few = pl.ibr.to_plain_plotter(triangles=800)
    assert triangles(few) <= 100 + 800 * 1.2


def test_impostors_are_their_actors():
    pl = plotter()
    heavy = ball(pl)
    pl.ibr.add_impostor(heavy, only_if_faster=False)
    look(pl)
    assert differ(pl) < 1


def test_everything_together_in_subplots():
    pl = plotter(shape=(1, 2))
    for k in range(2):
        pl.subplot(0, k)
        ground(pl)
        pl.add_mesh(pv.Sphere(center=(1, 0, 0.6)), color='red', opacity=0.5)
        grid = pv.ImageData(dimensions=(6, 6, 6), spacing=(0.3,) * 3, origin=(-2, -2, 0))
        grid['v'] = np.linspace(0, 1, 216)
        pl.add_volume(grid, show_scalar_bar=False, opacity='linear')
        pl.add_light(pv.Light(position=(2, -3, 5), light_type='scene light', intensity=0.8))
        shadows = pl.ibr.add(pvibr.Shadows())
        pl.ibr.add_spheres([[-1, 2, 0.5]], 0.5)
        look(pl)
    pl.ibr.remove(shadows)
    pl.ibr.add(shadows)
    pl.enable_depth_peeling()
    assert differ(pl) < 4


def test_a_window_that_was_never_drawn():
    pl = plotter(ground, ball)
    pl.ibr.add(pvibr.Shadows())
    pl.ibr.add_billboards([[1, 1, 1]], np.ones((4, 4)), size=9, size_unit='pixel')
    made = pl.ibr.to_plain_plotter()
    made.show(auto_close=False)
    pl.show(auto_close=False)
    assert np.abs(made.screenshot().astype(int) - pl.screenshot()).mean() < 1


def test_what_is_baked_can_be_baked_and_shown_again():
    pl = plotter(ground, ball)
    pl.ibr.add(pvibr.Shadows())
    look(pl)
    pl.show(auto_close=False)
    once = pl.ibr.to_plain_plotter()
    assert not once.ibr.web_report().rows
    assert differ(once) < 0.02


def test_a_renderer_of_plain_vtk():
    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    with pvibr.attach(renderer) as ibr:
        ibr.add_spheres([[0, 0, 0]], 1.0)
        window.Render()
        made = ibr.to_plain_plotter()
        assert triangles(made) > 100
        assert tuple(made.window_size) == SIZE


def vertex_colours(geometry):
    """Return the colours of vertices that trimesh reads, each once."""
    found = geometry.visual.vertex_attributes.get('color', np.zeros((0, 3)))
    found = found if found.dtype == np.uint8 else np.rint(255 * np.asarray(found, float))
    return np.unique(found[:, :3].astype(int), axis=0).tolist()


def test_glb_has_bounds_triangles_and_colours(tmp_path):
    pl = plotter(ground)
    pl.ibr.add_spheres([[0, 0, 1]], 1.0, colors=[[255, 0, 0]])
    look(pl)
    pl.show(auto_close=False)
    pl.ibr.export_glb(tmp_path / 'scene.glb', triangles=20_000)
    scene = trimesh.load(tmp_path / 'scene.glb')
    made = pl.ibr.to_plain_plotter(triangles=20_000)
    low, high = np.reshape(made.bounds, (3, 2)).T
    upright = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up
    wanted = np.sort(np.stack([upright @ low, upright @ high]), 0)
    assert np.allclose(scene.bounds, wanted, atol=1e-5)
    found = sum(len(g.faces) for g in scene.geometry.values())
    cells = [a.mapper.dataset.triangulate().n_cells for a in made.actors.values()]
    assert found == sum(cells)
    assert [[255, 0, 0]] in [vertex_colours(g) for g in scene.geometry.values()]


def test_glb_far_from_the_origin_is_as_sharp(tmp_path):
    pl = plotter()
    pl.ibr.add_spheres([[1e7, 0, 0]], 1.0)
    pl.show(auto_close=False)
    pl.ibr.export_glb(tmp_path / 'far.glb')
    scene = trimesh.load(tmp_path / 'far.glb')
    (mesh,) = scene.geometry.values()
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert np.allclose(radius, 1.0, atol=1e-5)
    assert np.allclose(scene.bounds.mean(0), [1e7, 0, 0], atol=1)


def test_glb_of_textures_holes_and_lines(tmp_path):
    pl = plotter()
    image = np.full((8, 8, 4), 255, np.uint8)
    image[:4, :, 3] = 0
    pl.ibr.add_billboards([[0, 0, 0]], image)
    pl.add_mesh(pv.Cube(center=(2, 0, 0)))
    pl.ibr.add(pvibr.Outline(opacity=0.5))
    pl.add_volume(np.zeros((4, 4, 4)), show_scalar_bar=False)
    pl.show(auto_close=False)
    pl.ibr.export_glb(tmp_path / 'scene.glb')
    file, _ = document(tmp_path / 'scene.glb')
    modes = {m.get('alphaMode', 'OPAQUE') for m in file['materials']}
    assert modes == {'MASK', 'OPAQUE', 'BLEND'}
    assert file['extensionsUsed'] == ['KHR_materials_unlit']
    assert 1 in [p.get('mode', 4) for m in file['meshes'] for p in m['primitives']]
    assert len(file['images']) == 1
    assert file['cameras'][0]['type'] == 'perspective'


def test_bad_names_of_files(tmp_path):
    pl = plotter(ground)
    refused(r'must end in \.glb', pl.ibr.export_glb, tmp_path / 'scene.obj')
    (tmp_path / 'folder.glb').mkdir()
    refused('folder', pl.ibr.export_glb, tmp_path / 'folder.glb', kind=OSError)
    assert [p.name for p in tmp_path.iterdir()] == ['folder.glb']


def test_a_page_is_whole_or_not_there(tmp_path):
    pl = plotter(shape=(1, 2))
    pl.ibr.add_spheres([[0, 0, 0]])
    pl.camera.view_angle = 50
    pl.show(auto_close=False)
    pl.ibr.export_html(tmp_path / 'page.html')
    assert 'data-chunk="1"' in (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert pl.camera.view_angle == 50
    refused(r'must end in \.html', pl.ibr.export_html, tmp_path / 'page.pdf')
    (tmp_path / 'folder.html').mkdir()
    refused('folder', pl.ibr.export_html, tmp_path / 'folder.html', kind=OSError)
    assert sorted(p.name for p in tmp_path.iterdir()) == ['folder.html', 'page.html']


def test_gltf_of_pyvista_has_what_is_baked(tmp_path):
    pl = plotter(ground, ball)
    pl.ibr.add(pvibr.Shadows())
    look(pl)
    made = shown(pl).ibr.to_plain_plotter()
    made.export_gltf(str(tmp_path / 'scene.gltf'), rotate_scene=False)
    scene = trimesh.load(tmp_path / 'scene.gltf')
    assert np.allclose(scene.bounds, np.reshape(made.bounds, (3, 2)).T, atol=1e-4)
    assert sum(len(g.faces) for g in scene.geometry.values()) == triangles(made)
    # The ground has the shadow of the ball, whose lit side has none.
    assert max(len(vertex_colours(g)) for g in scene.geometry.values()) > 100


@pytest.mark.parametrize('seed', range(5))
def test_cut_keeps_area_and_has_no_gaps(seed):
    rng = np.random.default_rng(seed)
    mesh = pv.Sphere(theta_resolution=8, phi_resolution=6).clean()
    rows = {'points': np.asarray(mesh.points, float)}
    rows, faces = cut(
        rows, np.array(mesh.regular_faces), lambda ends, _: rng.random(len(ends)) < 0.4, 5000, 4
    )
    made = pv.PolyData.from_regular_faces(rows['points'], faces)
    assert made.n_cells > mesh.n_cells
    assert np.isclose(made.area, mesh.area)
    assert made.n_open_edges == 0
    assert made.is_manifold
    centers = made.cell_centers().points
    normals = made.compute_normals(auto_orient_normals=False, consistent_normals=False)
    assert (np.einsum('ij,ij->i', centers, normals.cell_data['Normals']) > 0).all()


def test_cut_stops_at_its_most():
    rows = {'points': np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])}
    _, faces = cut(rows, np.array([[0, 1, 2]]), lambda _, length: length > 0, 100)
    assert 16 <= len(faces) <= 100


def test_lamps_shine_as_those_of_vtk():
    pl = pv.Plotter(off_screen=True, window_size=(40, 40), lighting='none')
    pl.add_mesh(pv.Plane(i_size=4, j_size=4), color='white')
    pl.add_light(pv.Light(position=(1, 1, 2), light_type='scene light', color='red'))
    spot = pv.Light(position=(0, 0, 3), light_type='scene light', intensity=0.5)
    spot.positional, spot.cone_angle, spot.exponent = True, 40, 2
    spot.attenuation_values = (0.5, 0.1, 0.05)
    pl.add_light(spot)
    pl.view_xy()
    pl.enable_parallel_projection()
    pl.show(auto_close=False)
    middle = pl.screenshot()[20, 20] / 255
    lamps = Lamps(pl.renderer)
    point, normal = np.zeros((1, 3)), np.array([[0, 0, 1.0]])
    found = sum(lamps.on(k, point, normal)[0] for k in range(2))
    assert np.allclose(np.minimum(found, 1), middle, atol=0.03)


def test_tiled_copies_are_the_mesh_in_each_place():
    (part,) = as_parts(pv.Cone(), color='red')
    one = surface_of_part(part, None)
    mirror = np.diag([-1.0, 1, 1, 1])
    mirror[:3, 3] = 5, 0, 0
    both = tiled(one, np.stack([np.eye(4), mirror]), np.uint8([[255, 0, 0], [0, 0, 255]]))
    mesh = both.mesh()
    assert np.isclose(mesh.volume, 2 * one.mesh().volume)
    assert mesh.bounds[1] == pytest.approx(5.5)
    assert both.colors[0].tolist() == [255, 0, 0, 255]
    assert both.colors[-1].tolist() == [0, 0, 255, 255]


def test_larger_copies_get_better_levels():
    pl = plotter()
    look(pl)
    pl.show(auto_close=False)
    levels, largest = balls(pv.Property())
    matrices = np.tile(np.eye(4), (30, 1, 1))
    matrices[:, :3, :3] *= np.geomspace(0.01, 3, 30)[:, None, None]
    group = Copies(pv.Actor(), levels, largest, matrices)
    (found,) = chosen_levels([group], Frame.of(pl.renderer), 10**6, billboard_cloud)
    assert (np.diff(found) <= 0).all()
    assert found[0] == len(levels) - 1
    assert found[-1] < found[0]


def test_ranges_of_bars_are_told_before_the_bars_are_drawn():
    pl = pv.Plotter(off_screen=True, window_size=(120, 90))
    pl.ibr.add_spheres([[0, 0, 0], [1, 0, 0]], 0.2, scalars=[0.0, 59.0])
    plain = pl.ibr.to_plain_plotter()
    props = list(plain.renderer.GetViewProps())
    bar = next(prop for prop in props if prop.IsA('vtkScalarBarActor'))
    table = bar.GetLookupTable()
    tellers = [
        prop
        for prop in props[: props.index(bar)]
        if prop.IsA('vtkActor') and prop.GetMapper().GetLookupTable() is table
    ]
    assert [prop.GetMapper().GetScalarRange() for prop in tellers] == [(0.0, 59.0)]


def test_cells_keep_their_range_beside_other_scalars():
    mesh = pv.Plane(i_resolution=4, j_resolution=4)
    mesh.point_data['points'] = np.arange(mesh.n_points, dtype=float)
    mesh.cell_data['cells'] = 100.0 + np.arange(mesh.n_cells)
    mesh.set_active_scalars('points')
    pl = pv.Plotter(off_screen=True)
    actor = pl.add_mesh(mesh, scalars='cells', name='plane')
    plain = pl.ibr.to_plain_plotter()
    assert plain.actors['plane'].GetMapper().GetScalarRange() == (100, 115)
    assert actor.mapper.scalar_range == (100, 115)
    pl.close()
    plain.close()
