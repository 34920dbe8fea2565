"""Real models posed on the GPU against the float64 reference."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr

MODELS = [
    'AnimatedMorphCube.glb',
    'BoxAnimated.glb',
    'CesiumMan.glb',
    'Fox.glb',
    'MorphStressTest.glb',
    'RiggedSimple.glb',
    'SimpleMorph/SimpleMorph.gltf',
    'SimpleSkin/SimpleSkin.gltf',
    'robot.glb',
]


@pytest.mark.filterwarnings('ignore::pvibr.PvibrWarning')
@pytest.mark.parametrize('name', MODELS)
def test_models_are_posed_as_the_reference_has_them(name, data_dir):
    figure = pvibr.read_gltf(data_dir / 'gltf' / name)
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    actor = pl.ibr.add_animated(figure)
    pl.show(auto_close=False)
    for time in np.linspace(0, figure.clips[0].duration, 4):
        pl.ibr.time = time
        pl.render()
        low, high = np.reshape(actor.bounds, (3, 2)).T
        size = (high - low).max()
        for i, body in enumerate(actor._mesh_actors):
            points, normals = figure.posed(i, actor.pose)
            assert (points >= low - 1e-6 * size).all()
            assert (points <= high + 1e-6 * size).all()
            if body in actor._posed:
                check(actor, actor._posed.index(body), points, normals, size)


def check(actor, number, points, normals, size):
    body = actor._posed[number]
    positions, directions = (a[: len(points)] for a in actor._posing.gpu.download(number))
    matrix = pv.array_from_vtkmatrix(body.actor.GetMatrix())
    placed = positions @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(placed - points).max() <= 1e-5 * size
    if body.figure_mesh.skin is not None:
        cosine = (directions * normals).sum(1)[np.linalg.norm(normals, axis=1) > 0.5]
        assert cosine.min(initial=1.0) >= np.cos(np.radians(0.1))
