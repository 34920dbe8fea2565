"""PyVista's own pickers, on instances near and far."""

import numpy as np
import pyvista as pv

places = np.array([[0.0, 0, 0], [0, 400, 0]])
pl = pv.Plotter(window_size=(300, 200))
trees = pl.ibr.add_instances(pv.Sphere(theta_resolution=60, phi_resolution=60), places)
pl.camera_position = [(0.2, -6, 0.1), (0, 0, 0.1), (0, 0, 1)]
pl.camera.clipping_range = 0.1, 1000
found = []
pl.enable_mesh_picking(found.append, use_actor=True, left_clicking=True, show=False)
pl.show(auto_close=False)
pl.iren._mouse_left_button_click(150, 100)
assert found
assert trees.instance_of(found[-1]) == 0
pl.close()
