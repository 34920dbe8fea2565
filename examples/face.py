"""
A face by morph targets
=======================

Each target is a difference from the neutral face; weights may be below 0 and above 1.
"""

import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. The neutral face: a head with a nose, brows and lips. x is to its left, y up, z forward.
head = pv.Sphere(radius=1, theta_resolution=200, phi_resolution=200, direction=(0, 1, 0))
x, y, z = head.points.T.copy()


def spot(cx, cy, wide, high):  # soft, and mirrored to both sides
    return (z > 0) * np.exp(-(((abs(x) - cx) / wide) ** 2) - ((y - cy) / high) ** 2)


mouth = y + 0.42 - 0.3 * x**2  # 0 between the lips
lips = (z > 0) * (abs(x) < 0.34) * np.exp(-((mouth / 0.085) ** 2)) * (1 - (x / 0.34) ** 2).clip(0)
head.points *= [0.85, 1.1, 0.9]
head.points[:, 2] += 0.28 * spot(0, -0.05, 0.12, 0.2) - 0.1 * spot(0.3, 0.18, 0.16, 0.12)
brows = (z > 0) * (abs(abs(x) - 0.32) < 0.17) * (abs(y - 0.4 + 0.3 * (abs(x) - 0.3) ** 2) < 0.035)
skin, red, brown = np.array([[240, 200, 175], [200, 70, 80], [90, 60, 40]])
paint = skin + (red - skin) * lips[:, None] + (brown - skin) * brows[:, None]

# %%
# 2. The targets: what a smile, an open mouth, raised brows and full cheeks add.
up, out, fore = np.eye(3)[[1, 0, 2]]
side, corner = np.sign(x)[:, None], spot(0.3, -0.4, 0.14, 0.16)[:, None]
lower = ((z > 0) * np.exp(-(((y + 0.6) / 0.22) ** 2) - (x / 0.4) ** 2) * (mouth < 0))[:, None]
targets = {
    'smile': corner * (0.13 * up + 0.1 * side * out - 0.03 * fore),
    'open': lower * (-0.25 * up - 0.03 * fore),
    'brows': spot(0.32, 0.42, 0.25, 0.14)[:, None] * 0.14 * up,
    'cheeks': spot(0.45, -0.25, 0.2, 0.2)[:, None] * (0.12 * fore + 0.12 * side * out),
}
morphs = pvibr.animation.Morphs(list(targets.values()), names=list(targets)).with_normals(head)
keys = [[0, 0, 0, 0], [1, 0, 0, 0], [-1, 0, -0.5, 0], [0.4, 1, 1, 0], [1.8, 0, 0.5, 1]]
clips = [pvibr.animation.Clip('talk', [pvibr.animation.Track(0, 'weights', range(5), keys)])]

# %%
# 3. The figure: the face and two eyes, at each key of its clip.
face = pvibr.Figure.from_arrays(head.points, head.regular_faces, morphs=morphs, clips=clips)
face.meshes[0].mesh['paint'] = paint.astype(np.uint8)
pl = pv.Plotter(window_size=(1200, 360), shape=(1, 5), border=False)
for time in range(5):
    pl.subplot(0, time)
    actor = pl.ibr.add_animated(face, scalars='paint', rgb=True, smooth_shading=True)
    actor.pose = face.sample(time, loop=False)
    for radius, color, z in ((0.13, 'white', 0.74), (0.06, 'black', 0.83)):
        eyes = [pv.Sphere(radius=radius, center=(x, 0.2, z)) for x in (-0.27, 0.27)]
        pl.add_mesh(pv.merge(eyes), color=color, smooth_shading=True)
    pl.camera_position = [(0, 0, 5.5), (0, 0, 0), (0, 1, 0)]
pl.show(auto_close=False)
pl.close()
