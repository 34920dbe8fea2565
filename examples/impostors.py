"""
Heavy actors as images of themselves
====================================

Heavy knots that stay ordinary actors: their images are taken again only when they must be.
"""

import time

import numpy as np
import pyvista as pv

TRIANGLES = 60_000

# %%
# 1. Heavy actors, as any plotter has them: knots that interpenetrate a floor and each other.
t = np.linspace(0, 2 * np.pi, TRIANGLES // 48)
ring = (2 + np.cos(3 * t)) * np.exp(2j * t)
line = np.c_[ring.real, ring.imag, np.sin(3 * t)]
knot = pv.Spline(line, len(line)).tube(radius=0.45, n_sides=24).triangulate().compute_normals()

pl = pv.Plotter(window_size=(960, 540), lighting='three lights')
pl.add_mesh(pv.Plane(i_size=60, j_size=60), color='#c8c0b0')
rng, actors = np.random.default_rng(1), []
colors = '#b5533c', '#d9a441', '#5f7a4f', '#3f6f8a', '#7a5a80', '#c9bfae'
for row, column in np.ndindex(4, 6):
    actor = pl.add_mesh(knot, color=colors[column], specular=0.4, smooth_shading=True)
    actor.position = 8 * (column - 2.5), 8 * (row - 1.5), 1.0 + rng.random()
    actor.orientation = 360 * rng.random(3)
    actors.append(actor)
pl.camera_position = [(0, -75, 38), (0, 0, 0), (0, 0, 1)]
pl.show(auto_close=False)


# %%
# 2. Milliseconds of a frame on an orbit, as meshes and as impostors.
def orbit(frames=12, step=0.25):
    start = time.perf_counter()
    for _ in range(frames):
        pl.camera.Azimuth(step)
        pl.render()
        pl.screenshot(None)  # waits for the pixels
    return 1e3 * (time.perf_counter() - start) / frames


print(f'meshes: {orbit(2):.0f} ms a frame')
pl.ibr.add_impostor(actors, max_error=1.0)
orbit(4)  # takes the first images
print(f'impostors: {orbit():.0f} ms a frame')

# %%
# 3. How many images there are, how wrong the worst is, which are meshes and why.
print(pl.ibr.report())

# %%
# 4. The actors stay what they were: move one, hide one, and it is seen to.
actors[0].position = (0, -22, 4)
actors[1].visibility = False
pl.render()
pl.close()
