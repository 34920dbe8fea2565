"""Joints as tables, and figures turned from y up to z up."""

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr import Figure, matrices
from pvibr.animation import FigureMesh, Pose, Skeleton
from tests.figures.makers import bend, worm

QUARTER = Rotation.from_euler('x', 90, degrees=True).as_matrix()


def test_a_table_holds_the_poses_of_the_joints():
    figure = worm()
    pose = bend(figure, 0.4, stretch=1.0)
    table = figure.joints(pose=pose)
    np.testing.assert_allclose(matrices(table), figure.world(pose), atol=1e-12)
    assert table['joint'].tolist() == list(figure.skeleton.names)
    assert table['parent'].tolist() == figure.skeleton.parents.tolist()
    relative = figure.joints(pose=pose, world=False)
    np.testing.assert_allclose(matrices(relative), pose.matrices(), atol=1e-12)


def test_hidden_and_mirrored_joints_have_rows():
    rest = Pose(np.zeros((3, 3)), scale=[[1, 1, 1], [0, 0, 0], [-2, 1, 3]])
    table = Figure([], Skeleton([-1, 0, 0], rest)).joints()
    assert table['sx'][1] == 0
    norms = np.linalg.norm([table[name] for name in ('qw', 'qx', 'qy', 'qz')], axis=0)
    np.testing.assert_allclose(norms, 1)
    visible = {name: values[[0, 2]] for name, values in table.items()}
    np.testing.assert_allclose(matrices(visible), rest.matrices()[[0, 2]], atol=1e-12)


@pytest.mark.parametrize('angle', [0.0, 0.5])
def test_upright_turns_every_pose(angle):
    figure = worm(n_morphs=2)
    upright = figure.upright()
    pose = bend(figure, angle)
    turned = Pose(
        np.vstack([pose.translation, np.zeros(3)]),
        np.vstack([pose.rotation, upright.skeleton.rest.rotation[-1]]),
        np.vstack([pose.scale, np.ones(3)]),
    )
    points = upright.mesh(pose=turned).points
    np.testing.assert_allclose(points, figure.mesh(pose=pose).points @ QUARTER.T, atol=1e-6)


def test_upright_turns_what_has_no_joint():
    tall = Figure([FigureMesh(pv.Cone(direction=(0, 1, 0), center=(0, 5, 0), height=3))])
    points = tall.upright().upright().mesh().points
    np.testing.assert_allclose(points, tall.mesh().points @ (QUARTER @ QUARTER).T, atol=1e-6)
