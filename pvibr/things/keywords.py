"""Keywords of ``add_mesh`` that a thing does not take, and why: one home of the reasons."""

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

_MESH = 'it has no mesh: surfaces are computed for each pixel'
_SHADED = 'surfaces are smooth and normals exact already'
_IMAGE = 'images are drawn as they are; give colors, which multiply them'
_CARDS = 'cards have no edges, points or lines'
_OWN_LOOKS = 'actors keep their own looks: set it on them'

#: Reasons that hold for all things.
_COMMON = {
    'silhouette': 'it adds an actor: add Outline, or add_silhouette of the mesh',
    'show_vertices': 'it adds an actor: add the points as a mesh or as spheres',
    'multi_colors': 'it adds an actor for each block: give colors',
    'remove_existing_actor': 'what has the same name is always replaced',
    'emissive': "it needs the style 'points_gaussian': use add_billboards",
    'point_shape': 'it is a shader of its own: use add_billboards',
    'static': 'data are uploaded once in any case; set them to change them',
    'copy_mesh': 'data are copied in any case',
    # Other names that add_mesh knows.
    'rng': 'its name is clim',
    'colormap': 'its name is cmap',
    'backface_culling': 'its name is culling',
    'rgba': 'its name is rgb',
}
#: Of things whose items have one value each.
_ITEMS = {
    'interpolate_before_map': 'each item has one value',
    'rgb': 'give colors',
    'nan_opacity': 'give opacity, one for each',
    'use_transparency': 'give opacity, one for each',
    'component': 'give scalars of one component',
    'preference': 'points have no cells',
    'user_matrix': 'set user_matrix of what is returned',
    'force_opaque': 'what is drawn first is chosen by opacity',
    'texture': 'it has no texture coordinates: use add_billboards for images',
    'culling': 'there is no back face',
    'backface_params': 'there is no back face',
}
_QUADRICS = {
    **_ITEMS,
    **dict.fromkeys(('style', 'show_edges', 'edge_color', 'edge_opacity'), _MESH),
    **dict.fromkeys(('point_size', 'line_width'), _MESH),
    **dict.fromkeys(('render_points_as_spheres', 'render_lines_as_tubes'), _MESH),
    **dict.fromkeys(('smooth_shading', 'split_sharp_edges'), _SHADED),
}
_BILLBOARDS = {
    **_QUADRICS,
    **dict.fromkeys(('style', 'show_edges', 'edge_color', 'edge_opacity', 'line_width'), _CARDS),
    **dict.fromkeys(('render_points_as_spheres', 'render_lines_as_tubes'), _CARDS),
    **dict.fromkeys(('smooth_shading', 'split_sharp_edges'), 'cards are flat'),
    **dict.fromkeys(('ambient', 'diffuse', 'specular', 'specular_power'), _IMAGE),
    **dict.fromkeys(('pbr', 'metallic', 'roughness', 'color'), _IMAGE),
    'texture': 'give it as the image',
    'point_size': "give size, and size_unit='pixel'",
}
_SUBSTITUTES = dict.fromkeys(signature(pv.Plotter.add_mesh).parameters, _OWN_LOOKS)
_BY_ROOM = {
    'quadrics': _QUADRICS,
    'billboards': _BILLBOARDS,
    'impostors': _SUBSTITUTES,
    'image_layers': _SUBSTITUTES,
}
#: What scalars of a mesh have, and those of its instances have not.
OF_MESH_SCALARS = {
    name: _ITEMS[name]
    for name in ('interpolate_before_map', 'rgb', 'nan_opacity', 'use_transparency', 'component')
}


def reason(make, name) -> str:
    """Return why what makes a thing does not take a keyword of ``add_mesh``, empty if unknown."""
    room = make.__module__.split('.')[1]
    return _BY_ROOM.get(room, {}).get(name) or _COMMON.get(name, '')


def check_keywords(make, names, known=None):
    """Raise a TypeError for keywords that what makes a thing does not take."""
    known = arguments_of(make) if known is None else known
    for name in names:
        if name in known:
            continue
        why = reason(make, name)
        hint = f': {why}' if why else nearest(name, known)
        raise TypeError(f'{make.__name__} has no argument {name!r}{hint}')


