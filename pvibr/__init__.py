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


def lazy_exports(package, exports):
    """Return ``__getattr__`` and ``__dir__`` of a package whose names are imported when used."""

    def __getattr__(name):
        if name not in exports:
            msg = f'module {package!r} has no attribute {name!r}'
            raise AttributeError(msg)
        module = importlib.import_module(exports[name])
        value = module if exports[name] == f'{package}.{name}' else getattr(module, name)
        vars(importlib.import_module(package))[name] = value
        return value

    def __dir__():
        return sorted({*vars(importlib.import_module(package)), *exports})

    return __getattr__, __dir__


_EXPORTS = {
    '__version__': 'pvibr.core.version',
    'Afterglow': 'pvibr.effects.glow',
    'AnimatedActor': 'pvibr.figures.animated_actor',
    'animation': 'pvibr.animation',
    'Atlas': 'pvibr.instances.atlas',
    'attach': 'pvibr.component',
    'Backdrop': 'pvibr.effects.backgrounds',
    'BillboardCloud': 'pvibr.billboard_clouds.cloud',
    'Billboards': 'pvibr.billboards.billboards',
    'Bloom': 'pvibr.effects.bloom',
    'ClosedError': 'pvibr.core.errors',
    'Crowd': 'pvibr.figures.crowd',
    'Cylinders': 'pvibr.quadrics.cylinders',
    'DepthOfField': 'pvibr.effects.depth_of_field',
    'deterministic': 'pvibr.core.determinism',
    'Effect': 'pvibr.core.effect',
    'Ellipsoids': 'pvibr.quadrics.ellipsoids',
    'Figure': 'pvibr.animation.figure',
    'Flash': 'pvibr.effects.screen',
    'foliage_levels': 'pvibr.instances.foliage_levels',
    'Glow': 'pvibr.effects.glow',
    'ImageLayers': 'pvibr.image_layers.image_layers',
    'ImageOverlay': 'pvibr.effects.screen',
    'Impostor': 'pvibr.impostors.impostor',
    'Instances': 'pvibr.instances.instances',
    'Iris': 'pvibr.effects.screen',
    'LiveTexture': 'pvibr.projection.live_texture',
    'Mirror': 'pvibr.projection.live_texture',
    'NightVision': 'pvibr.effects.screen',
    'Orthographic': 'pvibr.maths.cameras',
    'Outline': 'pvibr.effects.outline',
    'silhouette_lines': 'pvibr.projection.silhouette_lines',
    'Param': 'pvibr.core.params',
    'Pinhole': 'pvibr.maths.cameras',
    'Projector': 'pvibr.projection.projector',
    'Projectors': 'pvibr.projection.projector',
    'PvibrError': 'pvibr.core.errors',
    'PvibrWarning': 'pvibr.core.errors',
    'read_city': 'pvibr.formats.cities',
    'read_gltf': 'pvibr.animation.gltf.read',
    'read_poses': 'pvibr.meshes.pose_files',
    'ShaderEffect': 'pvibr.effects.own',
    'ShaderError': 'pvibr.core.errors',
    'shadow_mask': 'pvibr.projection.visibility',
    'shadowed_area': 'pvibr.projection.visibility',
    'Shadows': 'pvibr.shadows.shadows',
    'Sky': 'pvibr.effects.backgrounds',
    'Spheres': 'pvibr.quadrics.spheres',
    'ToneMapping': 'pvibr.effects.tone_mapping',
    'Vignette': 'pvibr.effects.screen',
    'visible': 'pvibr.projection.visibility',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)
