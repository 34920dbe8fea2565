"""
A converged still
=================

An endgame on a marble board: a lamp of some size, a lens, and occlusion, each sampled 24 times
while the view stands still.
"""

import numpy as np
import pyvista as pv

import pvibr

SIZE = 900

# %%
# 1. Pieces from the lathe: height and radius along their outlines, in squares of the board.
foot = [(0, 0.36), (0.04, 0.38), (0.1, 0.37), (0.14, 0.3), (0.2, 0.28), (0.24, 0.22)]
ball = [(0.13 * (1 - np.cos(a)), 0.17 * np.sin(a)) for a in np.linspace(0.6, np.pi, 12)]
pawn = [*foot, (0.4, 0.13), (0.62, 0.1), (0.64, 0.19), (0.68, 0.19)]
pawn += [(0.66 + 1.3 * h, r) for h, r in ball]
rook = [*foot, (0.4, 0.2), (0.72, 0.17), (0.76, 0.25), (0.98, 0.25), (0.98, 0.16), (0.86, 0.15)]
bishop = [*foot, (0.45, 0.15), (0.85, 0.1), (0.87, 0.2), (0.91, 0.2), (0.93, 0.12), (1.05, 0.17)]
bishop += [(1.2, 0.13), (1.3, 0.05), (1.33, 0.06), (1.37, 0.06), (1.4, 0)]
queen = [*foot, (0.5, 0.17), (1.05, 0.11), (1.07, 0.22), (1.12, 0.22), (1.14, 0.13), (1.4, 0.22)]
queen += [(1.45, 0.22), (1.46, 0.14), (1.5, 0.05), (1.55, 0.06), (1.6, 0)]
king = [*queen[:-4], (1.5, 0.13), (1.54, 0.04), (1.6, 0)]
cross = [(-0.03, 0.03, -0.03, 0.03, 1.58, 1.82), (-0.1, 0.1, -0.03, 0.03, 1.69, 1.75)]


def turned(outline):
    height, radius = np.array([*outline, (outline[-1][0], 0)], float).T
    line = np.column_stack([radius, 0 * radius, height])
    fine = pv.lines_from_points(line).extrude_rotate(resolution=72, capping=False)
    return fine.triangulate().clean()


meshes = {'P': pawn, 'R': rook, 'B': bishop, 'Q': queen, 'K': king}
meshes = {name: turned(outline) for name, outline in meshes.items()}
meshes['K'] = pv.merge([meshes['K'], *map(pv.Box, cross)])

# %%
# 2. Who stands where, and the board.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
shine = {'smooth_shading': True, 'split_sharp_edges': True, 'specular': 0.6, 'specular_power': 40}
for color, men in (('#efe3c8', 'Kg1 Qd3 Rf1 Pf2 Pg2 Ph3 Bc4'), ('#4a2a1d', 'Kg8 Qf5 Rd8 Pf7 Pg7')):
    for piece, file, rank in men.split():
        place = 'abcdefgh'.index(file) - 3.5, int(rank) - 4.5, 0
        pl.add_mesh(meshes[piece].translate(place), color=color, **shine)
for k, color in enumerate(('#7d5a44', '#d9c6a5')):
    squares = [(i - 3.5, j - 3.5, 0) for i, j in np.ndindex(8, 8) if (i + j) % 2 == k]
    pl.add_mesh(pv.merge([pv.Plane(center=place) for place in squares]), color=color)
pl.add_mesh(pv.Box((-4.5, 4.5, -4.5, 4.5, -0.31, -0.01)), color='#5a3a2b')
pl.camera_position = [(-3.6, -7.6, 2.6), (0.75, -0.6, 0.3), (0, 0, 1)]
pl.camera.view_angle = 34
pl.ibr.look('studio')
pl.ibr.add(pvibr.DepthOfField((0.6, -1.2, 0.5), f_number=3.5))
pl.ibr.add(pvibr.Accumulation(24))
pl.show(auto_close=False)
pl.close()
