"""Near instances as meshes, many a draw: the pictures of plain actors, whatever the mesh is."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.gl.hidden_window import read_pixels
from pvibr.maths.flip import flip
from pvibr.maths.image_error import box_reduce
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import Stage

pytestmark = pytest.mark.sampled

SIZE = (150, 110)
CAMERA = {'eye': (7, -8, 6), 'focus': (0, 0, 0), 'angle': 32}


def poses(n=9, seed=3, stretch=0.4):
    """Return matrices on a grid: turned, stretched along skew axes, but not mirrored."""
    rng = np.random.default_rng(seed)
    out = np.tile(np.eye(4), (n, 1, 1))
    out[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    out[:, :3, :3] *= 1 + rng.uniform(-stretch, stretch, (n, 1, 3))
    i, j = np.divmod(np.arange(n), 3)
    out[:, :2, 3] = 1.8 * np.stack([i - 1, j - 1], 1)
    return out


def body():
    """Return something without symmetry, with all that a mesh may carry."""
    mesh = pv.ParametricEllipsoid(0.9, 0.6, 0.4, u_res=16, v_res=13, w_res=5)
    mesh = mesh.translate((0.2, 0, 0.1))
    mesh.points[:, 2] += 0.3 * mesh.points[:, 0] ** 2
    mesh = mesh.compute_normals(split_vertices=False, consistent_normals=False)
    mesh['height'] = mesh.points[:, 2].copy()
    mesh.cell_data['number'] = np.arange(mesh.n_cells, dtype=float)
    paint = np.rint(255 * np.abs(np.cos(3 * mesh.points))).astype(np.uint8)
    mesh['paint'] = paint
    mesh.active_texture_coordinates = 2 * mesh.points[:, :2].astype(np.float32)
    mesh.set_active_scalars(None)
    return mesh


def halves():
    """Return it in two parts."""
    mesh = body()
    cells = np.arange(mesh.n_cells)
    return pv.MultiBlock([mesh.extract_cells(cells[:150]), mesh.extract_cells(cells[150:])])


def checks(alpha=False):
    squares = np.indices((16, 16)).sum(0) // 4 % 2
    image = np.full((16, 16, 4 if alpha else 3), 255, np.uint8)
    image[..., 0] = 90 * squares + 100
    if alpha:
        image[..., 3] = 255 * squares
    return pv.Texture(image)


LOOKS = {
    'flat': {'color': 'tan'},
    'smooth': {'color': 'tan', 'smooth_shading': True},
    'shiny': {'color': 'tan', 'smooth_shading': True, 'specular': 0.8, 'specular_power': 9},
    'unlit': {'color': 'tan', 'lighting': False},
    'physical': {'color': 'tan', 'smooth_shading': True, 'pbr': True, 'roughness': 0.4},
    'points coloured': {'scalars': 'height', 'smooth_shading': True},
    'bands': {'scalars': 'height', 'n_colors': 5, 'interpolate_before_map': True},
    'cells coloured': {'scalars': 'number', 'cmap': 'viridis'},
    'painted': {'scalars': 'paint', 'rgb': True},
    'textured': {'texture': checks(), 'smooth_shading': True},
    'back faces': {'color': 'tan', 'backface_params': {'color': 'red'}},
    'culled': {'color': 'tan', 'culling': 'front'},
}


@pytest.mark.parametrize('look', LOOKS.values(), ids=LOOKS)
def test_looks_are_those_of_plain_actors(scenes, see, look):
    drawn, _ = near(scenes, body(), poses(), **look)
    same(see.grab(drawn), see.grab(plain(scenes, body(), poses(), **look)))


@pytest.mark.parametrize('look', ['smooth', 'textured', 'painted'])
def test_lighter_meshes_keep_their_looks(scenes, see, look):
    """Their normals and coordinates are what they are to VTK, in a draw of many as in an actor."""
    (part,) = as_parts(body(), **LOOKS[look])
    part = lighter(part, 0.5)
    drawn, _ = near(scenes, [part], poses())
    same(see.grab(drawn), see.grab(plain_parts(scenes, see, part)))
    data = part.mesh.point_data
    assert (data.active_scalars_name is None) == (look in ('smooth', 'textured'))


def plain_parts(scenes, see, part):
    """Return a plotter with an actor of a part at each pose."""
    truth = scenes.empty(SIZE)
    for matrix in poses():
        actor = part.new_actor(part.actor.mapper)
        actor.user_matrix = matrix
        truth.renderer.AddViewProp(actor)
    return see.place(truth, **CAMERA)


@pytest.mark.slow
def test_holes_and_parts(scenes, see):
    look = {'texture': checks(alpha=True), 'smooth_shading': True, 'alpha_cutoff': 0.5}
    drawn, _ = near(scenes, body(), poses(), **look)
    (part,) = as_parts(body(), **look)
    same(see.grab(drawn), see.grab(plain_parts(scenes, see, part)))
    drawn, _ = near(scenes, halves(), poses(), color='tan')
    truth = scenes.empty(SIZE)
    for matrix in poses():
        for half in halves():
            truth.add_mesh(half, color='tan').user_matrix = matrix
    same(see.grab(drawn), see.grab(see.place(truth, **CAMERA)))


@pytest.mark.parametrize('smooth', [False, True], ids=['flat', 'smooth'])
def test_mirrored_poses_are_mirrored_meshes(scenes, see, smooth):
    """As meshes whose points are mirrored: normals look outward, which VTK's actors' do not."""
    matrices = poses(stretch=0.2)
    matrices[::2, :3, 0] *= -1
    drawn, _ = near(scenes, body(), matrices, color='tan', smooth_shading=smooth)
    truth = scenes.empty(SIZE)
    for matrix in matrices:
        mesh = body().transform(matrix, inplace=False)
        if np.linalg.det(matrix[:3, :3]) < 0:
            mesh = mesh.flip_faces()
        inverse = np.linalg.inv(matrix[:3, :3])
        mesh.point_data.active_normals = body().point_data.active_normals @ inverse
        truth.add_mesh(mesh, color='tan', smooth_shading=smooth)
    same(see.grab(drawn), see.grab(see.place(truth, **CAMERA)))


def test_normals_of_cells(scenes, see):
    """VTK takes them for flat meshes that have them; they turn with each pose."""
    mesh = body().compute_normals(cell_normals=True, point_normals=False)
    mesh.cell_data.active_normals = -0.2 + mesh.cell_data.active_normals
    drawn, _ = near(scenes, mesh, poses(), color='tan')
    same(see.grab(drawn), see.grab(plain(scenes, mesh, poses(), color='tan')))


def test_colours_of_instances(scenes, see):
    """Each in its colour, instead of the mesh's or times it; hidden ones are not there."""
    matrices, rng = poses(), np.random.default_rng(4)
    colors = rng.uniform(0.2, 1, (9, 3))
    visible = np.arange(9) % 4 > 0
    for blend in ('replace', 'multiply'):
        drawn, things = near(scenes, body(), matrices, color=[0.5, 0.8, 1.0], blend=blend)
        things.colors, things.visible = colors, visible
        truth = scenes.empty(SIZE)
        for matrix, color in zip(matrices[visible], colors[visible], strict=True):
            color = np.rint(color * 255) / 255
            color = color * [0.5, 0.8, 1.0] if blend == 'multiply' else color
            truth.add_mesh(body(), color=color.tolist()).user_matrix = matrix
        same(see.grab(drawn), see.grab(see.place(truth, **CAMERA)), tolerance=2.5)


