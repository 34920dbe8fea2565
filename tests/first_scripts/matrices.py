"""Poses from points, directions and sizes; from rotations; from a transform."""

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr

points = np.array([[0.0, 0, 0], [5, 0, 0]])
poses = pvibr.matrices(points, orient=[[0, 0, 1], [1, 0, 0]], scale=[2, 1])
np.testing.assert_allclose(poses[0] @ [1, 0, 0, 1], [0, 0, 2, 1], atol=1e-12)
np.testing.assert_allclose(poses[1] @ [1, 0, 0, 1], [6, 0, 0, 1], atol=1e-12)

turns = Rotation.from_euler('z', [[90], [0]], degrees=True)
turned = pvibr.matrices(points, turns)
np.testing.assert_allclose(turned[0] @ [1, 0, 0, 1], [0, 1, 0, 1], atol=1e-12)

pl = pv.Plotter()
pl.ibr.add_instances(pv.Cone(), poses)
pl.ibr.add_instances(pv.Cone(), pv.Transform().translate(0, 3, 0), color='red')
assert (pl.screenshot() != pl.background_color.int_rgb).any()
