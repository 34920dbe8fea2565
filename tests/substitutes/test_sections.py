"""Clipping planes of actors cut what impostors show as they cut the actors."""

import numpy as np
import pytest
import pyvista as pv

from tests.makers import plane
from tests.pictures import off, place, plotter, shot, uncut

TORUS = pv.ParametricTorus(u_res=60, v_res=30, ringradius=0.6, crosssectionradius=0.25)
FAR = (-100.0, 0, 0)
SIDE = 5  # tori along each side


def tori(pl, planes, meshes=(TORUS,)):
    """Return actors on a square grid, clipped by planes."""
    actors = []
    for i, j in np.ndindex(SIDE, SIDE):
        actor = pl.add_mesh(
            meshes[len(actors) % len(meshes)],
            color=('gold', 'tomato', 'teal')[(i + j) % 3],
            smooth_shading=True,
            reset_camera=False,
        )
        actor.position, actor.orientation = (2 * i - 4, 2 * j - 4, 0), (40 * i, 25 * j, 0)
        for clip_plane in planes:
            actor.mapper.AddClippingPlane(clip_plane)
        actors.append(actor)
    return actors


class Twins:
    """The same actors twice, clipped by the same planes: as they are, and as images."""

    def __init__(self, count=1, parallel=False, add=tori, **settings):
        self.planes = [plane(FAR, (1, 0, 0)) for _ in range(count)]
        self.plotters = [plotter((320, 240)) for _ in range(2)]
        self.actors = [add(pl, self.planes) for pl in self.plotters]
        for pl in self.plotters:
            place(pl, (3, -16, 14), parallel=5.5 if parallel else None)
        settings.setdefault('only_if_faster', False)
        self.impostor = self.plotters[1].ibr.add_impostor(self.actors[1], **settings)
        for pl in self.plotters:
            pl.show(auto_close=False)
        self.render()

    def move(self, origin, normal=(1, 0, 0), k=0):
        self.planes[k].SetOrigin(*origin)
        self.planes[k].SetNormal(*normal)

    def render(self):
        """Render a frame of the impostor, and return how many images that took."""
        before = self.impostor.rendered
        self.plotters[1].render()
        return self.impostor.rendered - before

    def check(self, share=0.012):
        """Compare both in a frame where planes may move, and in those at rest."""
        plain = uncut(self.plotters[0])
        for _ in range(3):
            drawn = uncut(self.plotters[1])
            covers = [(picture < 255).any(-1) for picture in (plain, drawn)]
            assert (covers[0] != covers[1]).mean() < share
            assert (off(plain, drawn) > 60).mean() < 2 * share

    def meshes(self):
        return self.impostor.report()['meshes']


def test_a_plane_that_cuts_nothing_renders_nothing():
    scene = Twins()
    before = shot(scene.plotters[1])
    for x in np.linspace(-90, -6, 12):
        scene.move((x, 0, 0))
        assert scene.render() == 0
    assert scene.meshes() == {}
    np.testing.assert_array_equal(shot(scene.plotters[1]), before)


def test_what_a_plane_removes_is_not_drawn_and_needs_no_image():
    scene = Twins()
    scene.move((1, 0, 0))
    assert scene.render() == 0
    assert scene.meshes() == {'clipped away': 3 * SIDE}
    scene.check()
    scene.move((50, 0, 0))
    assert scene.render() == 0
    assert scene.meshes() == {'clipped away': SIDE**2}
    assert (shot(scene.plotters[1]) == 255).all()
    scene.move(FAR)
    assert scene.render() == 0
    assert scene.impostor.report()['shown'] == SIDE**2


def test_what_a_plane_cuts_is_a_mesh_while_it_moves_and_an_image_at_rest():
    scene = Twins()
    for x in (0.0, 0.1, 0.2):
        scene.move((x, 0, 0))
        assert scene.render() == 0
        assert scene.meshes() == {'clipped away': 2 * SIDE, 'cut by a moving plane': SIDE}
    assert scene.render() == SIDE
    assert scene.meshes() == {'clipped away': 2 * SIDE}
    assert scene.render() == 0
    scene.check()
    scene.move((-1, 0, 0))
    assert scene.render() == 0
    assert scene.meshes() == {'clipped away': 2 * SIDE}


def test_a_plane_through_a_face_of_the_box_keeps_or_cuts():
    scene = Twins(add=cubes)
    scene.move((-0.5, 0, 0))
    assert scene.render() == 0
    assert scene.meshes() == {}
    scene.move((np.nextafter(-0.5, 0), 0, 0))
    scene.render()
    assert scene.meshes() == {'cut by a moving plane': 1}
    scene.move((0.5, 0, 0))
    scene.render()
    assert scene.meshes() == {'cut by a moving plane': 1}
    scene.move((np.nextafter(0.5, 1), 0, 0))
    scene.render()
    assert scene.meshes() == {'clipped away': 1}


def cubes(pl, planes):
    actor = pl.add_mesh(pv.Cube(), color='tan', reset_camera=False)
    for clip_plane in planes:
        actor.mapper.AddClippingPlane(clip_plane)
    return [actor]


@pytest.mark.parametrize('settings', [{}, {'hierarchical': True}, {'views': 1}])
@pytest.mark.parametrize('parallel', [False, True])
def test_a_plane_that_sweeps_through_all_and_back(settings, parallel):
    scene = Twins(parallel=parallel, **settings)
    for x in (-5.2, -4.1, -1.3, 0.4, 3.9, 6, 2.2, -2, -3.8, -9):
        scene.move((x, 0, 0.3), (1, 0.2, -0.3))
        scene.check()
    assert scene.meshes() == {}


