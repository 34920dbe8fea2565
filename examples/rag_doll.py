"""
A rag doll
==========

A simulator says where its bodies are, and a figure follows. Here a doll falls down some steps.
"""

import mujoco  # pip install 'pvibr[simulate]'
import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. Eight steps, and a doll of capsules that hang on each other by ball joints.
LIMB = """<body pos="{}"><joint type="ball" range="0 {}" damping="1"/>
    <geom type="capsule" fromto="0 0 0 {}" size="{}"/>{}</body>"""
doll = LIMB.format('0 0 .6', 40, '0 0 .15', 0.17, '')
for y in (1, -1):
    hand = LIMB.format(f'0 {0.4 * y} 0', 80, f'0 {0.4 * y} 0', 0.07, '')
    foot = LIMB.format('0 0 -.55', 80, '0 0 -.5', 0.09, '')
    doll += LIMB.format(f'0 {0.25 * y} .35', 80, f'0 {0.35 * y} 0', 0.09, hand)
    doll += LIMB.format(f'0 {0.2 * y} -.2', 60, '0 0 -.5', 0.12, foot)
trunk = '<freejoint/><geom type="capsule" fromto="0 0 -.1 0 0 .35" size=".2"/>'
steps = [f'<geom type="box" pos="{k} 0 {-k / 2 - 5}" size=".5 3 5"/>' for k in range(8)]
world = f'{"".join(steps)}<body pos="-.3 0 1.4">{trunk}{doll}</body>'
model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{world}</worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)


# %%
# 2. Its skin: a surface around all capsules. Vertices follow those that are near.
def pulls(points):
    (radius, half), axis = model.geom_size[8:, :2].T, data.geom_xmat[8:, 2::3]
    away = np.asarray(points)[:, None] - data.geom_xpos[8:]
    along = np.clip((away * axis).sum(-1), -half, half)[..., None] * axis
    pull = np.exp(30 * (radius - np.linalg.norm(away - along, axis=-1)))
    return pull * (pull > 0.02 * pull.max(1, keepdims=True))


space = pv.ImageData(dimensions=(27, 90, 98), spacing=(0.03,) * 3, origin=(-0.7, -1.33, 0))
skin = space.contour([1.0], scalars=pulls(space.points).sum(1)).smooth_taubin()
joints = {'parents': model.body_parentid[1:] - 1, 'weights': pulls(skin.points)}
joints['rest'] = pvibr.animation.Pose(model.body_pos[1:], model.body_quat[1:])
figure = pvibr.Figure.from_arrays(skin.points, skin.regular_faces, **joints)

# %%
# 3. It falls. Every 0.4 seconds a figure stays where the doll is.
data.qvel[:6] = [4.5, 0, 1, 0, 4, 0.5]
pl = pv.Plotter(window_size=(1200, 600))
for color in ('salmon', 'gold', 'yellowgreen', 'lightseagreen', 'skyblue', 'orchid'):
    poses = np.tile(np.eye(4), (model.nbody - 1, 1, 1))
    poses[:, :3] = np.dstack([data.xmat[1:].reshape(-1, 3, 3), data.xpos[1:]])
    pl.ibr.add_animated(figure, color=color, smooth_shading=True).pose = poses
    mujoco.mj_step(model, data, nstep=200)
boxes = [pv.Box((k - 0.5, k + 0.5, -3, 3, -5, -k / 2)) for k in range(8)]
pl.add_mesh(pv.merge(boxes), color='linen')
pl.camera_position = [(8, -14, 6), (3, 0, -0.8), (0, 0, 1)]
pl.show()
