"""
One large mesh, as the view needs it
====================================

A terrain of a million triangles, of which a view draws those that it can show.
"""

import numpy as np
import pyvista as pv

TRIANGLES = 1_000_000

# %%
# 1. Fractal heights on a grid, as a digital elevation model has them.
side = round((TRIANGLES / 2) ** 0.5) + 1
rng = np.random.default_rng(3)
frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side))
frequency[0, 0] = np.inf
heights = np.fft.irfft2(
    np.fft.rfft2(rng.standard_normal((side, side))) * frequency**-2, s=(side, side)
)
grid = pv.ImageData(dimensions=(side, side, 1), spacing=(1 / side, 1 / side, 1))
grid['height'] = 0.04 * heights.ravel() / heights.std()
terrain = grid.warp_by_scalar('height').extract_surface(algorithm='dataset_surface').triangulate()

# %%
# 2. The hierarchy is built once, and is found in the cache from then on.
pl = pv.Plotter(window_size=(960, 540))
ground = pl.ibr.add_large_mesh(
    terrain, scalars='height', cmap='gist_earth', smooth_shading=True, show_scalar_bar=False
)
pl.camera_position = [(0.5, -0.5, 0.45), (0.5, 0.5, 0.0), (0, 0, 1)]
pl.show(auto_close=False)
print(f'{ground.report()["triangles"]} of {ground.n_triangles} triangles')

# %%
# 3. A larger error draws fewer; 0 draws the mesh itself.
for max_error in (4.0, 1.0, 0.0):
    ground.max_error = max_error
    pl.render()
    print(f'max_error={max_error:g} px: {ground.report()["triangles"]} triangles')

# %%
# 4. Picks find the cells of the mesh, whatever is drawn.
x, y = np.array(pl.window_size) / 2
hit = pl.ibr.pick(x, y)
print(f'cell {hit.index} at {np.round(hit.point, 3)}')
pl.close()
