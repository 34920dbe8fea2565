"""A page of trame holds the picture."""

import pyvista as pv
from pyvista.trame.ui import plotter_ui
from trame.app import get_server
from trame.ui.vuetify3 import SinglePageLayout

pl = pv.Plotter()
pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
server = get_server('first-script')
with SinglePageLayout(server) as layout, layout.content:
    view = plotter_ui(pl, mode='server')
assert view is not None
assert (pl.screenshot() != 255).any()
