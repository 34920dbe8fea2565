"""Near members of a crowd at lighter levels: how far off they are, and where they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Morphs, Track
from pvibr.figures import pose_atlas
from pvibr.figures.member_poses import MemberPoses
from pvibr.instances import measure
from pvibr.meshes.surface_distance import Surface, hausdorff
from tests.figures.makers import bending, skeleton, skin, tube, worm
from tests.pictures import off, place, plotter, shot

COUNT = 12


def swelling():
    """A figure that swells here and there while it bends."""
    mesh, bones = tube(), skeleton()
    points = np.asarray(mesh.points, float)
    swollen = [points * [1, 1, 0] * np.cos(k * points[:, 2:]) for k in (1, 2)]
    weights = Track(0, 'weights', [0, 1, 2], [[0, 0], [0.4, -0.3], [0, 0]])
    clip = Clip('swell', [*bending().tracks, weights])
    morphs = Morphs(swollen).with_normals(mesh)
    return Figure([FigureMesh(mesh, skin=skin(mesh, bones), morphs=morphs)], bones, [clip])


def series():
    """A figure of key frames, a tube that bends more and more."""
    meshes = []
    for bend in (0.0, 0.1, 0.15):
        mesh = tube()
        mesh.points[:, 0] += bend * mesh.points[:, 2] ** 2
        meshes.append(mesh.compute_normals(cell_normals=False, split_vertices=False))
    return Figure.from_series(meshes)


FIGURES = {
    'skinned': (lambda: worm(clips=[bending()]), 'linear'),
    'dual': (lambda: worm(clips=[bending()]), 'dual'),
    'morphed': (swelling, 'linear'),
    'key frames': (series, 'linear'),
}


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(pose_atlas, 'VIEWS', 6)
    monkeypatch.setattr(pose_atlas, 'TILES', (32,))
    monkeypatch.setattr(measure, 'LAYOUTS', (measure.Layout(8, (8, 16, 32)),))


@pytest.fixture
def crowd_of(atlases):
    def make(name='skinned', max_error=1.0, **looks):
        figure, skinning = FIGURES[name][0](), FIGURES[name][1]
        rng = np.random.default_rng(2)
        poses = np.tile(np.eye(4), (COUNT, 1, 1))
        poses[:, :2, 3] = 4.0 * np.stack(np.divmod(np.arange(COUNT), 4), 1)
        looks = {'smooth_shading': True, 'color': 'tan', 'cache': atlases} | looks
        pl = plotter((240, 180))
        times = rng.uniform(0, 2, COUNT)
        crowd = pl.ibr.add_animated(
            figure, poses, times=times, skinning=skinning, max_error=max_error, **looks
        )
        place(pl, (30, -24, 20), focus=(4, 6, 0))
        pl.show(auto_close=False)
        return pl, crowd

    return make


def levels_of(crowd):
    (group,) = crowd.groups
    return group.levels


def level_counts(crowd):
    report = crowd.report()
    return [report[f'mesh {level.triangles}'] for level in levels_of(crowd)]


@pytest.mark.parametrize('name', FIGURES)
def test_levels_are_as_near_as_they_say(name, crowd_of):
    """In poses that were not measured, against the figure posed in float64."""
    _, crowd = crowd_of(name)
    (group,) = crowd.groups
    full, *lighter = levels_of(crowd)
    assert lighter
    skinning = FIGURES[name][1]
    clip = full.figure.clips[0]
    for level in lighter:
        assert level.triangles < 0.75 * full.triangles
        for time in (0.13, 0.61, 1.47):
            pose = full.figure.sample(time, clip)
            surfaces = [
                Surface(
                    x.figure.posed(0, pose, skinning)[0], np.asarray(x.parts[0].mesh.regular_faces)
                )
                for x in (full, level)
            ]
            # The largest distance of a few poses is not quite that of all.
            assert hausdorff(*surfaces, 500) <= 1.1 * level.error * group.atlas.radius


@pytest.mark.parametrize('name', FIGURES)
def test_lighter_levels_look_as_the_mesh(name, crowd_of):
    pl, crowd = crowd_of(name)
    for now in (0.0, 0.7):
        pl.ibr.time = now
        pictures = []
        for level in ('mesh', 'mesh1'):
            crowd.force_level = level
            pictures.append(shot(pl))
            assert level_counts(crowd)[int(level[4:] or 0)] == COUNT
        assert (off(*pictures) > 24).mean() < 4e-3
        other = worse_time(pl)
        assert off(*pictures).mean() < 0.2 * off(pictures[0], other).mean()


def worse_time(pl):
    pl.ibr.time += 0.5
    return shot(pl)


def test_a_level_is_chosen_by_size(crowd_of):
    pl, crowd = crowd_of()
    near = level_counts(crowd)
    assert sum(near[1:]) == COUNT
    explanation = crowd.explain(0)
    assert explanation.level.startswith('mesh')
    pl.camera.zoom(12)
    pl.camera.focal_point = crowd.poses[0, :3, 3]
    pl.render()
    sizes = [k for k, n in enumerate(level_counts(crowd)) if n]
    assert min(sizes) < min(k for k, n in enumerate(near) if n)


def test_only_the_mesh_where_nothing_else_is_allowed(crowd_of):
    pl, crowd = crowd_of(max_error=1e-3)
    picture = shot(pl)
    assert level_counts(crowd)[0] == COUNT
    crowd.force_level = 'mesh'
    np.testing.assert_array_equal(shot(pl), picture)


def test_levels_come_from_the_cache(crowd_of, monkeypatch):
    pl, crowd = crowd_of()
    picture = shot(pl)
    monkeypatch.setattr(pose_atlas, 'simplified', None)
    again_pl, again = crowd_of()
    np.testing.assert_array_equal(shot(again_pl), picture)
    pairs = zip(levels_of(crowd), levels_of(again), strict=True)
    for level, other in pairs:
        assert level.error == other.error
        skins = [x.figure.meshes[0].skin for x in (level, other)]
        np.testing.assert_array_equal(skins[0].weights, skins[1].weights)


def test_shadows_pose_each_member_once_a_frame(crowd_of, monkeypatch):
    pl, _crowd = crowd_of()
    pl.add_mesh(pv.Plane(center=(6, 6, -3), i_size=40, j_size=40), color='white')
    pl.ibr.add(pvibr.Shadows())
    pl.ibr.time = 0.3
    pl.render()
    posed: list = []
    pose = MemberPoses._pose

    def counted(self, numbers, moments):
        posed.extend((id(self), int(n)) for n in numbers)
        pose(self, numbers, moments)

    monkeypatch.setattr(MemberPoses, '_pose', counted)
    pl.ibr.time = 0.4
    pl.render()
    assert len(posed) == len(set(posed)) >= COUNT
    posed.clear()
    pl.camera.azimuth = 2
    pl.render()
    assert not posed


def test_shadows_of_lighter_levels(crowd_of):
    pictures = []
    for max_error in (1.0, 1e-3):
        pl, _crowd = crowd_of(max_error=max_error)
        pl.add_mesh(pv.Plane(center=(6, 6, -3), i_size=40, j_size=40), color='white')
        pl.ibr.add(pvibr.Shadows())
        pl.ibr.time = 0.3
        pictures.append(shot(pl))
    assert (off(*pictures) > 32).mean() < 0.01


def test_removed_and_added_again(crowd_of):
    pl, crowd = crowd_of()
    before = shot(pl)
    pl.ibr.remove(crowd)
    assert crowd.report()['bytes'] == 0
    pl.ibr.add(crowd)
    assert off(shot(pl), before).max() <= 1
