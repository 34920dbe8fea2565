"""Sequences of points that fill a square evenly at any length."""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2b
from math import cos, pi, sin, sqrt

_MASK = 0xFFFFFFFF


def pair(index, name) -> tuple[float, float]:
    """Return point `index` in [0, 1)^2 of the independent Sobol sequence of a name.

    Digits and order are scrambled: Burley, "Practical hash-based Owen scrambling", Journal of
    Computer Graphics Techniques 9, 2020.
    """
    order_seed, x_seed, y_seed = _seeds(name)
    shuffled = _scrambled(index, order_seed)
    x, y = _scrambled(_reversed(shuffled), x_seed), _scrambled(_second(shuffled), y_seed)
    return x / 2**32, y / 2**32


def disk(x, y) -> tuple[float, float]:
    """Map the unit square to the unit disk, preserving areas.

    Shirley and Chiu, "A low distortion map between disk and square", Journal of Graphics Tools 2,
    1997.
    """
    a, b = 2.0 * x - 1.0, 2.0 * y - 1.0
    if a == b == 0:
        return 0.0, 0.0
    if abs(a) > abs(b):
        radius, angle = a, pi / 4 * b / a
    else:
        radius, angle = b, pi / 2 - pi / 4 * a / b
    return radius * cos(angle), radius * sin(angle)


def ball(x, y, z) -> tuple[float, float, float]:
    """Map the unit cube to the unit ball, so that every projection fills a disk evenly.

    By the 4D unit sphere: Shoemake, "Uniform random rotations", Graphics Gems III, 1992.
    """
    r, s = sqrt(1.0 - x), sqrt(x)
    return r * sin(2 * pi * y), r * cos(2 * pi * y), s * sin(2 * pi * z)


def _second(k) -> int:
    """Return the second coordinate of Sobol's k-th point, 32 bits."""
    bits, direction_bits = 0, 1 << 31
    while k:
        if k & 1:
            bits ^= direction_bits
        k >>= 1
        direction_bits ^= direction_bits >> 1
    return bits


def _reversed(k) -> int:
    return int(f'{k:032b}'[::-1], 2)


def _scrambled(k, seed) -> int:
    """Return 32 bits whose digits are permuted by those before them, as Laine and Karras do."""
    k = _reversed(k)
    k ^= k * 0x3D20ADEA & _MASK
    k = k + seed & _MASK
    k = k * (seed >> 16 | 1) & _MASK
    k ^= k * 0x05526C56 & _MASK
    k ^= k * 0x53A22864 & _MASK
    return _reversed(k)


@lru_cache(maxsize=256)
def _seeds(name) -> tuple[int, int, int]:
    digest = blake2b(name.encode(), digest_size=12).digest()
    first, second, third = (int.from_bytes(digest[k : k + 4], 'little') for k in (0, 4, 8))
    return first, second, third
