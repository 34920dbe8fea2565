"""Ambient occlusion, supersampling, eye-dome lighting and depth of field together."""

import pyvista as pv

import pvibr

pl = pv.Plotter(window_size=(300, 200))
balls = pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 3.0 * x, 0) for x in range(5)], color='red')
pl.add_mesh(pv.Plane(center=(4, 6, -0.5), i_size=20, j_size=20))
pl.enable_ssao(radius=1)
pl.enable_anti_aliasing('ssaa')
pl.enable_eye_dome_lighting()
pl.ibr.add(pvibr.DepthOfField(balls))
first = pl.screenshot()
pl.render()
assert (pl.screenshot() == first).all()
red = (first[..., 0] > first[..., 2] + 40).mean()
assert red > 0.02