def field(ball, away, many, samples):
    """Return a picture of 400 small balls: of instances or plain actors, of so many samples."""
    places = poses(400, stretch=0.0)
    places[:, :2, 3] = 1.2 * (np.stack(np.divmod(np.arange(400), 20), 1) - 9.5)
    looks = {'smooth_shading': True, 'color': 'gold', 'specular': 0.4}
    how = {'samples': 8} if samples > 8 else {'multi_samples': samples}
    with Stage((200, 200), **how, background='white') as stage:
        if many:
            stage.plotter.ibr.add_instances(ball, places, bake=False, **looks)
        else:
            for place in places:
                stage.plotter.add_mesh(ball, **looks).user_matrix = place
        stage.look(((0, 0, away), (0, 0, 0), (0, 1, 0)))
        stage.draw()
        # Means of samples, as the truth is: VTK shows those of light.
        return box_reduce(read_pixels(stage.window, displayed=False), stage.samples) / 255


@pytest.mark.parametrize(('away', 'sides', 'gain'), [(90, 12, 0.85), (45, 12, 0.96)])
def test_several_samples_light_no_triangle_from_behind(away, sides, gain):
    ball = pv.Sphere(theta_resolution=sides, phi_resolution=sides).compute_normals()
    truth, plain, found = (field(ball, away, *how) for how in ((False, 64), (False, 4), (True, 4)))
    errors = [flip(picture, truth).mean() for picture in (found, plain)]
    assert errors[0] < gain * errors[1]
    covered = (truth < 0.99).any(2)
    darker = [abs((picture - truth)[covered, 0].mean()) for picture in (found, plain)]
    assert darker[0] < max(darker[1], 0.5 / 255)


