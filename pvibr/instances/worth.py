"""Where images of a mesh pay: a cost model of triangles, pixels and instances.

The times are those of llvmpipe on two cores, see ``pvibr bench instances``. On a GPU triangles
cost much less, so that a bake pays there even later.
"""

from __future__ import annotations

import numpy as np

_TRIANGLE = 80.0  # ns, drawn with one sample per pixel
_SAMPLED_TRIANGLE = 300.0  # ns, drawn with PyVista's default of eight, of which llvmpipe has four
_COPY = 500.0  # ns of an instance that is drawn as a mesh, before its triangles
_CARD = 1_300.0  # ns
_PIXEL = 8.0  # ns of a card
_PIXELS = 300  # of a card that is 24 px high: sizes at which images serve most
_BAKE = 3e9  # ns, more of heavy meshes
_FRAMES = 60  # in which a bake must have paid
#: ns of a pixel of the square around what is seen near: of meshes, and of cards by shader.
_MESH_SQUARE, _SQUARE = 20.0, {'parallax': 43.0, 'blended': 100.0, 'fine': 400.0}


def why_not(triangles, count) -> str:
    """Return why images of a mesh do not pay, empty if they do."""
    if count < 2:
        return 'it is a single instance'
    saved = count * (_COPY + triangles * _TRIANGLE - _CARD - _PIXELS * _PIXEL)
    if saved * _FRAMES >= _BAKE:
        return ''
    return f'{count:,} instances are drawn as fast as their images'


def saved_by_meshes(triangles, shader, sizes) -> np.ndarray:
    """Return the ns that cards of a shader cost more than meshes, at sizes in pixels."""
    pixels = np.asarray(sizes, float) ** 2
    mesh = _COPY + np.asarray(triangles) * _SAMPLED_TRIANGLE + pixels * _MESH_SQUARE
    return _CARD + pixels * _SQUARE.get(shader, _MESH_SQUARE) - mesh


def hardly_costs_from(triangles) -> np.ndarray:
    """Return the sizes in pixels from which triangles of meshes cost less than their pixels."""
    return np.sqrt(np.asarray(triangles) * _TRIANGLE / _MESH_SQUARE)
