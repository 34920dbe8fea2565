"""
Heavy actors as images of themselves
====================================

Knots of 60 000 triangles each that stay ordinary actors: they are drawn as images, taken again
only where the error asks for it.
"""

import time

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401

# %%
# 1. Heavy actors, as any plotter has them: knots that interpenetrate a floor and each other.
turns = np.linspace(0, 2 * np.pi, 1250)
ring = 2 + np.cos(3 * turns)
line = np.c_[ring * np.cos(2 * turns), ring * np.sin(2 * turns), np.sin(3 * turns)]
knot = pv.Spline(line, 1250).tube(radius=0.45, n_sides=24).triangulate().compute_normals()
print(f'{knot.n_cells:,} triangles each')

pl = pv.Plotter(window_size=(960, 540), lighting='three lights')
pl.add_mesh(pv.Plane(i_size=60, j_size=60), color='#c8c0b0')
rng = np.random.default_rng(1)
actors = []
for row in range(4):
    for column in range(6):
        actor = pl.add_mesh(knot, color=rng.random(3), specular=0.4, smooth_shading=True)
        actor.position = 8 * (column - 2.5), 8 * (row - 1.5), 1.0 + rng.random()
        actor.orientation = 360 * rng.random(3)
        actors.append(actor)
pl.camera_position = [(0, -75, 38), (0, 0, 0), (0, 0, 1)]
pl.show(auto_close=False)


# %%
# 2. A few frames of an orbit, as meshes and as impostors.
def orbit(frames=12, step=0.25):
    """Return the milliseconds of a frame."""
    start = time.perf_counter()
    for _ in range(frames):
        pl.camera.Azimuth(step)
        pl.render()
        pl.screenshot(None)
    return 1e3 * (time.perf_counter() - start) / frames


print(f'meshes: {orbit(2):.0f} ms a frame')
impostor = pl.ibr.add_impostor(actors, max_error=1.0)
orbit(4)  # the first images, and what they cost
print(f'impostors: {orbit():.0f} ms a frame')

# %%
# 3. What happened: how many images there are, how wrong the worst is, which are meshes and why.
print(pl.ibr.report())

# %%
# 4. The actors stay what they were: move one, hide one, and it is seen to.
actors[0].position = (0, -22, 4)
actors[1].visibility = False
pl.render()
pl.close()
