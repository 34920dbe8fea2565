"""Keywords of ``add_mesh`` that a thing does not take, and why: one home of the reasons."""

from __future__ import annotations

from inspect import signature

import pyvista as pv

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
    'user_matrix': 'items have places of their own: transform the points',
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
        msg = f'{make.__name__} has no argument {name!r}{hint}'
        raise TypeError(msg)
