"""When images of a mesh pay: a cost model of triangles, pixels and instances.

The times are those of llvmpipe on two cores, see ``pvibr bench instances``. On a GPU triangles
cost far less, so a bake pays off even later.
"""

from __future__ import annotations

import numpy as np

_TRIANGLE_NS = 80.0  # at one sample per pixel
_MULTISAMPLED_TRIANGLE_NS = 300.0  # at PyVista's default of eight samples; llvmpipe has four
_MESH_NS = 500.0  # of an instance drawn as a mesh, without its triangles
_CARD_NS = 1_300.0
_CARD_PIXEL_NS = 8.0
_CARD_PIXELS = 300  # of a card 24 px high: sizes at which images serve most
_BAKE_NS = 3e9  # more for heavy meshes
_BAKE_FRAMES = 60  # within which a bake must have paid off
#: Per pixel of the square around what is near: of meshes, and of cards by shader.
_MESH_SQUARE_NS, _CARD_SQUARE_NS = 20.0, {'parallax': 43.0, 'blended': 100.0, 'fine': 400.0}


def why_not_baked(triangles, count) -> str:
    """Return why images of a mesh do not pay, empty if they do."""
    if count < 2:
        return 'it is a single instance'
    mesh_ns = _MESH_NS + triangles * _TRIANGLE_NS
    saved = count * (mesh_ns - _CARD_NS - _CARD_PIXELS * _CARD_PIXEL_NS)
    if saved * _BAKE_FRAMES >= _BAKE_NS:
        return ''
    return f'{count:,} instances are drawn as fast as their images'


def saved_by_meshes(triangles, shader, sizes) -> np.ndarray:
    """Return the ns by which a shader's cards cost more than meshes, at sizes in pixels."""
    pixels = np.asarray(sizes, float) ** 2
    mesh = _MESH_NS + np.asarray(triangles) * _MULTISAMPLED_TRIANGLE_NS + pixels * _MESH_SQUARE_NS
    return _CARD_NS + pixels * _CARD_SQUARE_NS.get(shader, _MESH_SQUARE_NS) - mesh


def negligible_from(triangles) -> np.ndarray:
    """Return the sizes in pixels from which a mesh's triangles cost less than its pixels."""
    return np.sqrt(np.asarray(triangles) * _TRIANGLE_NS / _MESH_SQUARE_NS)