@pytest.mark.parametrize('move', [1e6, 1e9])
def test_far_from_the_origin(scenes, see, move):
    here = see.grab(near(scenes, body(), poses(), color='tan')[0])
    moved = poses()
    moved[:, :3, 3] += move
    camera = CAMERA | {k: np.add(CAMERA[k], move) for k in ('eye', 'focus')}
    there, _ = near(scenes, body(), moved, camera=camera, color='tan')
    same(see.grab(there), here, share=0.002 if move < 1e8 else 0.05)


def test_many_a_draw(scenes, see):
    """A thousand of them in a few draws, points as poses; the same as actors, an actor each."""
    grid = np.stack(np.meshgrid(*[np.arange(32.0)] * 2), -1).reshape(-1, 2)
    points = np.column_stack([grid - 15.5, np.zeros(len(grid))])
    camera = {'eye': (0, -30, 30), 'angle': 40}
    drawn, things = near(scenes, pv.Cone(resolution=5), points, camera=camera, color='tan')
    picture = see.grab(drawn)
    assert len(draws(things)) <= 4
    assert drawn.ibr.report().rows[0].details['mesh 8'] > 900
    truth = plain(scenes, pv.Cone(resolution=5), points, camera=camera, color='tan')
    same(picture, see.grab(truth))


def test_translucent_ones_are_sorted(scenes, see):
    """From any side, what is in front is over what is behind: so are actors, drawn in order."""
    points = np.array([[0.0, 2, 0], [0, 0, 0], [0, -2, 0]])
    colors = np.eye(3)
    drawn, things = near(
        scenes, pv.Plane(direction=(0, 1, 0)), points, opacity=0.5, lighting=False
    )
    things.colors = colors
    for eye, order in (((0.1, -9, 0.1), (0, 1, 2)), ((0.1, 9, 0.1), (2, 1, 0))):
        truth = scenes.empty(SIZE)
        for i in order:
            plane = pv.Plane(center=points[i], direction=(0, 1, 0))
            truth.add_mesh(plane, color=colors[i].tolist(), opacity=0.5, lighting=False)
        camera = {'eye': eye, 'angle': 20}
        same(see.grab(see.place(drawn, **camera)), see.grab(see.place(truth, **camera)))


def test_styles_may_change(scenes, see):
    """Edges need a geometry shader, which draws an actor each; off again, draws serve again."""
    drawn, things = near(scenes, body(), poses(), color='tan')
    plainly = see.grab(drawn)
    (part,) = things.groups[0].levels[0].parts
    part.actor.prop.show_edges = True
    edged = see.grab(drawn)
    truth = plain(scenes, body(), poses(), color='tan', show_edges=True)
    same(edged, see.grab(truth))
    assert len(things.drawn()) == 9
    assert not draws(things)
    part.actor.prop.show_edges = False
    np.testing.assert_array_equal(see.grab(drawn), plainly)
    assert len(draws(things)) == 1


