"""
A turbofan in section
=====================

Nine hundred blades coloured by temperature in a casing that is cut open: a look and a scalar bar.
"""

import numpy as np
import pyvista as pv

import pvibr

SIZE = 900

# %%
# 1. A row of blades, which turn from hub to tip; a solid of revolution, cut open; metres.
span, around = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 2 * np.pi, 25))


def row(x, hub, tip, count, chord, lean):
    thick = 0.12 * np.sin(around) * (1.2 - 0.6 * span) * np.sqrt(1 - span**8)
    at = chord * (np.cos(around) / 2 + 1j * (thick + 0.1 * np.cos(around) ** 2))
    at = x + at * np.exp(1j * np.radians(lean * (0.55 + 0.6 * span)))
    blade = pv.StructuredGrid(at.real, at.imag, hub + (tip - hub) * span)
    turns = np.arange(count) * 360 / count
    return pv.merge([blade.rotate_x(a) for a in turns]).extract_surface(algorithm=None)


def turned(outline, degrees=235):
    face = pv.PolyData([(r, 0.0, x) for x, r in outline], [len(outline), *range(len(outline))])
    body = face.triangulate().extrude_rotate(resolution=160, angle=degrees, capping=True)
    return body.rotate_z(-50).rotate_y(90).triangulate()


# %%
# 2. The rotor: a fan, ten rows of the compressor, four of the turbine. Around it, two shells.
parts = [row(0.0, 0.3, 1.0, 26, 0.3, 55)]
for k in range(10):
    parts.append(row(0.75 + 0.13 * k, 0.3 + 0.012 * k, 0.62 - 0.02 * k, 44 + 3 * k, 0.085, 48))
parts += [row(2.75 + 0.17 * k, 0.3, 0.5 + 0.035 * k, 60, 0.12, -50) for k in range(4)]
shaft = [(-0.42, 0), (-0.4, 0.06), (-0.2, 0.22), (0.1, 0.3), (0.6, 0.29), (2.0, 0.4), (2.15, 0.44)]
shaft += [(2.45, 0.48), (2.62, 0.42), (2.7, 0.29), (3.4, 0.29), (3.9, 0.0)]
rotor = pv.merge([*parts, turned(shaft, 360)])
at, kelvins = (-0.4, 0.7, 2.0, 2.3, 2.6, 3.4), (290, 330, 800, 1750, 1650, 950)
rotor['Temperature (K)'] = np.interp(rotor.points[:, 0], at, kelvins)
core = [(0.6, 0.66), (2.0, 0.48), (2.4, 0.54), (2.7, 0.54), (3.4, 0.65), (3.4, 0.69), (2.5, 0.6)]
nacelle = [(-0.35, 1.08), (-0.2, 1.03), (2.0, 1.03), (2.0, 1.06), (0.8, 1.2), (-0.2, 1.16)]
shells = pv.merge([turned([*core, (2.0, 0.55), (0.6, 0.7)]), turned(nacelle)])

# %%
# 3. In the studio.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
bar = {'vertical': True, 'position_x': 0.86, 'position_y': 0.3, 'n_labels': 8, 'fmt': '%.0f'}
look = {'smooth_shading': True, 'split_sharp_edges': True, 'specular': 0.35}
pl.add_mesh(rotor, cmap='coolwarm', clim=(300, 1700), scalar_bar_args=bar, **look)
pl.add_mesh(shells, color='#c9ccd1', **look)
pl.camera_position, pl.camera.view_angle = [(-3.2, -5.6, 2.2), (1.6, 0, -0.1), (0, 0, 1)], 26
pl.ibr.look('studio').effects['AmbientOcclusion'].radius = 0.15
pl.ibr.add(pvibr.Accumulation(16))
pl.show()
