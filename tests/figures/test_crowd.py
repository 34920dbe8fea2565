"""Crowds beside posed meshes, by their pixels."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from pvibr import Crowd, Figure, Shadows
from pvibr.animation import Clip, FigureMesh, Skeleton, Track
from pvibr.figures import pose_atlas
from pvibr.figures.crowd_group import Playback
from pvibr.figures.pose_atlas import PoseAtlas, pose_counts
from pvibr.instances import measure
from tests.animation.conftest import refused
from tests.figures.makers import bending, growing, worm
from tests.pictures import grab, place

CAMERA = {'eye': (110, 0, 0), 'focus': (0, 0, 0), 'angle': 20.0}
NEAR = {'eye': (12, 0, 0), 'focus': (0, 0, 0), 'angle': 40.0}
SIZE = (160, 120)


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(pose_atlas, 'VIEWS', 6)
    monkeypatch.setattr(pose_atlas, 'TILES', (32,))
    # Few views of a thin worm err more than many.
    monkeypatch.setattr(measure, 'LAYOUTS', (measure.Layout(8, (8, 16, 32)),))


@pytest.fixture(scope='module')
def figure():
    still = Clip('still', [], duration=1.0)
    return worm(clips=[bending(), still])


@pytest.fixture
def show(atlases):
    opened = []

    def make(figure, poses, camera=CAMERA, **kwargs):
        pl = pv.Plotter(off_screen=True, window_size=SIZE)
        pl.disable_anti_aliasing()
        opened.append(pl)
        kwargs = {'cache': atlases, 'show_scalar_bar': False, 'smooth_shading': True} | kwargs
        crowd = pl.ibr.add_animated(figure, poses, **kwargs)
        return place(pl, **camera), crowd

    yield make
    for pl in opened:
        pl.close()


def apart(n=2):
    out = np.zeros((n, 3))
    out[:, 1] = 5.0 * (np.arange(n) - (n - 1) / 2)
    return out


def posed(figure, poses, times, camera=CAMERA, clip=None, **looks):
    """A picture of meshes that were posed on the CPU."""
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    pl.disable_anti_aliasing()
    for pose, time in zip(poses, times, strict=True):
        looks = {'show_scalar_bar': False, 'smooth_shading': True} | looks
        pl.add_mesh(figure.mesh(time, clip), **looks).position = pose
    picture = grab(place(pl, **camera))
    pl.close()
    return picture


def drawn(crowd):
    return {k: v for k, v in crowd.report().items() if k.split()[0] in DRAWN and v}


DRAWN = ('splat', 'flat', 'parallax', 'blended', 'mesh')


def bent_to(points):
    away = points[:, 1] - 2.5
    return away[np.abs(away).argmax()]


def silhouette(picture):
    return 1 - picture.min(-1)


def test_near_ones_are_the_posed_meshes(figure, show):
    times = [0.3, 1.1]
    pl, crowd = show(figure, apart(), NEAR, times=times, color='tan')
    crowd.force_level = 'mesh'
    picture = grab(pl)
    assert list(drawn(crowd)) == [f'mesh {figure.meshes[0].mesh.n_cells}']
    truth = posed(figure, apart(), times, NEAR, color='tan')
    assert np.abs(picture - truth).max(-1).mean() < 2e-3
    assert (np.abs(picture - truth).max(-1) > 0.02).mean() < 0.005


def test_near_ones_that_change_one_by_one(figure, show):
    """Only who changed is posed again; who was moved or shown again is at the right place."""
    poses, times = apart(3), np.array([0.3, 1.1, 0.8])
    pl, crowd = show(figure, poses, NEAR, times=times, color='tan')
    grab(pl)

    def off(seen=slice(None)):
        truth = posed(figure, poses[seen], times[seen], NEAR, color='tan')
        return np.abs(grab(pl) - truth).max(-1).mean()

    crowd.times = times = np.array([0.3, 0.2, 0.8])
    assert off() < 2e-3
    crowd.poses = poses = np.add(apart(3), (0, 0.4, 0.7))
    assert off() < 2e-3
    crowd.visible = [False, True, False]
    assert off([1]) < 2e-3
    crowd.poses = poses = np.subtract(apart(3), (0, 0.3, 0.5))
    assert off([1]) < 2e-3
    crowd.visible = True
    assert off() < 2e-3


def test_far_ones_show_their_pose(figure, show):
    times = np.array([0.0, 1.0])
    pl, crowd = show(figure, apart(), times=times, color='tan', max_error=2.0)
    for now in (0.0, 0.4, 3.0):
        pl.ibr.time = now
        picture = grab(pl)
        assert not any(k.startswith('mesh') for k in drawn(crowd))
        truth = posed(figure, apart(), times + now, color='tan')
        wrong = posed(figure, apart(), times + now + 1.0, color='tan')
        error, other = (np.abs(picture - p).mean() for p in (truth, wrong))
        assert error < 0.4 * other


def test_nothing_is_uploaded_when_time_goes(figure, show, monkeypatch):
    pl, _ = show(figure, apart(), max_error=4.0)
    grab(pl)
    monkeypatch.setattr('pvibr.gl.Texture.upload', lambda *_: pytest.fail('an upload'))
    pl.ibr.time = 0.7
    grab(pl)


def test_a_time_has_one_picture(figure, show):
    pl, _ = show(figure, apart(), max_error=2.0)
    first = grab(pl)
    pl.ibr.time = 1000.3
    grab(pl)
    pl.ibr.time = 0.0
    assert np.array_equal(grab(pl), first)
    pl.ibr.time = 2000.0  # whole rounds later
    assert np.abs(grab(pl) - first).max() < 0.01


@pytest.mark.slow
def test_each_plays_its_own_clip(figure, show):
    pl, crowd = show(figure, apart(), clips=['bend', 'still'], max_error=2.0, color='tan')
    pl.ibr.time = 1.0
    both = grab(pl)
    half = SIZE[0] // 2
    bent, straight = both[:, half:], both[:, :half]
    truth = posed(figure, apart(), [1.0, 1.0], color='tan')[:, half:]
    flat = posed(figure, apart(), [0.0, 0.0], color='tan')[:, :half]
    if np.abs(bent - truth).mean() > np.abs(straight - truth).mean():
        pytest.fail('sides are swapped')
    assert np.abs(bent - truth).mean() < 0.02
    assert np.abs(straight - flat).mean() < 0.02
    crowd.play('bend', [1])
    assert [c.name for c in crowd.clips] == ['bend', 'bend']
    assert crowd.times.tolist() == [0.0, -1.0]


def interrupted(*_args, **_kwargs):
    raise KeyboardInterrupt


@pytest.mark.slow
def test_a_clip_that_is_new_is_baked_when_it_is_played(figure, show, monkeypatch):
    pl, crowd = show(figure, apart(), clips='still', max_error=2.0)
    grab(pl)
    before = crowd.atlases[0].n_poses
    with monkeypatch.context() as patch:
        patch.setattr('pvibr.figures.crowd_group.bake_pose_atlas', interrupted)
        with pytest.raises(KeyboardInterrupt):
            crowd.play('bend', [0], speed=2.0)
    assert [clip.name for clip in crowd.clips] == ['still', 'still']
    assert crowd.speeds.tolist() == [1.0, 1.0]
    crowd.play('bend', [0], start=-1.0)
    assert crowd.atlases[0].n_poses > before
    assert np.abs(crowd.mesh(0).bounds[2:4]).max() > np.abs(crowd.mesh(1).bounds[2:4]).min()
    assert silhouette(grab(pl)).sum() > 0


@pytest.mark.slow
def test_ends_without_a_loop(figure, show):
    pl, crowd = show(figure, apart(1), loop=False, speeds=-1.0, times=1.5)
    pl.ibr.time = 100.0
    assert np.allclose(crowd.mesh(0).points, figure.mesh(0.0).points, atol=1e-5)


def test_colours_and_visibility(figure, show):
    pl, crowd = show(figure, apart(), colors=[[255, 0, 0], [0, 0, 255]], max_error=2.0)
    picture = grab(pl)
    tints = picture[silhouette(picture) > 0.5]
    assert (tints[:, 0] > tints[:, 2] + 0.3).any()
    assert (tints[:, 2] > tints[:, 0] + 0.3).any()
    crowd.visible = np.array([True, False])
    picture = grab(pl)
    tints = picture[silhouette(picture) > 0.5]
    assert not (tints[:, 2] > tints[:, 0] + 0.3).any()
    crowd.scalars = [1.0, 2.0]
    assert crowd.scalar_mapper() is not None


def test_picks_the_pose(figure, show):
    pl, crowd = show(figure, apart(), NEAR, times=[0.0, 1.0])
    grab(pl)
    points = crowd.mesh(1).points
    tip = points[np.abs(points[:, 1] - 2.5).argmax()] - [0, 0.1 * np.sign(bent_to(points)), 0]
    ren = pl.renderer
    ren.SetWorldPoint(*tip, 1.0)
    ren.WorldToDisplay()
    x, y, _ = ren.GetDisplayPoint()
    hit = pl.ibr.pick(x, y)
    assert hit is not None
    assert hit.index == 1
    found = crowd.mesh(1).find_closest_point(hit.point)
    assert np.linalg.norm(crowd.mesh(1).points[found] - hit.point) < 0.2
    pl.ibr.time = 1.0  # the second one is straight again
    hit = pl.ibr.pick(x, y)
    assert hit is None or hit.index != 1


def test_bounds_hold_every_pose(figure, show):
    pl, crowd = show(figure, apart())
    low, high = np.reshape(crowd.bounds, (3, 2)).T
    for now in np.linspace(0, 2, 9):
        pl.ibr.time = now
        for i in range(2):
            points = crowd.mesh(i).points
            assert (points >= low - 1e-6).all()
            assert (points <= high + 1e-6).all()
    assert np.allclose(pl.bounds, crowd.bounds)


def test_shadows_move(figure, show):
    pl, _ = show(figure, apart(1), {**NEAR, 'eye': (8, 0, 14)}, color='tan')
    pl.add_mesh(pv.Plane(center=(0, 0, -3), i_size=14, j_size=14), color='white')
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(0, -8, 9), light_type='scene light'))
    pl.ibr.add(Shadows())
    first = grab(pl)
    pl.ibr.time = 1.0
    assert np.abs(grab(pl) - first).mean() > 0.005


@pytest.mark.parametrize('make', [growing, lambda: Figure([FigureMesh(pv.Cube())])])
def test_other_figures(make, show):
    pl, crowd = show(make(), apart(), NEAR, times=[0.0, 2.5], clips=None)
    pl.ibr.time = 0.5
    assert silhouette(grab(pl)).sum() > 50
    place(pl, (90, 0, 0), angle=20.0)
    assert silhouette(grab(pl)).sum() > 5
    assert crowd.n_instances == 2


def test_morphs_and_dual_quaternions(show):
    morphed = worm(n_morphs=3)
    pl, crowd = show(morphed, apart(), NEAR, skinning='dual')
    truth = posed(morphed, apart(), [0.0, 0.0], NEAR)
    assert np.abs(grab(pl) - truth).mean() < 0.01
    assert crowd.mesh(0).n_points == morphed.meshes[0].mesh.n_points


@pytest.mark.slow
def test_life(figure, show):
    pl, crowd = show(figure, apart(), NEAR, name='worms')
    first = grab(pl)
    crowd.remove()
    assert silhouette(grab(pl)).max() == 0
    pl.ibr.add(crowd)
    assert np.array_equal(grab(pl), first)
    again = pl.ibr.add_animated(figure, apart(), name='worms', cache=False)
    assert pl.ibr.effects == (again,)
    crowd = again
    crowd.poses = apart() + np.array([0, 0, 1])
    assert not np.array_equal(grab(pl), first)


def test_nobody_is_a_crowd(figure, show):
    pl, crowd = show(figure, np.zeros((0, 3)))
    assert silhouette(grab(pl)).max() == 0
    assert len(crowd) == 0


def test_an_atlas_goes_into_a_file(figure, show, tmp_path):
    _, crowd = show(figure, apart())
    (atlas,) = crowd.atlases
    atlas.save(tmp_path / 'worms.npz')
    loaded = PoseAtlas.load(tmp_path / 'worms.npz')
    assert np.array_equal(loaded.geometry, atlas.geometry)
    assert np.array_equal(loaded.bins, atlas.bins)
    assert atlas.contact_sheet().shape == (2 * 192, 192, 3)
    arrays = atlas.to_arrays()
    for broken in ({'bins': arrays['bins'] + 1e6}, {'geometry': arrays['geometry'][:0]}):
        refused('not a pose atlas', PoseAtlas.from_arrays, arrays | broken)


def test_what_is_wrong_is_said(figure):
    for wrong, words in (
        ({'times': [1.0]}, r'times must be .* got float64 of shape \(1,\)'),
        ({'speeds': np.nan}, 'speeds must be finite'),
        ({'clips': 'fly'}, "got 'fly'"),
        ({'clips': ['bend']}, 'clips must be one clip or ., got 1'),
        ({'loop': 1.0}, 'loop must be bool'),
        ({'skinning': 'cubic'}, 'skinning must'),
        ({'colors': [[1, 2, 3]]}, 'colors must be of shape'),
    ):
        refused(words, Crowd, figure, apart(), cache=False, **wrong)


def test_faster_clips_get_more_poses():
    tile, counts = pose_counts([0.0, 1.0, 2.0], 1.0, 1.0)
    assert tile == 32
    assert counts == [1, 8, 16]
    _, many = pose_counts([1e3], 1.0, 1.0)
    assert many[0] < 1e3


def test_rounds():
    moves = Playback(3)
    moves.offset[:] = 0.5, 0.5, 5.0
    moves.loop[2] = False
    motions = [SimpleNamespace(duration=2.0)]
    assert moves.rounds(motions, 2.0).tolist() == [0.25, 0.25, 1.0]
    rows = moves.rows(motions, 1e6 + 0.5)
    assert rows[:, 0].tolist()[:2] == [0.5, 0.5]


@pytest.mark.parametrize('cached', [False, True])
def test_baking_leaves_rigid_bodies_as_they_are(show, tmp_path, cached):
    """Meshes without normals that go with a node: seen where they are as data, baked or read."""
    joint = np.eye(4)[None]
    rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2]])])
    cone = pv.Cone(center=(0, 1, 0), direction=(0, 0, 1))
    figure = Figure([FigureMesh(cone, node=0)], Skeleton([-1], joint), [rise])
    for _ in range(1 + cached):
        # With edges, each has an actor of its own.
        how = {'cache': tmp_path, 'max_error': 4.0, 'show_edges': True}
        pl, crowd = show(figure, apart(1), NEAR, **how)
        pl.ibr.time = 0.5
        grab(pl)
        (actor,) = (a for group in crowd.groups for a in group.mesh_actors())
        np.testing.assert_allclose(actor.GetBounds(), crowd.mesh(0).bounds, atol=1e-5)
        np.testing.assert_allclose(np.mean(actor.GetBounds()[4:]), 1.0, atol=1e-5)


def test_a_member_is_explained(show, figure):
    pl, crowd = show(figure, apart())
    grab(pl)
    (group,) = crowd.groups
    levels = {crowd.explain(i).level for i in range(2)}
    cards = {name for name in levels if not name.startswith('mesh')}
    assert cards
    assert all(group.counts[name] for name in cards)
    place(pl, **NEAR)
    grab(pl)
    mesh_levels = group.near.level_of[np.argsort(group.ids)]
    assert (mesh_levels >= 0).all()
    shown_levels = [f'mesh{level or ""}' for level in mesh_levels]
    assert [crowd.explain(i).level for i in range(2)] == shown_levels
