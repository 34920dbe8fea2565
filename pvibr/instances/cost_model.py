"""When images of a mesh pay: a cost model of triangles, pixels and instances.

The times are those of the driver, see ``pvibr bench instances``. On a GPU triangles cost far less,
so a bake pays off later.
"""

from __future__ import annotations

import numpy as np

from pvibr.gl.driver import Driver, driver_of

_CARD_PIXELS = 300  # of a card 24 px high: sizes at which images serve most
_BAKE_NS = 3e9  # more for heavy meshes


def why_not_baked(triangles, count) -> str:
    """Return why images of a mesh do not pay, empty if they do."""
    if count < 2:
        return 'it is a single instance'
    driver = driver_of()
    card_ns = driver.card_ns + _CARD_PIXELS * driver.card_pixel_ns
    saved = count * (driver.mesh_ns + triangles * driver.triangle_ns - card_ns)
    if saved * driver.bake_frames >= _BAKE_NS:
        return ''
    return f'{count:,} instances are drawn as fast as their images'


def saved_by_meshes(driver: Driver, triangles, shader, sizes) -> np.ndarray:
    """Return the ns by which a shader's cards cost more than meshes, at sizes in pixels."""
    pixels = np.asarray(sizes, float) ** 2
    triangle_ns = np.asarray(triangles) * driver.multisampled_triangle_ns
    mesh_ns = driver.mesh_ns + triangle_ns + pixels * driver.mesh_square_ns
    square_ns = driver.card_square_ns.get(shader, driver.mesh_square_ns)
    return driver.card_ns + pixels * square_ns - mesh_ns


def negligible_from(driver: Driver, triangles) -> np.ndarray:
    """Return the sizes in pixels from which a mesh's triangles cost less than its pixels."""
    return np.sqrt(np.asarray(triangles) * driver.triangle_ns / driver.mesh_square_ns)
