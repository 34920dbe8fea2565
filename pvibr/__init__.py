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
import sys


def lazy_exports(package, exports):
    """Return ``__getattr__`` and ``__dir__`` of a package whose names are imported when used."""

    def __getattr__(name):
        if name not in exports:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        module = importlib.import_module(exports[name])
        value = module if exports[name] == f'{package}.{name}' else getattr(module, name)
        vars(importlib.import_module(package))[name] = value
        return value

    def __dir__():
        return sorted({*vars(importlib.import_module(package)), *exports})

    return __getattr__, __dir__


#: Effects in the order in which they run, and why there: one line here registers an effect. Things
#: in a scene and users' effects without one of these as a base run before all of them, as added.
EFFECTS = {
    'Ground': 'pvibr.effects.ground',  # a surface: in place before light looks at any
    'Shadows': 'pvibr.shadows.shadows',  # light that reaches surfaces, before any is shaded
    'Projector': 'pvibr.photos.projector',  # photographs are lit and shadowed like surfaces
    'AmbientOcclusion': 'pvibr.effects.ambient_occlusion',  # of surfaces, before what is behind
    'Sky': 'pvibr.effects.backgrounds',  # behind the scene: a lens blurs it, bright parts bloom
    'Backdrop': 'pvibr.effects.backgrounds',  # as the sky
    'Fog': 'pvibr.effects.fog',  # in the air before the lens
    'DepthOfField': 'pvibr.effects.depth_of_field',  # a lens blurs the light of the scene
    'Glow': 'pvibr.effects.glow',  # added after the lens: it stays sharp
    'Afterglow': 'pvibr.effects.glow',  # as glow
    'Bloom': 'pvibr.effects.bloom',  # spreads all that is bright by now, glow included
    'ToneMapping': 'pvibr.effects.tone_mapping',  # the last to see light above 1
    'Outline': 'pvibr.effects.outline',  # lines keep the colour that was asked for
    'ShaderEffect': 'pvibr.effects.shader_effect',  # a user's own, unless it sets `before`
    'ImageOverlay': 'pvibr.effects.screen',  # over the finished picture, in its own colours
    'NightVision': 'pvibr.effects.screen',  # a device looks at all of that
    'Vignette': 'pvibr.effects.screen',  # its lens is darker at the rim
    'Flash': 'pvibr.effects.screen',  # light into that lens
    'Iris': 'pvibr.effects.screen',  # its shutter covers everything
    'Accumulation': 'pvibr.effects.accumulation',  # the mean of what is shown by now
}
_EXPORTS = {
    **EFFECTS,
    '__version__': 'pvibr.core.version',
    'AnimatedActor': 'pvibr.figures.animated_actor',
    'animation': 'pvibr.animation',
    'Atlas': 'pvibr.instances.atlas',
    'attach': 'pvibr.api.plain_renderer',
    'BillboardCloud': 'pvibr.substitutes.billboard_cloud',
    'Billboards': 'pvibr.points.billboards',
    'cluster': 'pvibr.cluster',
    'ClosedError': 'pvibr.core.errors',
    'ThreadError': 'pvibr.core.errors',
    'Crowd': 'pvibr.figures.crowd',
    'Cylinders': 'pvibr.points.cylinders',
    'deterministic': 'pvibr.core.determinism',
    'Effect': 'pvibr.core.effect',
    'Ellipsoids': 'pvibr.points.ellipsoids',
    'Figure': 'pvibr.animation.figure',
    'foliage_levels': 'pvibr.instances.foliage_levels',
    'ImageLayers': 'pvibr.substitutes.image_layers',
    'Impostor': 'pvibr.substitutes.impostor',
    'Instances': 'pvibr.instances.instances',
    'LargeMesh': 'pvibr.large.large_mesh',
    'Lens': 'pvibr.maths.lenses',
    'LensCamera': 'pvibr.maths.lens_camera',
    'LiveTexture': 'pvibr.effects.live_texture',
    'matrices': 'pvibr.meshes.posed',
    'Mirror': 'pvibr.effects.live_texture',
    'Orthographic': 'pvibr.maths.orthographic',
    'silhouette_lines': 'pvibr.visibility.silhouette_lines',
    'Param': 'pvibr.core.params',
    'Photo': 'pvibr.photos.photos',
    'PhotoMesh': 'pvibr.photos.photo_mesh',
    'Photos': 'pvibr.photos.photos',
    'Pinhole': 'pvibr.maths.pinhole',
    'PvibrError': 'pvibr.core.errors',
    'PvibrWarning': 'pvibr.core.errors',
    'read_cameras': 'pvibr.photos.read_cameras',
    'read_city': 'pvibr.io.cities',
    'read_gltf': 'pvibr.animation.read_gltf',
    'read_poses': 'pvibr.meshes.pose_files',
    'read_views': 'pvibr.cluster.stored_views',
    'ShaderError': 'pvibr.core.errors',
    'shadow_mask': 'pvibr.visibility.visibility',
    'shadowed_area': 'pvibr.visibility.visibility',
    'Spheres': 'pvibr.points.spheres',
    'visible': 'pvibr.visibility.visibility',
    'write_cameras': 'pvibr.photos.write_cameras',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)


class _WhenQtIsImported:
    """Adds ``.ibr`` to PyVista's plotters as pyvistaqt is imported.

    Attributes that Qt's classes lack are never looked up by PyVista, which finds it otherwise.
    """

    def find_spec(self, name, _path=None, _target=None):
        """Find nothing itself."""
        if name == 'pyvistaqt':
            sys.meta_path.remove(self)
            importlib.import_module('pvibr.api.plotter_component')


if 'pyvistaqt' in sys.modules:
    importlib.import_module('pvibr.api.plotter_component')
else:
    sys.meta_path.insert(0, _WhenQtIsImported())
