"""The global theme, and that of a plotter."""

import numpy as np
import pyvista as pv

theme = pv.themes.DarkTheme()
theme.color = 'lime'
theme.cmap = 'inferno'
theme.nan_color = 'blue'
places = [(2.0 * x, 0, 0) for x in range(5)]


def shot(add, **keys):
    pl = pv.Plotter(theme=theme, window_size=(300, 200))
    add(pl)
    pl.view_xz()
    return pl.screenshot().astype(float)


def mesh(places, scalars=None):
    points = pv.PolyData(places)
    if scalars is not None:
        points['data'] = scalars
    return points.glyph(geom=pv.Cube(), orient=False, scale=False)


values = [0, 1, 2, 3, np.nan]
plain = shot(lambda pl: pl.add_mesh(mesh(places)))
assert np.abs(shot(lambda pl: pl.ibr.add_instances(pv.Cube(), places)) - plain).mean() < 1
plain = shot(lambda pl: pl.add_mesh(mesh(places, values), show_scalar_bar=False))
ours = shot(
    lambda pl: pl.ibr.add_instances(pv.Cube(), places, scalars=values, show_scalar_bar=False)
)
assert np.abs(ours - plain).mean() < 1
before = pv.global_theme.color
pv.global_theme.color = 'magenta'
try:
    pl = pv.Plotter()
    pl.ibr.add_spheres(places, radius=0.5)
    picture = pl.screenshot().astype(int)
finally:
    pv.global_theme.color = before
assert (picture[..., 0] > picture[..., 1] + 60).any()
