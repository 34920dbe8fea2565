"""Near members of a crowd that share draws look as with actors of their own."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Pose, Skeleton, Track
from pvibr.maths.transforms import trs
from tests.calls import calls_of
from tests.figures.makers import bending, growing, worm
from tests.pictures import off, place, plotter, shot

COUNT = 9


def machine():
    """A figure of rigid meshes, of which one mirrors."""
    joints = np.tile(np.eye(4), (3, 1, 1))
    joints[1, 0, 3], joints[2, 2, 3] = 1.5, 1.0
    joints[2, 0, 0] = -1.0
    turn = Track(1, 'rotation', [0, 1, 2], [[0, 0, 0, 1], [0, 0, 0.6, 0.8], [0, 0, 0, 1]])
    meshes = [
        FigureMesh(pv.Cone(direction=(0, 0, 1)), node=0),
        FigureMesh(pv.Cube(x_length=0.4), node=1),
        FigureMesh(pv.Sphere(radius=0.4).translate((0.5, 0, 0)), node=2),
    ]
    return Figure(meshes, Skeleton([-1, 0, 0], joints), [Clip('turn', [turn])])


def mirrored_worm():
    """A figure whose joints mirror it."""
    figure = worm()
    rest = figure.skeleton.rest
    scale = rest.scale * np.array([-1.0, 1.0, 1.0])
    bones = Skeleton(figure.skeleton.parents, Pose(rest.translation, rest.rotation, scale))
    return Figure(figure.meshes, bones, [bending()])


def morphed_worm():
    """A figure whose morph targets and joints move."""
    weights = Track(0, 'weights', [0, 1, 2], [[0, 0, 0], [1, 0.5, -0.5], [0, 0, 0]])
    clip = bending()
    return worm(n_morphs=3, clips=[Clip('bend', [*clip.tracks, weights])])


FIGURES = {
    'skinned': (lambda: worm(clips=[bending()]), {}),
    'smooth': (lambda: worm(clips=[bending()]), {'smooth_shading': True}),
    'dual': (lambda: worm(clips=[bending()]), {'skinning': 'dual', 'smooth_shading': True}),
    'morphed': (morphed_worm, {'smooth_shading': True}),
    'culled': (lambda: worm(clips=[bending()]), {'smooth_shading': True, 'culling': 'back'}),
    'key frames': (growing, {'smooth_shading': True}),
    'rigid': (machine, {'color': 'tan'}),
    'mirrored': (mirrored_worm, {'smooth_shading': True}),
}


def crowd_of(name, samples=0, *, together=True, **look):
    """Return a plotter with a crowd of meshes, and the crowd."""
    figure, options = FIGURES[name][0](), FIGURES[name][1] | look
    rng = np.random.default_rng(5)
    turns = rng.normal(size=(COUNT, 4))
    scales = rng.uniform(0.5, 1.2, (COUNT, 3))
    scales[::4, 1] *= -1
    at = rng.uniform(-6, 6, (COUNT, 3))
    poses = trs(at, turns / np.linalg.norm(turns, axis=1)[:, None], scales)
    pl = plotter((200, 150))
    pl.render_window.SetMultiSamples(samples)
    colors = rng.integers(0, 255, (COUNT, 3), dtype=np.uint8)
    # Images, which no test here looks at, are soon baked where errors may be large.
    options = {'max_error': 30.0, 'show_scalar_bar': False, **options}
    crowd = pl.ibr.add_animated(figure, poses, colors=colors, **options)
    crowd.times = rng.uniform(0, 2, COUNT)
    crowd.force_level = 'mesh'
    place(pl, (18, -22, 12))
    pl.show(auto_close=False)
    (near,) = (group.near for group in crowd.groups)
    assert together is None or set(near.has_own_actors) == {not together}
    return pl, crowd


def frames_of(pl, crowd):
    """Return pictures as time and camera move, members come and go, and of another window."""
    pictures = [shot(pl)]
    for step in range(3):
        pl.ibr.time += 0.37
        pl.camera.Azimuth(25.0 * (step != 1))
        pictures.append(shot(pl))
    crowd.visible = np.arange(COUNT) % 3 != 0
    pictures.append(shot(pl))
    crowd.visible = np.ones(COUNT, bool)
    pl.camera.Zoom(2.5)  # some leave the view
    pictures.append(shot(pl))
    return np.array(pictures)


@pytest.mark.parametrize('name', FIGURES)
def test_as_actors_of_their_own(name, monkeypatch):
    pictures = frames_of(*crowd_of(name))
    monkeypatch.setattr('pvibr.figures.crowd_group.can_share_draws', lambda *_: False)
    expected = frames_of(*crowd_of(name, together=False))
    assert (expected != expected[0, 0, 0]).any(-1).mean() > 0.01
    differences = np.array([off(*pair) for pair in zip(pictures, expected, strict=True)])
    # Edges of triangles fall the other way by rounding.
    assert (differences > 8).mean() < 1e-3


@pytest.mark.parametrize('name', FIGURES)
def test_as_the_posed_mesh(name):
    """The figure posed in numpy, as an ordinary mesh."""
    pl, crowd = crowd_of(name)
    pl.ibr.time = 0.81
    picture = shot(pl)
    other = plotter((200, 150))
    meshes = [crowd.mesh(i) for i in range(COUNT)]
    for i, mesh in enumerate(meshes):
        for block in mesh if isinstance(mesh, pv.MultiBlock) else [mesh]:
            other.add_mesh(
                block,
                color=crowd.colors[i, :3] / 255,
                smooth_shading=FIGURES[name][1].get('smooth_shading', False),
            )
    other.camera = pl.camera.copy()
    other.renderer.ResetCameraClippingRange()
    expected = shot(other)
    shown = (expected != expected[0, 0]).any(-1)
    assert ((picture != picture[0, 0]).any(-1) != shown).mean() < 2e-3


def test_what_needs_actors_of_its_own_has_them():
    for look in ({'show_edges': True}, {'style': 'wireframe'}):
        crowd_of('skinned', together=False, **look)
    crowd_of('mirrored', together=False, culling='back')


def test_mirrored_members_have_actors_where_faces_are_culled():
    _, crowd = crowd_of('culled')
    (near,) = (group.near for group in crowd.groups)
    assert len(near.pools[0].lent) == len(range(0, COUNT, 4))


def test_calls_do_not_grow_with_members():
    """A draw of the worm has four of its members."""
    pl, crowd = crowd_of('rigid')
    pl.render()

    def move():
        pl.ibr.time += 0.1
        pl.render()

    assert len(calls_of(move)) < 1500
    assert len(crowd.groups[0].near.actors()) == 3


def test_nothing_is_posed_while_time_stands_still():
    pl, _crowd = crowd_of('skinned')
    pl.render()

    def turn():
        pl.camera.Azimuth(1.0)
        pl.render()

    turn()
    assert not {'moments', 'draw_together'} & set(calls_of(turn))
    pl.ibr.time += 0.1
    assert {'moments', 'draw_together'} <= set(calls_of(turn))


@pytest.mark.parametrize('samples', [0, 8])
def test_shadows_of_members(samples, monkeypatch):
    pictures = []
    for together in (True, False):
        if not together:
            monkeypatch.setattr('pvibr.figures.crowd_group.can_share_draws', lambda *_: False)
        pl, _crowd = crowd_of('skinned', samples, together=together)
        pl.add_mesh(pv.Plane(center=(0, 0, -7), i_size=30, j_size=30), color='white')
        pl.ibr.add(pvibr.Shadows())
        pl.ibr.time = 0.5
        pictures.append(shot(pl))
    assert (off(*pictures) > 12).mean() < 2e-3


def test_released_and_added_again():
    pl, crowd = crowd_of('skinned')
    before = shot(pl)
    pl.ibr.remove(crowd)
    assert crowd.report()['bytes'] == 0
    shot(pl)
    pl.ibr.add(crowd)
    assert off(shot(pl), before).max() <= 1


@pytest.mark.parametrize('name', ['skinned', 'morphed', 'key frames'])
@pytest.mark.parametrize('most', [1, 6])
def test_members_share_poses_where_there_is_no_room(name, most, monkeypatch):
    """All members are drawn, in the right pose or, those farther away, in one close to it."""
    pl, crowd = crowd_of(name)
    exact = shot(pl)
    assert 'poses' not in crowd.report()
    pl.close()
    monkeypatch.setattr('pvibr.figures.member_poses.most_poses', lambda *_: most)
    pl, crowd = crowd_of(name)
    drawn = shot(pl)
    assert f'there is room for {most} poses' in crowd.report()['poses']
    background = exact[0, 0].astype(int)
    covered, covered_exactly = ((np.abs(p - background).max(-1) > 9) for p in (drawn, exact))
    assert 0.7 < covered.sum() / covered_exactly.sum() < 1.4
    if most > 1:
        assert (covered & covered_exactly).sum() > 0.7 * covered_exactly.sum()
    pl.close()


def test_a_small_texture_limit_leaves_no_crowd_out(monkeypatch):
    """The limit of the driver decides how many poses there are; nothing vanishes, or warns."""
    for module in ('posing', 'pose_sheet'):
        monkeypatch.setattr(f'pvibr.figures.{module}.texture_limit', lambda _window: 16)
    pl, crowd = crowd_of('skinned')
    drawn = shot(pl)
    assert 'there is room for' in crowd.report()['poses']
    assert (np.abs(drawn - drawn[0, 0].astype(int)).max(-1) > 9).mean() > 0.02
    pl.close()
