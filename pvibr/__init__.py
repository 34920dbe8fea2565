"""Image-based rendering for PyVista.

Importing it imports nothing else: each name is looked up when first asked for.

Examples
--------
>>> import pvibr
>>> pvibr.Effect.__name__
'Effect'
"""

from __future__ import annotations

import importlib

_EXPORTS = {
    'Afterglow': 'pvibr.effects.glow',
    'Aim': 'pvibr.animation.constraints',
    'Atlas': 'pvibr.actors.atlas',
    'Backdrop': 'pvibr.effects.backgrounds',
    'Billboards': 'pvibr.actors.billboards',
    'BillboardCloud': 'pvibr.clouds',
    'Bloom': 'pvibr.effects.bloom',
    'Body': 'pvibr.animation.body',
    'Clip': 'pvibr.animation.clip',
    'ClosedError': 'pvibr.errors',
    'Correctives': 'pvibr.animation.correctives',
    'Copy': 'pvibr.animation.constraints',
    'Curve': 'pvibr.animation.curves',
    'Cylinders': 'pvibr.actors.cylinders',
    'DepthOfField': 'pvibr.effects.depth_of_field',
    'Effect': 'pvibr.effect',
    'Ellipsoids': 'pvibr.actors.ellipsoids',
    'Figure': 'pvibr.animation.figure',
    'Crowd': 'pvibr.actors.crowd',
    'FigureActor': 'pvibr.actors.figure_actor',
    'Flash': 'pvibr.effects.screen',
    'FrameRange': 'pvibr.animation.frame_states',
    'FrameStates': 'pvibr.animation.frame_states',
    'Frames': 'pvibr.animation.frames',
    'Glow': 'pvibr.effects.glow',
    'GltfError': 'pvibr.animation.gltf_file',
    'ImageEffect': 'pvibr.effects.own',
    'Impostor': 'pvibr.actors.impostor',
    'Instances': 'pvibr.actors.instances',
    'Iris': 'pvibr.effects.screen',
    'Layer': 'pvibr.animation.mixer',
    'Layers': 'pvibr.actors.layers',
    'KeepLimits': 'pvibr.animation.constraints',
    'Limit': 'pvibr.animation.limits',
    'LiveTexture': 'pvibr.effects.live_texture',
    'Mirror': 'pvibr.effects.live_texture',
    'Mixer': 'pvibr.animation.mixer',
    'Morphs': 'pvibr.animation.morphs',
    'NightVision': 'pvibr.effects.screen',
    'Orthographic': 'pvibr.maths.cameras',
    'Outline': 'pvibr.effects.outline',
    'Param': 'pvibr.params',
    'Picture': 'pvibr.effects.screen',
    'Pinhole': 'pvibr.maths.cameras',
    'Play': 'pvibr.animation.mixer',
    'Pose': 'pvibr.animation.pose',
    'PoseSpace': 'pvibr.animation.correctives',
    'Projector': 'pvibr.effects.projector',
    'Projectors': 'pvibr.effects.projector',
    'PvibrError': 'pvibr.errors',
    'PvibrWarning': 'pvibr.errors',
    'Reach': 'pvibr.animation.reach',
    'Rig': 'pvibr.animation.rig',
    'ShaderError': 'pvibr.errors',
    'Shadows': 'pvibr.effects.shadows',
    'Skeleton': 'pvibr.animation.skeleton',
    'Skin': 'pvibr.animation.body',
    'Sky': 'pvibr.effects.backgrounds',
    'Spheres': 'pvibr.actors.spheres',
    'StateGraph': 'pvibr.animation.states',
    'Still': 'pvibr.animation.mixer',
    'Synced': 'pvibr.animation.mixer',
    'ToneMapping': 'pvibr.effects.tone_mapping',
    'Track': 'pvibr.animation.clip',
    'Vignette': 'pvibr.effects.screen',
    'attach': 'pvibr.component',
    'deterministic': 'pvibr.determinism',
    'joint_mask': 'pvibr.animation.blending',
    'outline': 'pvibr.outlines',
    'plant_levels': 'pvibr.actors.scatter_levels',
    'read_city': 'pvibr.actors.cities',
    'read_gltf': 'pvibr.animation.gltf',
    'read_poses': 'pvibr.actors.pose_files',
    'shadow_mask': 'pvibr.visibility',
    'shadowed_area': 'pvibr.visibility',
    'visible': 'pvibr.visibility',
}

__all__ = ['__version__', *_EXPORTS]  # noqa: F822, PLE0604, RUF100


def __getattr__(name):
    if name == '__version__':
        value = importlib.import_module('importlib.metadata').version('pvibr')
    elif name in _EXPORTS:
        value = getattr(importlib.import_module(_EXPORTS[name]), name)
    else:
        msg = f'module {__name__!r} has no attribute {name!r}'
        raise AttributeError(msg)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
