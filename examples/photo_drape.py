"""
A photograph on a mesh
======================

A calibrated photograph draped over the mesh that it shows, and baked into its colours. Where the
project's data are (a liver in an operation, SciKit-Surgery, BSD), they are used; elsewhere a photo
is taken of a mesh of PyVista's first.
"""

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

FOLDER = Path('../shared/data/projection/sksurgery_liver')

# %%
# 1. A photograph, its mesh, and where it was taken from: K, R and t as OpenCV has them.
if FOLDER.is_dir():
    photo = iio.imread(FOLDER / 'fig06_case1b.png')
    mesh = pv.read(FOLDER / 'liver_sub.ply')
    pose = np.loadtxt(FOLDER / 'model_to_camera.txt')
    K = np.loadtxt(FOLDER / 'calib.left.intrinsics.txt')
    camera = pvibr.Pinhole(K, pose[:3, :3], pose[:3, 3], (photo.shape[1], photo.shape[0]))
else:
    photo = iio.imread(examples.mapfile)
    mesh = pv.Sphere(radius=100.0).translate((0, 0, 400))
    high, wide = photo.shape[:2]
    K = [[1.5 * wide, 0, wide / 2], [0, 1.5 * wide, high / 2], [0, 0, 1]]
    camera = pvibr.Pinhole(K, np.eye(3), np.zeros(3), (wide, high))

# %%
# 2. The photograph on the mesh, seen from another side; flat angles are left out.
pl = pv.Plotter(shape=(1, 2), window_size=(1100, 520))
pl.add_mesh(mesh, color='tan', smooth_shading=True)
pl.ibr.add(pvibr.Projector(photo, camera, max_angle=80.0))
eye, middle = camera.position, np.array(mesh.center)
away = np.linalg.norm(middle - eye) * (-0.5 * camera.R[0] - 0.3 * camera.R[2])
place = [tuple(eye + away), tuple(middle), tuple(-camera.R[1])]
pl.camera_position = place

# %%
# 3. The same as data of the points, which any viewer shows and any file keeps.
draped = pvibr.Projector(photo, camera, max_angle=80.0).bake(mesh.subdivide(2))
print(f'{draped["covered"].mean():.0%} of the points are covered')
colors = draped['projected'][:, :3].copy()
colors[~draped['covered']] = (210, 180, 140)  # as the mesh is
pl.subplot(0, 1)
pl.add_mesh(draped, scalars=colors, rgb=True, lighting=False)
pl.camera_position = place
pl.show()
