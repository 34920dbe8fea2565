"""
A billboard cloud
=================

A tree as a handful of textured rectangles. No vertex is displaced further than ``epsilon``, a
share of the diagonal of the bounding box; what comes out is a mesh with textures, as any viewer
shows them.
"""

import tempfile
from pathlib import Path

import pyvista as pv

from pvibr.scenes.trees import tree_parts
from pvibr.substitutes.billboard_cloud import billboard_cloud

TRIANGLES = 50_000
SIZE = 1024  # texels along a side of the texture

# %%
# 1. A tree: bark and leaves. Of a mesh it is ``mesh.ibr.billboard_cloud(epsilon=...)``.
tree = tree_parts('broadleaf', triangles=TRIANGLES)
clouds = [billboard_cloud(tree, epsilon=epsilon, size=SIZE) for epsilon in (0.03, 0.1)]
print(*clouds, sep='\n')

# %%
# 2. The tree, and its clouds beside it: lit by the normals of their textures.
pl = pv.Plotter(shape=(1, 3), window_size=(960, 380), border=False)
for column, add in enumerate([None, *(cloud.add_to for cloud in clouds)]):
    pl.subplot(0, column)
    pl.background_color = 'white'
    if add is None:
        for part in tree:
            pl.add_actor(part.actor, name=str(id(part)))
        pl.add_text('50 000 triangles', font_size=10, color='black')
    else:
        add(pl)
        pl.add_text(f'{len(clouds[column - 1].planes)} planes', font_size=10, color='black')
    pl.camera_position = [(28, -30, 14), (0, 0, 7), (0, 0, 1)]
pl.show(auto_close=False)

# %%
# 3. As files for other programs.
with tempfile.TemporaryDirectory() as folder:
    for name in ('tree.glb', 'tree.obj'):
        for file in clouds[0].save(Path(folder) / name):
            print(file.name, file.stat().st_size // 1000, 'kB')
pl.close()
