"""Bloom does not change the colours of data."""

import numpy as np
import pyvista as pv

import pvibr

pl = pv.Plotter()
pl.add_mesh(
    pv.Plane(),
    scalars=np.linspace(0, 1, 100),
    cmap='viridis',
    lighting=False,
    show_scalar_bar=False,
)
pl.add_mesh(pv.Disc(center=(0, 0, 0.1), inner=0, outer=0.2), color='orange', lighting=False)
pl.view_xy()
plain = pl.screenshot().astype(int)
pl.ibr.add(pvibr.Bloom())
pl.render()
assert np.abs(pl.screenshot().astype(int) - plain).max() <= 2
