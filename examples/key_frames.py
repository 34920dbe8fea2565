"""
A jellyfish with two states
===========================

A series of meshes of equal topology holds what its states show: it drifts, or it swims. On the
way between them what was shown goes over into the first mesh of the next state.
"""

import numpy as np
import pyvista as pv

from pvibr import animation as anim

# %%
# 1. A bell with eight arms; its vertices know how far down they are.
u, v = np.meshgrid(np.linspace(0, 1.7, 40), np.linspace(0, 2 * np.pi, 97))
dome = [1.3 * np.sin(u) * np.cos(v), 1.3 * np.sin(u) * np.sin(v), np.cos(u)]
parts = [pv.StructuredGrid(*dome).extract_surface(algorithm=None)]
for angle in np.arange(8) * np.pi / 4:
    top = 0.6 * np.array([np.cos(angle), np.sin(angle), 0.6])
    line = pv.Line(top, top - [0, 0, 3.2], resolution=40)
    line['radius'] = np.linspace(0.09, 0.02, 41)
    parts.append(line.tube(scalars='radius', absolute=True, n_sides=10))
rest = pv.merge(parts).extract_surface(algorithm=None).triangulate().clean()
rest['down'] = down = 1 - rest.points[:, 2]
x, y, z = rest.points.T


def shaped(phase, pulse, wave):  # a pulse of the bell, and a wave that runs down the arms
    turn = 2 * np.pi * phase
    wide = 1 + 0.35 * pulse * np.sin(turn - 0.8 * down) * (down / 1.2).clip(0, 1) ** 2
    sway = wave * np.sin(turn - 1.2 * down) * (down - 0.8).clip(0) / 3
    return np.stack([x * wide + sway, y * wide, z - 0.3 * pulse * np.sin(turn)], 1)


# %%
# 2. Frames 0 to 15 drift, frames 16 to 31 swim. After two seconds it is told to swim.
phases = np.arange(16) / 16
points = [shaped(p, 0.2, 1.2) for p in phases] + [shaped(p, 1.0, 0.3) for p in phases]
states = anim.VertexAnimationStates(
    {'drift': anim.FrameRange(0, 15, fps=8), 'swim': anim.FrameRange(16, 31, fps=16)}, fade=0.5
)
states.go('swim', at=2.0)
frames = anim.VertexAnimation(np.arange(32.0), points, states=states)
figure = anim.Figure([anim.FigureMesh(rest, frames=frames)])

# %%
# 3. Some moments before, on the way and after.
pl = pv.Plotter(window_size=(1200, 400))
for k, time in enumerate([0.4, 1.2, 2.0, 2.25, 2.5, 2.75, 3.0]):
    jelly = pl.ibr.add_animated(figure, scalars='down', cmap='cool', show_scalar_bar=False)
    jelly.pose = figure.sample(time)
    jelly.user_matrix = pv.Transform().translate(3.4 * k, 0, 0).matrix
    pl.add_text(f'{time} s', position=(0.06 + 0.137 * k, 0.88), viewport=True, font_size=9)
pl.camera_position = [(10.2, -18.5, 1.2), (10.2, 0, -0.9), (0, 0, 1)]
sky = pl.ibr.look('studio', ground=False).effects['Sky']
sky.top, sky.horizon, sky.bottom = '#2b6f93', '#0f3a5c', '#061426'
pl.show(auto_close=False)
pl.close()
