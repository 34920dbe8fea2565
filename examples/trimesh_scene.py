"""
A scene of trimesh
==================

The graph of a ``trimesh.Scene`` says which mesh stands where: it needs no poses. The same goes for
the path of a file with a scene graph, such as a glTF file.
"""

import numpy as np
import pyvista as pv
import trimesh
from trimesh.transformations import rotation_matrix, translation_matrix

COUNT = 400

# %%
# 1. Two meshes of trimesh's own kind.
LYING = rotation_matrix(np.pi / 2, (1, 0, 0))
capsule = trimesh.creation.capsule(height=1.0, radius=0.4, count=[48, 48])
capsule.visual.face_colors = [200, 80, 60, 255]
ball = trimesh.creation.icosphere(subdivisions=4, radius=0.4)
ball.visual.face_colors = [70, 130, 200, 255]

# %%
# 2. A graph: each mesh once, each node a place for one of them.
scene = trimesh.Scene({'capsule': capsule, 'ball': ball})
scene.graph.clear()
rng = np.random.default_rng(4)
for k in range(COUNT):
    place = [*(1.9 * np.array(divmod(k, 20)) + rng.uniform(-0.2, 0.2, 2)), 0]
    turn = rotation_matrix(rng.uniform(0, np.pi), (0, 0, 1)) @ LYING
    scene.graph.update(
        f'node {k}',
        matrix=translation_matrix(place) @ turn,
        geometry='ball' if k % 3 else 'capsule',
    )

# %%
# 3. The whole scene in one call.
pl = pv.Plotter(window_size=(960, 540))
instances = pl.ibr.add_instances(scene, name='scene')
print(f'{len(instances)} instances of {len(instances.atlases)} meshes')
pl.camera_position = [(5, -13, 9), (17, 12, 0), (0, 0, 1)]
pl.ibr.look('studio')
pl.show()
