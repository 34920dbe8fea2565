"""
Choose the error
================

One scene, three times, with 0.5, 1 and 4 pixels of error allowed; ``max_error`` can be changed at
any time. Below each picture is how it differs from the meshes, six times as bright.
"""

import numpy as np
import pyvista as pv

COUNT = 400
SIZE = 320

# %%
# 1. Tubes along knots, 30 000 triangles each.
t = np.linspace(0, 2 * np.pi, 400)
r = 2 + np.cos(3 * t)
knot = pv.Spline(np.stack([r * np.cos(2 * t), r * np.sin(2 * t), np.sin(3 * t)], 1), 500)
mesh = knot.tube(radius=0.35, n_sides=30)
side = int(np.sqrt(COUNT))
places = np.stack([*np.divmod(np.arange(side**2), side), np.zeros(side**2)], 1) * 8.0


# %%
# 2. A picture of them. An error of nearly nothing is that of the meshes themselves.
def picture(max_error):
    pl = pv.Plotter(off_screen=True, window_size=(SIZE, SIZE), lighting='three lights')
    knots = pl.ibr.add_instances(mesh, places, color='goldenrod', max_error=max_error)
    pl.camera_position = [(-15, -15, 25), (40, 40, 0), (0, 0, 1)]
    image = pl.screenshot(return_img=True)
    print(f'max_error {max_error}: {knots.report()}')
    pl.close()
    return image


meshes = picture(1e-6)
pictures = {error: picture(error) for error in (0.5, 1.0, 4.0)}

# %%
# 3. Side by side.
pl = pv.Plotter(shape=(2, 3), window_size=(3 * SIZE, 2 * SIZE), border=False)
for column, (error, image) in enumerate(pictures.items()):
    away = np.abs(image.astype(int) - meshes)
    shown = (image, (6 * away).clip(0, 255).astype(np.uint8))
    notes = (f'max_error {error:g} px', f'mean difference {away.mean():.2f} of 255')
    for row in range(2):
        pl.subplot(row, column)
        pl.add_mesh(pv.Plane(), texture=pv.Texture(shown[row]), lighting=False)
        pl.add_text(notes[row], font_size=9, color='white' if row else 'black')
        pl.view_xy()
        pl.camera.tight(adjust_render_window=False)
pl.show()