def test_one_draw_after_another(scenes, see):
    """Fewer instances in view, then more, in several draws: no draw keeps what is gone."""
    mesh = pv.Sphere(theta_resolution=60, phi_resolution=60)
    drawn, things = near(scenes, mesh, poses(12), color='tan', smooth_shading=True)
    whole = see.grab(drawn)
    assert len(draws(things)) > 3
    see.grab(see.place(drawn, (5, -3, 3), (1.8, 1.8, 0), angle=5))
    assert len(draws(things)) < 3
    np.testing.assert_array_equal(see.grab(see.place(drawn, **CAMERA)), whole)
    same(whole, see.grab(plain(scenes, mesh, poses(12), color='tan', smooth_shading=True)))


def test_shadows_are_those_of_plain_actors(scenes, see):
    """Lights see draws of depth alone: where each copy is, as actors are."""
    pictures = []
    for make in (near, plain):
        made = make(scenes, body(), poses(), color='tan')
        pl = made[0] if make is near else made
        pl.add_mesh(pv.Plane(center=(0, 0, -1), i_size=12, j_size=12), color='white')
        before = see.grab(see.place(pl, **CAMERA))
        pl.ibr.add(pvibr.Shadows(resolution=512))
        pictures.append(see.grab(pl))
        assert np.abs(pictures[-1] - before).max() > 0.1
    same(*pictures, share=0.01, tolerance=8)


def draws(things):
    """Return the actors that drew many instances each."""
    pools = [pool for group in things.groups for pool in group.near.pools]
    single = [actor for pool in pools for actor in pool.actors()]
    return [actor for actor in things.drawn() if actor not in single]


def near(scenes, mesh, places, **look):
    how = {'size': SIZE, 'camera': CAMERA, 'level': 'mesh'}
    return scenes.instances(mesh, places, **how | look)


def plain(scenes, mesh, places, **look):
    return scenes.actors(mesh, places, **{'size': SIZE, 'camera': CAMERA} | look)


def same(one, other, share=0.002, tolerance=1.5):
    """Assert that pictures are equal, but where the edge of a triangle is a rounding off."""
    assert np.ptp(other) > 0.2
    worst = np.abs(one - other).max(2)
    assert (worst > tolerance / 255).mean() <= share


@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize('beside', ['EDL', 'billboards before', 'billboards behind'])
def test_vtk_knows_where_meshes_are(scenes, see, bean, beside, offset):
    """Eye dome lighting scales by bounds, and translucent things are sorted by their middle."""
    look = {'color': 'tan', 'opacity': 1.0 if beside == 'EDL' else 0.5}
    places = np.array([[0, 0, 0], [1.6, 0.4, 0.2], [0.3, 1.5, -0.4]]) + offset
    camera = {'eye': places[0] + (1, -9, 3), 'focus': places[0] + (0.8, 0.8, 0)}
    pictures = []
    for pl in (
        scenes.instances(bean, places, bake=False, **look)[0],
        scenes.actors(bean, places, **look),
    ):
        if beside == 'EDL':
            pl.enable_eye_dome_lighting()
        else:
            point = places[0] + (0.8, -3 if 'before' in beside else 4, 0)
            white = np.full((4, 4, 3), 255, np.uint8)
            pl.ibr.add_billboards([point], white, size=2.0, opacity=0.5, colors=[(0.0, 0.0, 1.0)])
        pictures.append(see.grab(see.place(pl, **camera)))
        pl.close()
    # Bounding spheres are somewhat larger than what they hold.
    bound = 0.15 if beside == 'EDL' else 2 / 255
    assert np.abs(pictures[0] - pictures[1]).max() < bound


@pytest.mark.parametrize('number', [0, 1, 2])
def test_the_mesh_level_that_is_asked_for_is_drawn(scenes, see, number):
    ball = pv.Sphere(theta_resolution=36, phi_resolution=36)
    look = {'color': 'tan', 'lighting': False}  # outlines alone
    how = {'size': SIZE, 'camera': CAMERA, **look}
    pl, balls = scenes.instances(ball, poses(stretch=0.0), level=f'mesh{number or ""}', **how)
    drawn, levels = see.grab(pl), balls.groups[0].model.levels
    assert len(levels) == 3
    pl.close()
    found = []
    for level in levels:
        pl = scenes.actors(level.parts[0].mesh, poses(stretch=0.0), **how)
        found.append(np.abs(see.grab(pl) - drawn).max())
        pl.close()
    assert [difference == 0 for difference in found] == [k == number for k in range(3)]
