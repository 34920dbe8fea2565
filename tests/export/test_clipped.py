"""What clipping planes of handles leave is what a plain plotter has."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk


@pytest.mark.parametrize('kind', ['spheres', 'instances', 'billboards'])
def test_what_clipping_planes_leave(kind):
    rng = np.random.default_rng(7)
    places, colors = rng.uniform(-2, 2, (6, 3)), rng.uniform(0, 1, (6, 3))
    pl = pv.Plotter(window_size=(120, 90))
    if kind == 'spheres':
        thing = pl.ibr.add_spheres(places, 0.9, colors=colors, ambient=1, diffuse=0)
    elif kind == 'instances':
        thing = pl.ibr.add_instances(pv.Sphere(radius=0.9), places, colors=colors, lighting=False)
    else:
        image = np.full((4, 4, 3), 255, np.uint8)
        thing = pl.ibr.add_billboards(places, image, size=1.8, colors=colors)
    pl.view_vector((1, -2, 0.7))
    for _ in range(2):
        plane = _vtk.vtkPlane()
        plane.SetNormal(*rng.normal(size=3))
        plane.SetOrigin(*rng.uniform(-0.5, 0.5, 3))
        thing.mapper.AddClippingPlane(plane)
    pl.show(auto_close=False)
    plain = pl.ibr.to_plain_plotter()
    plain.show(auto_close=False)
    one, two = (p.screenshot(return_img=True).astype(int) for p in (pl, plain))
    drawn = (one != one[0, 0]).any(2)
    assert drawn.mean() > 0.02
    assert (np.abs(one - two).max(2) > 25).sum() < 0.15 * drawn.sum()