_FLAGS = {
    *('bake', 'blend_views', 'flip_scalars', 'force_opaque', 'lighting'),
    *('interpolate_before_map', 'log_scale', 'pbr', 'progress', 'render_lines_as_tubes', 'rgb'),
    *('render_points_as_spheres', 'show_edges', 'smooth_shading', 'split_sharp_edges'),
    'use_transparency',
}
#: Numbers with their bounds, as PyVista has them.
_BETWEEN = {
    **dict.fromkeys(('ambient', 'diffuse', 'specular', 'metallic', 'roughness'), (0.0, 1.0)),
    **dict.fromkeys(('alpha_cutoff', 'edge_opacity', 'nan_opacity'), (0.0, 1.0)),
    **dict.fromkeys(('line_width', 'point_size'), (0.0, 1e6)),
    'specular_power': (0.0, 128.0),
    'feature_angle': (0.0, 360.0),
}
_COLORS = 'above_color', 'below_color', 'edge_color', 'nan_color'


def check_values(given):
    """Raise an error for a keyword of ``add_mesh`` that is no flag, number, color or map."""
    for name, value in given.items():
        if value is None:
            continue
        if name in _FLAGS:
            checked_flag(name, value, optional=True)
        elif name in _BETWEEN:
            checked_number(name, value, *_BETWEEN[name])
        elif name in ('n_colors', 'component') or _is_count(name, value):
            checked_whole(name, value, int(name == 'n_colors'), 1 << 20)
        elif name == 'clim':
            _check_range(value)
        elif name in _COLORS or name in _OTHERS:
            with naming(name, value):
                _OTHERS.get(name, pv.Color)(value)


def _is_count(name, value) -> bool:
    return name == 'categories' and not isinstance(value, bool)


def _check_range(clim):
    ends = [clim] if isinstance(clim, Real) else clim
    with naming('clim', clim):
        for end in ends:
            checked_number('clim', end)
        if len(ends) not in (1, 2):
            raise ValueError('must be two numbers, or one')


def _map(cmap):
    if not isinstance(cmap, pv.LookupTable | list | tuple):
        get_cmap_safe(cmap)
    elif not isinstance(cmap, pv.LookupTable):
        [pv.Color(color) for color in cmap]


def _theme(theme):
    if not isinstance(theme, str | pv.themes.Theme):
        raise TypeError('must be a theme or the name of one')
    pv.Property(theme=theme)  # raises if there is none of the name


def _finite(given):
    return given.dtype.kind in 'biuf' and np.isfinite(given).all()


def _opacity(opacity):
    if isinstance(opacity, str):
        return
    given = as_array('opacity', opacity)
    if given.ndim > 1 or not _finite(given):
        raise TypeError(
            'must be a number from 0 to 1, numbers, or the name of a transfer function'
        )
    if not given.ndim and not 0 <= given <= 1:
        raise ValueError(f'opacity must be a number from 0 to 1, not {opacity!r}')


def _one_of(*allowed):
    def check(value):
        if not isinstance(value, str | bool) or value not in allowed:
            raise ValueError(f'must be one of {", ".join(map(repr, allowed))}')

    return check


def _texture(texture):
    if not isinstance(texture, _vtk.vtkTexture):
        given = as_array('texture', texture)
        image = given.ndim == 2 or (given.ndim == 3 and given.shape[2] in (1, 3, 4))
        if not (given.size and image and _finite(given)):
            raise TypeError(
                'must be a pyvista.Texture or a finite array of shape (h, w) or (h, w, 3 or 4)'
            )


def _back(look):
    _mapping(look)
    if isinstance(look, dict):
        pv.Property(**look)


def _mapping(value):
    if not isinstance(value, dict | pv.Property):
        raise TypeError('must be a dict')


_OTHERS = {
    'annotations': _mapping,
    'backface_params': _back,
    'cmap': _map,
    'culling': _one_of('front', 'back', 'none', False, True),
    'opacity': _opacity,
    'preference': _one_of('point', 'cell'),
    'style': _one_of('surface', 'wireframe', 'points', 'points_gaussian'),
    'texture': _texture,
    'theme': _theme,
    'user_matrix': pv.Transform,
}
