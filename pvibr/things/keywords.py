"""Keywords of ``add_mesh`` that a thing rejects, with the reasons, and checks of their values."""

from __future__ import annotations

from inspect import signature
from numbers import Real

import numpy as np
import pyvista as pv
from pyvista.plotting.colors import get_cmap_safe

from pvibr.core import _vtk
from pvibr.core.arguments import as_array, checked_number, checked_whole, naming
from pvibr.core.params import checked_flag
from pvibr.core.signatures import arguments_of
from pvibr.core.spelling import nearest

_MESH = 'it has no mesh: surfaces are ray-cast per pixel'
_SHADED = 'surfaces are smooth and their normals exact'
_IMAGE = 'images are drawn unlit; give colors, which multiply them'
_CARDS = 'cards have no edges, points or lines'
_OWN_LOOKS = 'actors keep their own looks: set it on the actors'

#: Reasons valid for all things.
_COMMON = {
    'silhouette': 'it adds an actor: use pvibr.Outline, or add_silhouette on the mesh',
    'show_vertices': 'it adds an actor: add the points with add_points or add_spheres',
    'multi_colors': 'it adds an actor per block: give colors',
    'remove_existing_actor': 'an actor of the same name is always replaced',
    'emissive': "it requires style='points_gaussian': use add_billboards",
    'point_shape': 'it requires a special shader: use add_billboards',
    'static': 'data are always uploaded once; assign new values to change them',
    'copy_mesh': 'data are always copied',
    # Aliases that add_mesh accepts.
    'rng': 'use clim',
    'colormap': 'use cmap',
    'backface_culling': 'use culling',
    'rgba': 'use rgb',
}
#: Reasons of things whose items have one value each.
_ITEMS = {
    'interpolate_before_map': 'each item has one value',
    'rgb': 'give colors',
    'use_transparency': 'give one opacity per item',
    'component': 'give scalars with one component',
    'preference': 'items have no cells',
    'user_matrix': 'set user_matrix on the returned handle',
    'force_opaque': 'opacity determines the draw order',
    'texture': 'items have no texture coordinates: use add_billboards for images',
    'culling': 'no back face is visible',
    'backface_params': 'no back face is visible',
}
_STYLES = (
    *('style', 'show_edges', 'edge_color', 'edge_opacity', 'line_width'),
    *('render_points_as_spheres', 'render_lines_as_tubes'),
)
_QUADRICS = {
    **_ITEMS,
    **dict.fromkeys((*_STYLES, 'point_size'), _MESH),
    **dict.fromkeys(('smooth_shading', 'split_sharp_edges'), _SHADED),
}
_BILLBOARDS = {
    **_QUADRICS,
    **dict.fromkeys(_STYLES, _CARDS),
    **dict.fromkeys(('smooth_shading', 'split_sharp_edges'), 'cards are flat'),
    **dict.fromkeys(('ambient', 'diffuse', 'specular', 'specular_power'), _IMAGE),
    **dict.fromkeys(('pbr', 'metallic', 'roughness', 'color'), _IMAGE),
    'texture': 'pass it as image',
    'point_size': "give size, and size_unit='pixel'",
}
_PATCHES = 'a surface is drawn, in simplified triangles'
_LARGE = {
    'style': f"{_PATCHES}, which prop.style = 'wireframe' shows; show_edges shows its own",
    **dict.fromkeys(('point_size', 'render_points_as_spheres'), f'{_PATCHES}: use add_points'),
    'render_lines_as_tubes': f'{_PATCHES}: use line_width for its edges',
    **dict.fromkeys(
        ('split_sharp_edges', 'feature_angle'),
        'points have one normal each; with smooth_shading=False all edges are sharp',
    ),
    'use_transparency': 'give 1 - opacity',
}
_SUBSTITUTES = dict.fromkeys(signature(pv.Plotter.add_mesh).parameters, _OWN_LOOKS)
_BY_FACTORY = {
    **dict.fromkeys(('Spheres', 'Cylinders', 'Ellipsoids'), _QUADRICS),
    'Billboards': _BILLBOARDS,
    'LargeMesh': _LARGE,
    **dict.fromkeys(('Impostor', 'ImageLayers'), _SUBSTITUTES),
}
#: Keywords that apply to the scalars of a mesh, but not to those of its instances.
OF_MESH_SCALARS = {
    name: _ITEMS[name]
    for name in ('interpolate_before_map', 'rgb', 'use_transparency', 'component')
}


def reason(factory, name) -> str:
    """Return why a thing's factory rejects a keyword of ``add_mesh``, empty if unknown."""
    return _BY_FACTORY.get(factory.__name__, {}).get(name) or _COMMON.get(name, '')


