"""
Photographs of a photogrammetry project
=======================================

A project in COLMAP's format, made here: four photographs of a globe and their cameras. One call
reads it (or any other program's), and the photographs are draped over the bare mesh.
"""

import tempfile
from pathlib import Path

import pyvista as pv
from pyvista import examples

import pvibr

folder = Path(tempfile.mkdtemp())
(folder / 'images').mkdir()

# %%
# 1. Photographs of a textured globe, and their cameras written for COLMAP.
studio = pv.Plotter(off_screen=True, window_size=(640, 480), lighting='none')
globe = examples.load_globe()
globe = globe.scale(1 / max(globe.bounds))
studio.add_mesh(globe, texture=examples.load_globe_texture(), lighting=False)
taken = []
for k, place in enumerate([(4, 0, 1.5), (0, 4, 1), (-4, 0, 1.5), (0, -4, 1)]):
    studio.camera_position = [place, (0, 0, 0), (0, 0, 1)]
    studio.render()
    studio.screenshot(folder / 'images' / f'{k:04}.png')
    taken.append(studio.camera.copy())
size = tuple(studio.window_size)
studio.close()
pvibr.write_cameras(folder / 'sparse' / '0', taken, size=size)

# %%
# 2. The project read again, and its photographs on a mesh without any texture.
photos = pvibr.read_cameras(folder)
print(photos[0])
pl = pv.Plotter(window_size=(960, 540))
bare = globe.copy()
bare.clear_data()
painted = pl.ibr.add_photos(bare, photos, color='tan', max_angle=80.0)
print(painted.report())

# %%
# 3. Where they were taken from; ``pl.ibr.fly_to(photos[0])`` goes there.
pl.add_mesh(photos.frustums(0.8), color='black', line_width=2)
pictures, image = photos.thumbnails(0.8)
pl.add_mesh(pictures, texture=pv.Texture(image[..., :3].copy()), lighting=False)
pl.camera_position = [(8.6, -4.2, 4.4), (0, 0, 0.1), (0, 0, 1)]
pl.camera.view_angle = 27
pl.ibr.look('studio').effects['Shadows'].casts = [painted]
pl.ibr.add(pvibr.Accumulation(16))
pl.show()
