"""A volume beside instances, with seven effects, one at a time."""

import numpy as np
import pyvista as pv

import pvibr

grid = pv.ImageData(dimensions=(12, 12, 12), origin=(-3, -3, -3), spacing=(0.5, 0.5, 0.5))
grid['fog'] = np.exp(-(np.linalg.norm(grid.points, axis=1) ** 2) / 4) * 255
pl = pv.Plotter(window_size=(200, 150))
pl.add_volume(grid, scalars='fog', show_scalar_bar=False)
pl.ibr.add_instances(pv.Sphere(), [(2.0 * x - 4, 3, 0) for x in range(5)], color='red')
plain = pl.screenshot().astype(int)
for kind in ('Bloom', 'Outline', 'DepthOfField', 'ToneMapping', 'AmbientOcclusion', 'Fog', 'Sky'):
    effect = pl.ibr.add(getattr(pvibr, kind)())
    pl.render()
    picture = pl.screenshot().astype(int)
    assert (picture.max((0, 1)) > 60).all(), kind
    pl.ibr.remove(effect)
    pl.render()
    assert (pl.screenshot() == plain).all(), kind