def test_several_planes():
    scene = Twins(3)
    scene.move((0.2, 0, 0), (1, 0.1, 0), 0)
    scene.move((0, 2.2, 0), (0, -1, 0.2), 1)
    scene.check()
    scene.move((0, 0, 0.1), (0, 0, -1), 2)
    scene.check()
    for clip_plane in (1, 0, 2):
        scene.move(FAR, k=clip_plane)
        scene.check()


def test_moved_actors():
    scene = Twins()
    scene.move((0.2, 0, 0))
    scene.check()
    for actors in scene.actors:
        for actor in actors[::3]:
            actor.position = np.add(actor.position, (1.2, 0.3, 0))
            actor.scale = 0.8
            actor.RotateZ(70)
    scene.check()


def test_planes_added_and_removed():
    scene = Twins(0)
    cut = plane((0.3, 0, 0), (1, 0, 0))
    steps = (
        lambda mapper: mapper.AddClippingPlane(cut),
        lambda mapper: mapper.AddClippingPlane(plane((0, 0.4, 0), (0, -1, 0))),
        lambda mapper: mapper.RemoveClippingPlane(cut),
        lambda mapper: mapper.RemoveAllClippingPlanes(),
        lambda mapper: mapper.AddClippingPlane(plane((0.3, 0, 0), (1, 0, 0))),
    )
    for step in steps:
        for actors in scene.actors:
            for actor in actors:
                step(actor.mapper)
        scene.check()


def test_actors_added_grown_and_removed_while_cut():
    scene = Twins()
    scene.move((0.1, 0, 0))
    scene.check()
    later = [tori(pl, scene.planes)[:3] for pl in scene.plotters]
    for actors in later:
        for k, actor in enumerate(actors):
            actor.position = (0.2, 2 * k - 2, 1.2)
    scene.impostor.add(later[1])
    scene.check()
    for pl, actors in zip(scene.plotters, scene.actors, strict=True):
        for actor in actors[::2]:
            pl.remove_actor(actor)
    scene.check()


def test_changes_of_settings_while_cut():
    scene = Twins()
    scene.move((0.1, 0, 0))
    scene.check()
    for settings in ({'views': 3}, {'hierarchical': True}, {'hierarchical': False}):
        for name, value in settings.items():
            setattr(scene.impostor, name, value)
        scene.check()
        scene.move((0.3, 0, 0))
        scene.check()
        scene.move(FAR)
        scene.check()
        scene.move((0.1, 0, 0))
        scene.check()


def test_a_camera_that_moves_with_the_plane():
    scene = Twins()
    for k in range(6):
        for pl in scene.plotters:
            pl.camera.azimuth = 7 * k
        scene.move((k - 2.5, 0, 0))
        scene.check()


def test_subplots():
    pictures = []
    for with_images in (False, True):
        pl = plotter((400, 160), shape=(1, 2))
        planes = [plane(FAR, (1, 0, 0)) for _ in range(2)]
        for column, clip_plane in enumerate(planes):
            pl.subplot(0, column)
            actors = tori(pl, [clip_plane])
            place(pl, (3, -16, 14))
            if with_images:
                pl.ibr.add_impostor(actors, only_if_faster=False)
        pl.show(auto_close=False)
        planes[1].SetOrigin(0.2, 0, 0)
        moving = shot(pl)
        planes[0].SetOrigin(-1.9, 0, 0)
        pl.render()
        pictures.append((moving, shot(pl)))
    for plain, drawn in zip(*pictures, strict=True):
        assert (off(plain, drawn) > 60).mean() < 0.02


def test_others_see_the_actors_themselves():
    scene = Twins()
    mappers = [actor.mapper for actor in scene.actors[1]]
    for x in (0.0, 0.2):
        scene.move((x, 0, 0))
        scene.render()
        assert scene.meshes()['cut by a moving plane'] == SIDE
        assert [actor.mapper for actor in scene.actors[1]] == mappers
        assert all(actor.visibility for actor in scene.actors[1])
        assert scene.impostor.solids() == scene.actors[1]


def test_looks_that_drafts_follow():
    ball = pv.Sphere(theta_resolution=90, phi_resolution=90)
    ball['height'] = ball.points[:, 2]
    ball['cell'] = np.arange(ball.n_cells) % 7
    texture = pv.Texture(np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8))
    looks = (
        {'scalars': 'height', 'show_scalar_bar': False},
        {'scalars': 'cell', 'cmap': 'viridis', 'show_scalar_bar': False},
        {'color': 'red', 'lighting': False},
        {'texture': texture},
    )

    def add(pl, planes):
        actors = []
        for k, look in enumerate(looks):
            mesh = ball.texture_map_to_sphere() if 'texture' in look else ball.copy()
            actors.append(pl.add_mesh(mesh, reset_camera=False, **look))
            actors[-1].position, actors[-1].scale = (2.6 * k - 4, 0, 0), 2
            for clip_plane in planes:
                actors[-1].mapper.AddClippingPlane(clip_plane)
        return actors

    scene = Twins(add=add)
    for y in (0.0, 0.1):
        scene.move((0, y, 0), (0, 1, 0))
        plain, drawn = (uncut(pl) for pl in scene.plotters)
        assert scene.meshes() == {'cut by a moving plane': len(looks)}
        assert (off(plain, drawn) > 60).mean() < 0.03
    scene.check()
