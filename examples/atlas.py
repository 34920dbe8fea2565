"""
Look at an atlas
================

The images of a mesh are data: they can be baked beforehand, looked at, saved and loaded.
"""

import tempfile
from pathlib import Path

import pyvista as pv
from pyvista import examples

import pvibr

VIEWS = 16

# %%
# 1. Bake: the mesh from 16 x 16 sides, with what each pixel needs to be lit and to be seen from
# between two views: colour before light, normal, depth and coverage.
airplane = examples.load_airplane()
atlas = airplane.ibr.bake(views=VIEWS, color='silver')
print(f'{atlas.views} x {atlas.views} views, {atlas.nbytes / 2**20:.0f} MiB')

# %%
# 2. What was measured on views that were not baked. For each size on the screen and each way of
# drawing: how far the outline is off (95th percentile, pixels), and FLIP, the difference that a
# person sees, over that of the mesh drawn once per pixel, in the worst patch of directions.
sizes = atlas.errors['sizes']
for level, rows in atlas.errors.items():
    if rows.ndim == 3:  # of sizes and patches: outline, FLIP, that of the mesh, how that falls
        ratios = (rows[..., 1] / rows[..., 2]).max(1)
        text = '  '.join(
            f'{size:.0f} px: {outline:.2f} {ratio:.2f}'
            for size, outline, ratio in zip(sizes, rows[..., 0].max(1), ratios, strict=True)
        )
        print(f'{level:9}{text}')

# %%
# 3. Save and load.
path = Path(tempfile.mkdtemp()) / 'airplane.npz'
atlas.save(path)
again = pvibr.Atlas.load(path)
path.unlink()

# %%
# 4. Look at all the views: colours above, normals below. The view from straight above is in the
# middle, those from below are at the corners.
sheet = again.contact_sheet()
pl = pv.Plotter(window_size=(500, 1000))
plane = pv.Plane(i_size=1, j_size=2, i_resolution=1, j_resolution=1)
pl.add_mesh(plane, texture=pv.Texture(sheet), lighting=False)
pl.view_xy()
pl.camera.tight(adjust_render_window=False)
pl.show()
