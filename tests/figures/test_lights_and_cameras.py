"""Lights and cameras of files, added on request; the lights move with their joints."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import Clip, FigureMesh, Pose, Skeleton, Track
from pvibr.animation.gltf_lights import FigureCamera, FigureLight
from tests.animation.conftest import refused

DOWN = np.sqrt([0.5, 0.5])


@pytest.fixture
def lit():
    """Return a floor, a spot that looks down and moves, a sun, and a camera above."""
    rest = Pose([[0, 0, 2.0], [0, 0, 0], [0, 0, 9.0]], [[1, 0, 0, 0], [*DOWN, 0, 0], [1, 0, 0, 0]])
    move = Clip('move', [Track(0, 'translation', [0, 1], [[-3, 0, 2], [3, 0, 2]])])
    lights = [
        FigureLight(0, 'spot', 'lamp', (1.0, 0.5, 0.25), 4.0, cone=(0.0, 20.0)),
        FigureLight(1, 'directional', 'sun', intensity=0.5),
    ]
    floor = FigureMesh(pv.Plane(i_size=10, j_size=10), look={'color': 'white'})
    cameras = [FigureCamera(2, 'above', 60.0)]
    skeleton = Skeleton([-1, -1, -1], rest)
    return Figure([floor], skeleton, [move], cameras=cameras, lights=lights)


def test_lights_of_a_figure_stand_where_its_pose_has_them(lit):
    plotter = pv.Plotter(off_screen=True, lighting='none')
    spot, sun = lit.add_lights(plotter, lit.sample(0.75), exposure=0.5)
    assert plotter.renderer.lights == [spot, sun]
    assert spot.position == (1.5, 0, 2)
    assert spot.focal_point[2] < 2
    assert spot.intensity == 2
    np.testing.assert_allclose(np.subtract(sun.focal_point, sun.position), (0, 1, 0), atol=1e-9)
    plotter.close()


def test_lights_of_an_actor_move_with_it(lit):
    plotter = pv.Plotter(off_screen=True, window_size=(120, 80), lighting='none')
    actor = plotter.ibr.add_animated(lit)
    actor.add_lights()[1].switch_off()
    plotter.camera = lit.camera('above')
    plotter.background_color = 'black'

    def brightest(time):
        plotter.ibr.time = time
        plotter.render()
        picture = plotter.screenshot(return_img=True).astype(float)
        row, column = np.unravel_index(picture[..., 0].argmax(), picture.shape[:2])
        assert picture[row, column, 0] > 1.5 * picture[row, column, 2]
        return column

    plotter.show(auto_close=False)
    found = [brightest(time) for time in (0.2, 0.5, 0.8)]
    # 9 units away, 60 degrees high: 1 unit is 7.7 pixels.
    wanted = 60 + np.array([-1.8, 0, 1.8]) * 40 / (9 * np.tan(np.radians(30)))
    np.testing.assert_allclose(found, wanted, atol=9)
    assert found[0] < found[1] - 5 < found[2] - 10
    plotter.close()


def test_cameras_by_index_and_name(lit):
    camera = lit.camera()
    assert camera.position == (0, 0, 9)
    assert camera.view_angle == 60
    assert lit.camera('above', lit.sample(0.5)).position == (0, 0, 9)
    refused(r"camera must be in the figure \('above'\), got 3", lit.camera, 3)


def test_an_actor_in_no_plotter_has_no_place_for_lights(lit):
    from pvibr import AnimatedActor

    refused('must be in a plotter to add its lights', AnimatedActor(lit).add_lights)
