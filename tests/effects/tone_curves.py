"""The curves of ``tone_mapping.glsl`` in numpy."""

import numpy as np

from pvibr.maths.tones import to_display, to_light

#: Rec. 709.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_ACES_IN = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
_ACES_OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
_AGX_IN = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
_AGX_OUT = np.array(
    [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ]
)
_AGX_STOPS = (-12.47393, 4.026069)
_AGX_CURVE = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)


def tone_map(colors, curve='faithful', stops=0.0, white=4.0):
    """Return display colours (..., 3), from 0 to 1, as ``ToneMapping`` shows them."""
    colors = np.asarray(colors, np.float64)
    if curve == 'faithful':
        return _faithful(colors if stops == 0 else to_display(to_light(colors) * 2.0**stops))
    light = to_light(colors) * 2.0**stops
    if curve == 'agx':
        return np.clip(_agx(light), 0.0, 1.0)
    mapped = {'reinhard': lambda c: _reinhard(c, white), 'aces': _aces, 'neutral': _neutral}
    return to_display(np.clip(mapped[curve](light), 0.0, 1.0))


def _faithful(c):
    c = np.maximum(c, 0.0)
    peak = np.maximum(c.max(axis=-1, keepdims=True), 1.0)
    # A third of the way to white at twice what a display shows, all the way without end.
    bleach = (peak - 1.0) / (peak + 1.0)
    return c / peak + bleach * (1.0 - c / peak)


def _reinhard(c, white):
    luminance = (c @ LUMINANCE)[..., None]
    return c * (1.0 + luminance / white**2) / (1.0 + luminance)


def _aces(c):
    v = c @ _ACES_IN.T
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return v @ _ACES_OUT.T


def _agx(c):
    low, high = _AGX_STOPS
    stops = np.log2(np.maximum(c @ _AGX_IN.T, 1e-10))
    x = (np.clip(stops, low, high) - low) / (high - low)
    return np.polyval(_AGX_CURVE, x) @ _AGX_OUT.T


def _neutral(c):
    start, desaturation = 0.8 - 0.04, 0.15
    least = c.min(axis=-1, keepdims=True)
    c = c - np.where(least < 0.08, least - 6.25 * least**2, 0.04)
    peak = c.max(axis=-1, keepdims=True)
    room = 1.0 - start
    top = 1.0 - room**2 / np.maximum(peak + room - start, room)
    with np.errstate(divide='ignore', invalid='ignore'):
        scaled = c * (top / peak)
    white = 1.0 - 1.0 / (desaturation * (peak - top) + 1.0)
    return np.where(peak < start, c, scaled + white * (top - scaled))
