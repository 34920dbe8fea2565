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
    'Atlas': 'pvibr.instances.atlas',
    'Backdrop': 'pvibr.effects.backgrounds',
    'Billboards': 'pvibr.billboards.billboards',
    'BillboardCloud': 'pvibr.billboard_clouds.cloud',
    'Bloom': 'pvibr.effects.bloom',
    'Body': 'pvibr.animation.body',
    'Clip': 'pvibr.animation.clip',
    'ClosedError': 'pvibr.core.errors',
    'Correctives': 'pvibr.animation.correctives',
    'Copy': 'pvibr.animation.constraints',
    'Curve': 'pvibr.animation.curves',
    'Cylinders': 'pvibr.quadrics.cylinders',
    'DepthOfField': 'pvibr.effects.depth_of_field',
    'Effect': 'pvibr.core.effect',
    'Ellipsoids': 'pvibr.quadrics.ellipsoids',
    'Figure': 'pvibr.animation.figure',
    'Crowd': 'pvibr.figures.crowd',
    'FigureActor': 'pvibr.figures.animated_actor',
    'Flash': 'pvibr.effects.screen',
    'FrameRange': 'pvibr.animation.frame_states',
    'FrameStates': 'pvibr.animation.frame_states',
    'Frames': 'pvibr.animation.frames',
    'Glow': 'pvibr.effects.glow',
    'GltfError': 'pvibr.formats.gltf_file',
    'ImageEffect': 'pvibr.effects.own',
    'Impostor': 'pvibr.impostors.impostor',
    'Instances': 'pvibr.instances.instances',
    'Iris': 'pvibr.effects.screen',
    'Layer': 'pvibr.animation.mixer',
    'Layers': 'pvibr.image_layers.image_layers',
    'KeepLimits': 'pvibr.animation.constraints',
    'Limit': 'pvibr.animation.limits',
    'LiveTexture': 'pvibr.projection.live_texture',
    'Mirror': 'pvibr.projection.live_texture',
    'Mixer': 'pvibr.animation.mixer',
    'Morphs': 'pvibr.animation.morphs',
    'NightVision': 'pvibr.effects.screen',
    'Orthographic': 'pvibr.maths.cameras',
    'Outline': 'pvibr.effects.outline',
    'Param': 'pvibr.core.params',
    'Picture': 'pvibr.effects.screen',
    'Pinhole': 'pvibr.maths.cameras',
    'Play': 'pvibr.animation.mixer',
    'Pose': 'pvibr.animation.pose',
    'PoseSpace': 'pvibr.animation.correctives',
    'Projector': 'pvibr.projection.projector',
    'Projectors': 'pvibr.projection.projector',
    'PvibrError': 'pvibr.core.errors',
    'PvibrWarning': 'pvibr.core.errors',
    'Reach': 'pvibr.animation.reach',
    'Rig': 'pvibr.animation.rig',
    'ShaderError': 'pvibr.core.errors',
    'Shadows': 'pvibr.shadows.shadows',
    'Skeleton': 'pvibr.animation.skeleton',
    'Skin': 'pvibr.animation.body',
    'Sky': 'pvibr.effects.backgrounds',
    'Spheres': 'pvibr.quadrics.spheres',
    'StateGraph': 'pvibr.animation.states',
    'Still': 'pvibr.animation.mixer',
    'Synced': 'pvibr.animation.mixer',
    'ToneMapping': 'pvibr.effects.tone_mapping',
    'Track': 'pvibr.animation.clip',
    'Vignette': 'pvibr.effects.screen',
    'attach': 'pvibr.component',
    'deterministic': 'pvibr.core.determinism',
    'joint_mask': 'pvibr.animation.blending',
    'outline': 'pvibr.projection.silhouette_lines',
    'plant_levels': 'pvibr.instances.foliage_levels',
    'read_city': 'pvibr.formats.cities',
    'read_gltf': 'pvibr.animation.gltf.read',
    'read_poses': 'pvibr.meshes.pose_files',
    'shadow_mask': 'pvibr.projection.visibility',
    'shadowed_area': 'pvibr.projection.visibility',
    'visible': 'pvibr.projection.visibility',
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
