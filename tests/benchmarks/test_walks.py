"""Walks beside VTK's own instances: turns, extrapolation, and the scenes that are walked."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from benchmarks.instances import knots, near, walk
from pvibr.cli import peers
from pvibr.meshes.parts import as_parts
from pvibr.scenes.landscape import landscape
from pvibr.scenes.stage import MULTI_SAMPLES, Stage, scenery, stage

CAMERA = [(0, -30, 2), (0, 0, 0), (0, 0, 1)]


@pytest.mark.parametrize('lod', [False, True])
def test_the_time_of_a_part_is_extrapolated_to_all(monkeypatch, lod):
    poses = np.tile(np.eye(4), (40, 1, 1))
    meshes, index = [as_parts(pv.Cone()), as_parts(pv.Cube())], np.arange(40) % 2
    # A frame without instances takes 1 s of the processors, each actor 2 s.
    monkeypatch.setattr(
        peers,
        'frame_at',
        lambda stage, camera: (1.0 + 2 * stage.renderer.GetActors().GetNumberOfItems(), 0.5),
    )
    with peers.GlyphFrames(
        lambda: Stage((8, 6)), meshes, poses, index, lod=lod, part=10
    ) as frames:
        assert frames.part == 10
        cpu, wall = frames.seconds(CAMERA)
        frames.sample(8)
    assert cpu == 1 + 40 / 10 * 2 * 2
    assert wall == 0.5


def test_a_part_is_never_more_than_there_is():
    with peers.GlyphFrames(
        lambda: Stage((8, 6)), [as_parts(pv.Cone())], np.eye(4)[None], np.zeros(1, int)
    ) as frames:
        assert frames.part == 1


def turns(monkeypatch, cameras, every, limit=np.inf, wall=1.0):
    """Return what is drawn when, and the times noted, of frames that take so long."""
    drawn = []
    monkeypatch.setattr(
        peers, 'frame_at', lambda stage, camera: drawn.append(('own', camera)) or (2.0, wall)
    )
    peer = SimpleNamespace(seconds=lambda camera: drawn.append(('peer', camera)) or (9.0, 8.0))
    times = peers.beside_peers(None, {'glyphs': peer}, list(range(cameras)), every, limit)
    return drawn[2:], times


def test_frames_are_drawn_by_turns(monkeypatch):
    drawn, times = turns(monkeypatch, 6, 3)
    assert [k for who, k in drawn if who == 'own'] == list(range(6))
    assert [k for who, k in drawn if who == 'peer'] == [1, 4]
    assert drawn.index(('peer', 1)) == drawn.index(('own', 1)) + 1
    assert (len(times['pvibr']), len(times['glyphs'])) == (6, 2)


def test_slow_frames_stop_the_walk_once_peers_have_drawn(monkeypatch):
    drawn, times = turns(monkeypatch, 8, 4, limit=0.5)
    assert len(times['pvibr']) == 1
    assert [k for who, k in drawn if who == 'peer'] == [2]


def test_a_landscape_is_lit_as_plotters_are_by_default(small_trees):
    scene = landscape(2, triangles=6_000)
    with stage(scene, (40, 30)) as drawn:
        assert len(drawn.renderer.lights) == 5
        assert drawn.plotter.camera.view_angle == scene.view_angle
    plotter = scenery(scene, 1.0, (40, 30), off_screen=True)
    assert len(plotter.renderer.lights) == 5
    plotter.close()


def test_the_eye_walks_among_knots_and_within_none():
    poses, cameras, bounds = knots._field(10_000)
    assert len(poses) == 10_000
    places = poses[:, :3, 3]
    low, high = np.array(bounds).reshape(3, 2).T
    for eye, _, _ in cameras:
        away = np.linalg.norm(places - eye, axis=1)
        assert 3.6 < away.min() < 12  # a knot reaches 3.5
        assert ((low < eye) & (np.array(eye) < high)).all()


def test_near_trees_are_as_large_as_they_say(small_trees):
    trees = near._Trees((640, 450))
    assert len(trees.poses) == 3 * 2
    _, radius = near.bounding_sphere(np.concatenate([p.mesh.points for p in near.tree_parts()]))
    distance = np.linalg.norm(trees.camera[0])
    half_angle = np.radians(near._ANGLE / 2)
    pixels = 2 * radius / (distance * np.tan(half_angle)) * 450 / 2
    assert pixels == pytest.approx(near.DIAMETER)
    with trees.stage(multi_samples=0) as drawn:
        covered = (abs(trees.picture(trees.filled(drawn)) - drawn.read()[0, 0]) > 0.02).any(2)
    assert not covered[[0, -1]].any()
    assert not covered[:, [0, -1]].any()
    assert covered.mean() > 0.05


def test_motion_counts_what_changes_beyond_the_reference(monkeypatch):
    still, moved = np.zeros((24, 24, 3)), np.zeros((24, 24, 3))
    moved[8:16, 8:16] = 1.0
    flicker = np.ones((24, 24, 3))
    shots = {'own': [still, flicker], 'meshes': [still, flicker], 'truth': [still, moved]}
    monkeypatch.setattr(walk, 'pictures', lambda *_: shots['own'])
    monkeypatch.setattr(
        walk, '_full', lambda *_, **how: shots['truth' if 'samples' in how else 'meshes']
    )
    monkeypatch.setattr(walk, '_part', lambda *_: [0])
    scene = SimpleNamespace(path=lambda *_: [CAMERA, CAMERA])
    own = SimpleNamespace(
        look=lambda _: None, frame=lambda: None, window=SimpleNamespace(SetMultiSamples=id)
    )
    trees = type('Trees', (), {'visible': None, '__len__': lambda self: 1})()
    settings = SimpleNamespace(steps=2, part=1, size=(24, 24))
    rows = {row.name: row for row in walk._motion(own, trees, scene, settings)}
    for samples in MULTI_SAMPLES:
        row = rows[f'motion, {samples} samples: FLIP between frames, pvibr over that']
        assert (row.value, row.bar) == (1, 1.2)
    shots['own'] = shots['truth']  # changes no more than the reference
    rows = {row.name: row.value for row in walk._motion(own, trees, scene, settings)}
    assert rows['motion, 8 samples: FLIP between frames, pvibr over that'] == 0
