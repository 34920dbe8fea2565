"""
Shadows on PBR parts
====================

A lamp of some size on metal and plastic: a shadow is sharp where things touch, and softer the
farther it falls.
"""

import numpy as np
import pyvista as pv

import pvibr

SIZE = 540

# %%
# 1. A gear, a spring, a ring and three balls, on a bench; centimetres.
angle = np.linspace(0, 2 * np.pi, 24 * 8, endpoint=False)
radius = 3.2 + 0.35 * np.clip(3 * np.sin(24 * angle), -1, 1)
outline = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
wheel = pv.PolyData(outline, faces=[len(angle), *range(len(angle))]).triangulate()
gear = wheel.extrude((0, 0, 1.0), capping=True)
shaft = pv.Cylinder(center=(0, 0, 1.6), direction=(0, 0, 1), radius=0.8, height=3.2)
turn = np.linspace(0, 14 * np.pi, 500)
spring = pv.Spline(np.stack([np.cos(turn), np.sin(turn), 0.08 * turn], 1), 500).tube(radius=0.15)
ring = pv.ParametricTorus(1.4, 0.3).translate((3.2, -4.2, 0.3))
balls = pv.merge(
    [pv.Sphere(radius=0.7, center=(x, y, 0.7)) for x, y in ((-4, -3), (-2.4, -4.2), (6, -1))]
)

# %%
# 2. As they are in any scene with physically based materials.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE), lighting='none')
pl.background_color = 'dimgray'
steel = {'pbr': True, 'metallic': 0.6, 'roughness': 0.35, 'split_sharp_edges': True}
pl.add_mesh(pv.Plane(i_size=60, j_size=60), color='burlywood', pbr=True, roughness=0.8)
pl.add_mesh(pv.merge([gear, shaft]), color='lightsteelblue', smooth_shading=True, **steel)
pl.add_mesh(spring.translate((5, 2.5, 0.15)), color='silver', smooth_shading=True, **steel)
pl.add_mesh(ring, color='firebrick', smooth_shading=True, pbr=True, roughness=0.5)
pl.add_mesh(balls, color='peru', smooth_shading=True, **steel)

# %%
# 3. A spot light of 1.2 cm radius, and dim light from the eye, which casts no shadow.
lamp = pv.Light(position=(-9, 6, 16), focal_point=(1, -1, 0), light_type='scene light')
lamp.positional, lamp.cone_angle, lamp.intensity = True, 55, 3.5
lamp.exponent = 6
pl.add_light(lamp)
pl.add_light(pv.Light(light_type='headlight', intensity=0.5))
pl.ibr.add(pvibr.Shadows(method='pcss', radius=1.2, taps=64))
pl.camera_position = [(3, -19, 13), (1, -0.5, 0.5), (0, 0, 1)]
pl.camera.view_angle = 34
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
