"""Impostors against the meshes that they stand for."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import distance_transform_edt

import pvibr
from pvibr.core import _vtk
from tests.pictures import shot, shown
from tests.refusals import refused
from tests.substitutes import test_image_layers as layers
from tests.substitutes.twins import Twins, displaced, edges

TORUS = pv.ParametricTorus(u_res=120, v_res=60)
BALL = pv.Sphere(theta_resolution=120, phi_resolution=60)
EYE = [(2, -9, 6), (0, 0, 0), (0, 0, 1)]


def kinds(picture):
    """Return which object is seen: by its hue."""
    r, g, b = np.moveaxis(picture, -1, 0)
    return (r > b + 20) * 1 + (g > b + 30) * 1


class Scene(Twins):
    """The same actors twice: as they are, and with impostors."""

    kinds = staticmethod(kinds)

    def __init__(self, *, offset=0.0, parallel=False, size=(320, 240), **settings):
        self.plotters, self.actors = [], []
        for _ in range(2):
            pl = pv.Plotter(off_screen=True, window_size=size)
            looks = {'smooth_shading': True, 'reset_camera': False}
            made = [
                pl.add_mesh(BALL, color='tomato', **looks),
                pl.add_mesh(TORUS, color='gold', specular=0.6, **looks),
                pl.add_mesh(pv.Plane(i_size=4, j_size=4), color='lightblue', reset_camera=False),
            ]
            made[1].position = (0.5, 0.3, 0.2)
            made[2].orientation = (20, -10, 0)
            for actor in made:
                actor.position = np.add(actor.position, offset)
            pl.camera_position = [np.add(p, offset) for p in EYE[:2]] + EYE[2:]
            pl.camera.parallel_projection = parallel
            pl.camera.parallel_scale = 2.5
            self.plotters.append(pl)
            self.actors.append(made)
            pl.show(auto_close=False)
        settings.setdefault('only_if_faster', False)
        self.impostor = self.standin = self.plotters[1].ibr.add_impostor(
            self.actors[1][:2], **settings
        )

    def move(self, **change):
        for pl in self.plotters:
            for name, value in change.items():
                setattr(pl.camera, name, value)

    def depths(self):
        found = [pl.get_image_depth(fill_value=np.nan) for pl in self.plotters]
        return [np.asarray(d) for d in found]


def cover(picture):
    """Return where anything is seen before a white background."""
    return (picture < 255).any(-1) * 1


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('offset', [0.0, 1e6])
def test_outlines_intersections_and_depth_are_those_of_the_meshes(parallel, offset):
    scene = Scene(parallel=parallel, offset=offset)
    for azimuth in (0.0, 0.4, 0.8, 3.0):
        scene.move(azimuth=azimuth)
        mesh, card = scene.pictures()
        told = scene.impostor.report()
        assert told['shown'] == 2
        assert told['error_px'] <= 1
        assert displaced(mesh, card, kinds) <= 1.5
        assert np.abs(mesh - card).mean() < 0.5
        depths = scene.depths()
        inside = distance_transform_edt(~edges(kinds(mesh))) > 2
        inside &= (kinds(mesh) > 0) & (kinds(mesh) == kinds(card))
        step = 2 * scene.actors[1][1].length / 255
        assert np.nanmax(np.abs(depths[0] - depths[1])[inside]) < step


def test_an_image_serves_until_its_error_is_too_large():
    scene = Scene()
    scene.pictures()
    before = scene.impostor.rendered
    scene.pictures()
    assert scene.impostor.rendered == before
    scene.move(azimuth=0.2)
    scene.pictures()
    assert scene.impostor.rendered == before
    assert 0 < scene.impostor.report()['error_px'] <= 1
    scene.move(azimuth=5)
    scene.pictures()
    assert scene.impostor.rendered == before + 2
    scene.move(azimuth=0)
    scene.pictures()  # the image from before is still there
    assert scene.impostor.rendered == before + 2


def test_a_larger_error_needs_fewer_images():
    drawn = []
    for max_error in (0.5, 4.0):
        scene = Scene(max_error=max_error)
        for azimuth in np.arange(0, 6, 0.5):
            scene.move(azimuth=azimuth)
            scene.pictures()
        drawn.append(scene.impostor.rendered)
        pv.close_all()
    assert drawn[1] < drawn[0] / 2


def test_actors_that_move_change_or_vanish_are_seen_to():
    scene = Scene()
    scene.pictures()
    for made in scene.actors:
        made[0].position = (0.5, -0.5, 0.5)
    scene.check(shift=1.5)
    for made in scene.actors:
        made[0].prop.color = 'green'
        made[1].mapper.dataset.points[:, 2] *= 0.5
        made[1].mapper.dataset.Modified()
    scene.check(mean=0.5)
    for made in scene.actors:
        made[0].visibility = False
    scene.check(shift=1.5)
    for made in scene.actors:
        made[0].visibility = True
    for pl, made in zip(scene.plotters, scene.actors, strict=True):
        pl.remove_actor(made[1])
    scene.check(shift=1.5)
    assert scene.impostor.report()['shown'] == 1
    for pl, made in zip(scene.plotters, scene.actors, strict=True):
        pl.remove_actor(made[0])
    scene.pictures()
    assert scene.plotters[1].ibr.effects == ()


def test_an_emptied_actor_is_no_image_and_leaves_none():
    mesh = BALL.copy()
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    actor = pl.add_mesh(mesh)
    other = pl.add_mesh(BALL.translate((1, 0, 0)))
    impostor = pl.ibr.add_impostor([actor, other], only_if_faster=False)
    pl.show(auto_close=False)
    assert impostor.report()['shown'] == 2
    actor.mapper.dataset.copy_from(pv.PolyData(np.zeros((1, 3))[:0]))
    pl.render()
    assert impostor.report()['shown'] == 1


both = pytest.mark.parametrize('kind', [Scene, layers.Scene], ids=['impostor', 'layers'])


@both
def test_to_all_others_the_actors_are_what_they_were(kind):
    scene = kind()
    scene.pictures()
    pl, made = scene.plotters[1], scene.actors[1]
    assert all(actor.visibility for actor in made)
    assert pl.bounds == pytest.approx(scene.plotters[0].bounds)
    picker = _vtk.vtkCellPicker()
    picker.Pick(*np.floor_divide(pl.window_size, 2), 0, pl.renderer)
    assert picker.GetActor() in (made[:2] if kind is Scene else made)
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)
    selector.SetArea(100, 50, 220, 150)
    found = selector.Select()
    nodes = [found.GetNode(k) for k in range(found.GetNumberOfNodes())]
    picked = [node.GetProperties().Get(_vtk.vtkSelectionNode.PROP()) for node in nodes]
    assert any(prop in made[:2] for prop in picked)
    off = np.abs(np.subtract(*scene.pictures()))
    assert off.mean() < (0.5 if kind is Scene else 0.05)


def test_what_cannot_be_an_image_is_drawn_as_it_is():
    looks = {
        'translucent': {'scalars': np.arange(BALL.n_points), 'opacity': 'linear'},
        'tubes or spheres': {'style': 'wireframe', 'render_lines_as_tubes': True},
        'a material of another kind': {'pbr': True},
    }
    for why, look in looks.items():
        pl = pv.Plotter(off_screen=True, window_size=(64, 64))
        impostor = pl.ibr.add_impostor(pl.add_mesh(BALL, **look))
        pl.show(auto_close=False)
        assert impostor.report()['meshes'] == {why: 1}
        pl.close()


def test_meshes_that_are_cheaper_than_images_stay_meshes():
    pl = pv.Plotter(off_screen=True, window_size=(320, 240))
    impostor = pl.ibr.add_impostor(pl.add_mesh(pv.Box()))
    pl.show(auto_close=False)
    pl.render()
    for k in range(4):
        pl.camera.azimuth = 10 * k
        pl.render()
    assert impostor.report()['meshes'] == {'cheaper as a mesh': 1}


def test_near_the_eye_there_is_no_image():
    scene = Scene()
    scene.move(position=(0.5, -1.6, 0.5), focal_point=(0.5, 0.3, 0.2))
    mesh, card = scene.pictures()
    assert scene.impostor.report()['meshes'].get('near')
    assert np.abs(mesh - card).mean() < 0.5


def test_a_budget_draws_the_worst_first_and_the_rest_later():
    pl = pv.Plotter(off_screen=True, window_size=(320, 240))
    actors = [pl.add_mesh(BALL.translate((k, 0, 0))) for k in range(6)]
    impostor = pl.ibr.add_impostor(actors, budget_ms=0.0, only_if_faster=False)
    pl.show(auto_close=False)
    counts = []
    for _ in range(8):
        pl.render()
        counts.append(impostor.rendered)
    assert np.diff(counts).max() == 1
    assert counts[-1] == 6
    assert impostor.report()['meshes'] == {}


def test_the_memory_is_kept_and_pictures_are_right_all_the_same():
    scene = Scene(memory=2**17, size=(640, 480))
    mesh, card = scene.pictures()
    assert scene.impostor.report()['bytes'] < 2**18
    assert displaced(mesh, card, kinds) <= 1.5
    scene.check(shift=1.5)


@pytest.mark.parametrize(('parallel', 'offset'), [(False, 0.0), (True, 0.0), (False, 1e6)])
def test_a_hierarchy_shares_images_within_the_same_error(parallel, offset):
    plotters, actors = [], []
    for _ in range(2):
        pl = pv.Plotter(off_screen=True, window_size=(320, 240))
        row = [
            pl.add_mesh(
                BALL.translate((1.5 * (k % 4), 1.5 * (k // 4), 0)), color=(0.9, 0.5, 0.1 * (k % 3))
            )
            for k in range(16)
        ]
        for actor in row:
            actor.position = (offset,) * 3
        places = np.array([(2.25, -30, 15), (2.25, 2.25, 0)]) + offset
        pl.camera_position = [*places, (0, 0, 1)]
        pl.camera.parallel_projection, pl.camera.parallel_scale = parallel, 8.0
        pl.show(auto_close=False)
        plotters.append(pl)
        actors.append(row)
    impostor = plotters[1].ibr.add_impostor(actors[1], hierarchical=True)
    for azimuth in (0.0, 0.3):
        found = []
        for pl in plotters:
            pl.camera.azimuth = azimuth
            found.append(shot(pl))
        assert displaced(*found, cover) <= 1.5
        if not azimuth:
            assert impostor.report()['shown'] < 8
    for row in actors:
        row[5].position = (offset, offset, offset + 0.5)
    found = []
    for pl in plotters:
        found.append(shot(pl))
    assert displaced(*found, cover) <= 1.5


def test_without_depth_cards_cut_straight():
    scene = Scene(depth=False)
    mesh, card = scene.pictures()
    assert (kinds(mesh) != kinds(card)).mean() > 0.002


@both
def test_it_goes_and_comes_again(kind):
    scene, most = kind(), 1 if kind is Scene else 0
    _, drawn = scene.pictures()
    scene.standin.remove()
    assert np.abs(np.subtract(*scene.pictures())).max() <= most
    scene.plotters[1].ibr.add(scene.standin)
    assert np.abs(scene.pictures()[1] - drawn).max() <= most
    scene.standin.enabled = False
    assert np.abs(np.subtract(*scene.pictures())).max() <= most


def test_bad_input_changes_nothing():
    pl = pv.Plotter(off_screen=True)
    actor = pl.add_mesh(BALL)
    stranger = pv.Actor(mapper=pv.DataSetMapper(BALL))
    for wrong in ([], [actor, actor], [stranger]):
        refused('actors', pl.ibr.add_impostor, wrong)
    for alien in ([3], None, BALL, pl.add_text('no actor')):
        refused('actors must be actors', pl.ibr.add_impostor, alien, kind=TypeError)
    refused('max_error', pl.ibr.add_impostor, actor, max_error=-1)
    pl.ibr.add_impostor(actor)
    refused('already replaces', pl.ibr.add_impostor, actor)
    assert len(pl.ibr.effects) == 1


def test_two_plotters_and_a_window_that_changes():
    first, second = Scene(), Scene()
    for scene in (first, second, first):
        scene.check(shift=1.5)
    for pl in first.plotters:
        pl.window_size = (200, 300)
    mesh, card = first.pictures()
    assert mesh.shape == card.shape
    assert displaced(mesh, card, kinds) <= 1.5
    large = [pl.screenshot(None, return_img=True, scale=2).astype(int) for pl in first.plotters]
    assert displaced(*large, kinds) <= 1.5


def test_effects_see_the_surface_that_images_show():
    scene = Scene()
    for pl in scene.plotters:
        pl.ibr.add(pvibr.Shadows())
        pl.ibr.add(pvibr.Outline())
    scene.check(mean=1.0)
    normals = [pl.ibr.buffer('normal') for pl in scene.plotters]
    assert np.abs(normals[0] - normals[1]).mean() < 0.01
    rendered = scene.impostor.rendered
    scene.pictures()
    assert scene.impostor.rendered == rendered  # what effects put on actors changes no image


@both
def test_other_cameras_see_the_meshes(kind):
    scene = kind()
    lives = []
    for pl in scene.plotters:
        lives.append(pl.ibr.add(pvibr.LiveTexture(pl.camera.copy(), size=(64, 48))))
        lives[-1].camera.position = (6, -6, 6)
    scene.pictures()
    assert np.array_equal(lives[0].image(), lives[1].image())
    before = scene.standin.report().get('taken')
    scene.pictures()
    assert [live.draws for live in lives] == [1, 1]
    assert scene.standin.report().get('taken') == before


def test_materials_of_all_kinds_share_a_draw():
    pictures = []
    for images in (False, True):
        pl = pv.Plotter(off_screen=True, window_size=(320, 240))
        ball = BALL.copy()
        ball['height'] = ball.points[:, 2]
        looks = (
            {'scalars': 'height', 'show_scalar_bar': False},
            {'color': 'red', 'lighting': False},
            {'color': 'white', 'specular': 0.8, 'specular_power': 30, 'smooth_shading': True},
            {'color': 'blue', 'ambient': 0.5, 'diffuse': 0.3},
        )
        actors = [
            pl.add_mesh(ball.translate((1.2 * k, 0, 0)), **look) for k, look in enumerate(looks)
        ]
        textured = pv.Sphere(theta_resolution=60, phi_resolution=60, center=(2, 0, 1.3))
        textured.texture_map_to_plane(inplace=True)
        texture = pv.Texture(np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8))
        actors.append(pl.add_mesh(textured, texture=texture))
        pl.camera_position = [(1.8, -9, 1), (1.8, 0, 0.4), (0, 0, 1)]
        if images:
            impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
        pictures.append(shown(pl))
    assert impostor.report()['meshes'] == {}
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.5
    inside = distance_transform_edt(cover(pictures[0])) > 3
    assert np.abs(pictures[0] - pictures[1])[inside].mean() < 2.0
