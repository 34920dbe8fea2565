"""sRGB transfer functions of colour arrays, and what tone mapping is set to."""

from __future__ import annotations

import numpy as np

#: Linear light that a picture shows in the middle of its greys.
MIDDLE_GREY = 0.18
CURVES = 'faithful', 'reinhard', 'aces', 'agx', 'neutral'


def to_light(colors):
    """Return the linear light of sRGB display values (IEC 61966-2-1), clamped at 0."""
    c = np.maximum(np.asarray(colors, np.float64), 0.0)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def to_display(light):
    """Return the sRGB display values of linear light, clamped at 0; undoes :func:`to_light`."""
    c = np.maximum(np.asarray(light, np.float64), 0.0)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
