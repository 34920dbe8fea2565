"""
An effect of your own
=====================

A few lines of GLSL and a few settings; ``pvibr.ShaderEffect.template`` says what they are given.
"""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

# %%
# 1. The same hills, four times.
hills = examples.load_random_hills().elevation()
pl = pv.Plotter(shape=(2, 2), window_size=(1100, 720), border=False)
for k in range(4):
    pl.subplot(*divmod(k, 2))
    pl.set_background('#9fb4c7')
    pl.add_text(('off', 'the template', 'fog by depth', 'a drawing')[k], color='black')
    pl.add_mesh(hills, cmap='gist_earth', show_scalar_bar=False, smooth_shading=True)
    pl.camera_position = [(-12, -13, 8), (0, 8, 4.5), (0, 0, 1)]

# %%
# 2. At once: a text or a file, here the template, and a value for each setting.
pl.subplot(0, 1)
pl.ibr.add(pvibr.ShaderEffect(pvibr.ShaderEffect.template, amount=0.9, tint=(1.15, 0.95, 0.7)))


# %%
# 3. As a class, with settings that are documented and checked: fog by depth in world units.
class Fog(pvibr.ShaderEffect):
    source = """vec4 effect(vec2 uv) {
      vec4 c = color_at(uv);
      float clear = exp(-max(depth_at(uv) - begin, 0.0) / visibility);
      return vec4(mix(color, c.rgb, clear), c.a);
    }"""
    before = 'Bloom'  # fog dims light before it spreads
    begin = pvibr.Param(14.0, 'Where it begins.', range='[0, inf)', unit='world')
    visibility = pvibr.Param(9.0, 'Where a third is left.', range='(0, inf)', unit='world')
    color = pvibr.Param((0.62, 0.71, 0.78), 'Of the fog.', range='[0, 1]')


pl.subplot(1, 0)
pl.ibr.add(Fog())

# %%
# 4. Normals, which are drawn since the text names them, and an image: a drawing on paper.
pl.subplot(1, 1)
drawing = """vec4 effect(vec2 uv) {
  vec4 c = color_at(uv);
  float rim = id_at(uv) < 0 ? 0.0 : pow(1.0 - abs(normal_at(uv).z), 2.0);
  vec3 sheet = texture(paper, fract(uv * size / (256.0 * scale))).rgb;
  return vec4(mix(vec3(1.0, 0.97, 0.9), vec3(0.1, 0.1, 0.2), rim) * sheet, c.a);
}"""
paper = np.random.default_rng(1).normal(0.9, 0.04, (256, 256)).clip(0, 1)
pl.ibr.add(pvibr.ShaderEffect(drawing, images={'paper': paper}))
pl.show(auto_close=False)
pl.close()
