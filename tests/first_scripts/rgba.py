"""A colour and an opacity of each instance."""

import numpy as np
import pyvista as pv

rgba = np.array([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 60]], np.uint8)
pl = pv.Plotter(window_size=(300, 200), lighting='none')
places = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
pl.ibr.add_instances(pv.Cube(), places, colors=rgba, lighting=False, culling='back')
pl.background_color = 'white'
pl.view_xz()
picture = pl.screenshot()
colors = {tuple(int(v) for v in c) for c in np.unique(picture.reshape(-1, 3), axis=0)}
assert (255, 0, 0) in colors
assert (0, 255, 0) in colors
assert any(b == 255 and 170 < r < 220 for r, g, b in colors)

pl = pv.Plotter()
named = pl.ibr.add_instances(pv.Cube(), [(0, 0, 0), (2, 0, 0)], colors=['r', 'b'])
np.testing.assert_allclose(named.colors[1][:3], [0, 0, 255])
