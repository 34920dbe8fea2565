"""The camera's clipping planes cut what impostors show as they cut the meshes."""

import numpy as np
import pytest
import pyvista as pv

from tests.pictures import place, plotter, shot

pytestmark = pytest.mark.sampled


def make(seed, parallel, **settings):
    """Return a plotter with two bowls and some balls, and their impostor."""
    rng = np.random.default_rng(seed)
    pl = plotter((200, 150))
    torus = pv.ParametricTorus(u_res=80, v_res=40)
    actors = [pl.add_mesh(torus, color='gold', smooth_shading=True)]
    for _ in range(9):
        ball = pv.Sphere(radius=0.35, center=rng.uniform(-1.6, 1.6, 3))
        actors.append(pl.add_mesh(ball, color=rng.uniform(0.1, 0.9, 3)))
    actors[0].orientation = rng.uniform(0, 360, 3)
    place(pl, (2, -11, 4), parallel=2.6 if parallel else None)
    pl.camera.clipping_range = (1.0, 30.0)
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False, **settings)
    pl.show(auto_close=False)
    return pl, impostor


@pytest.mark.parametrize('settings', [{}, {'hierarchical': True}, {'depth': False}])
@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('seed', [0, 8])
def test_they_cut_images_as_they_cut_meshes(seed, parallel, settings):
    pl, impostor = make(seed, parallel, **settings)
    for planes in ((1.0, 30.0), (1.0, 11.7), (12.0, 30.0), (11.2, 12.4), (1.0, 5.0), (20.0, 30.0)):
        pl.camera.clipping_range = planes
        impostor.enabled = True
        found = shot(pl)
        if planes[1] > 12 and planes[0] < 15:
            assert impostor.report()['shown'] > 0
        impostor.enabled = False
        mesh = shot(pl)
        cover = [(p < 255).any(-1) for p in (mesh, found)]
        assert (cover[0] != cover[1]).mean() < 0.008, planes
        if settings.get('depth', True):
            assert (np.abs(mesh - found).max(-1) > 60).mean() < 0.012, planes