def check_keywords(factory, names, allowed=None):
    """Raise a TypeError for keywords that a thing's factory does not accept."""
    allowed = arguments_of(factory) if allowed is None else allowed
    for name in names:
        if name in allowed:
            continue
        explanation = reason(factory, name)
        hint = f': {explanation}' if explanation else nearest(name, allowed)
        raise TypeError(f'{factory.__name__} has no argument {name!r}{hint}')


_FLAGS = {
    *('bake', 'blend_views', 'flip_scalars', 'force_opaque', 'lighting'),
    *('interpolate_before_map', 'log_scale', 'pbr', 'progress', 'render_lines_as_tubes', 'rgb'),
    *('render_points_as_spheres', 'show_edges', 'smooth_shading', 'split_sharp_edges'),
    'use_transparency',
}
#: Bounds of numbers, as in PyVista.
_LIMITS = {
    **dict.fromkeys(('ambient', 'diffuse', 'specular', 'metallic', 'roughness'), (0.0, 1.0)),
    **dict.fromkeys(('alpha_cutoff', 'edge_opacity', 'nan_opacity'), (0.0, 1.0)),
    **dict.fromkeys(('line_width', 'point_size'), (0.0, 1e6)),
    'specular_power': (0.0, 128.0),
    'feature_angle': (0.0, 360.0),
}
_COLORS = 'above_color', 'below_color', 'edge_color', 'nan_color'


def check_values(keywords):
    """Raise an error for an invalid flag, number, colour or map among keywords of ``add_mesh``."""
    for name, value in keywords.items():
        if value is None:
            continue
        if name in _FLAGS:
            checked_flag(name, value, optional=True)
        elif name in _LIMITS:
            checked_number(name, value, *_LIMITS[name])
        elif name in ('n_colors', 'component') or _is_count(name, value):
            checked_whole(name, value, int(name == 'n_colors'), 1 << 20)
        elif name == 'scalars' and isinstance(value, pv.DataObject):
            raise TypeError(f'scalars must be a name or values, got {type(value).__name__}')
        elif name == 'clim':
            _check_range(value)
        elif name in _COLORS or name in _CHECKS:
            with naming(name, value):
                _CHECKS.get(name, pv.Color)(value)


def _is_count(name, value) -> bool:
    return name == 'categories' and not isinstance(value, bool)


def _check_range(clim):
    range_ends = [clim] if isinstance(clim, Real) else clim
    with naming('clim', clim):
        for end in range_ends:
            checked_number('clim', end)
        if len(range_ends) not in (1, 2):
            raise ValueError('must be two numbers, or one')


def _check_cmap(cmap):
    if not isinstance(cmap, pv.LookupTable | list | tuple):
        get_cmap_safe(cmap)
    elif not isinstance(cmap, pv.LookupTable):
        [pv.Color(color) for color in cmap]


def _check_theme(theme):
    if not isinstance(theme, str | pv.themes.Theme):
        raise TypeError('must be a theme or the name of one')
    pv.Property(theme=theme)  # raises for an unknown name


def _is_finite(numbers):
    return numbers.dtype.kind in 'biuf' and np.isfinite(numbers).all()


def _check_opacity(opacity):
    if isinstance(opacity, str):
        return
    opacities = as_array('opacity', opacity)
    if opacities.ndim > 1 or not _is_finite(opacities):
        raise TypeError(
            'must be a number from 0 to 1, numbers, or the name of a transfer function'
        )
    if not opacities.ndim and not 0 <= opacities <= 1:
        raise ValueError(f'opacity must be a number from 0 to 1, got {opacity!r}')


def _one_of(*choices):
    def check(value):
        if not isinstance(value, str | bool) or value not in choices:
            raise ValueError(f'must be one of {", ".join(map(repr, choices))}')

    return check


def _check_texture(texture):
    if not isinstance(texture, _vtk.vtkTexture):
        pixels = as_array('texture', texture)
        is_image = pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] in (1, 3, 4))
        if not (pixels.size and is_image and _is_finite(pixels)):
            raise TypeError(
                'must be a pyvista.Texture or a finite array of shape (h, w) or (h, w, 3 or 4)'
            )


def _backface(params):
    _check_dict(params)
    if isinstance(params, dict):
        pv.Property(**params)


def _check_dict(value):
    if not isinstance(value, dict | pv.Property):
        raise TypeError('must be a dict')


_CHECKS = {
    'annotations': _check_dict,
    'backface_params': _backface,
    'cmap': _check_cmap,
    'culling': _one_of('front', 'back', 'none', False, True),
    'opacity': _check_opacity,
    'preference': _one_of('point', 'cell'),
    'style': _one_of('surface', 'wireframe', 'points', 'points_gaussian'),
    'texture': _check_texture,
    'theme': _check_theme,
    'user_matrix': pv.Transform,
}
