"""The driver: whether a CPU or a GPU draws, and what draws cost there."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from types import MappingProxyType, SimpleNamespace

from pvibr.core.counts import TOTAL
from pvibr.core.determinism import elapsed, is_deterministic

#: Environment variable that overrides what the renderer's name says.
VARIABLE = 'PVIBR_DRIVER'
_SOFTWARE_NAMES = re.compile('llvmpipe|softpipe|swrast|swiftshader|software|basic render', re.I)
# Name of the renderer; a process has one driver, and asking it takes a millisecond.
_names: list[str] = []


@dataclass(frozen=True, eq=False)
class Driver:
    """A kind of driver: the format of light that suits it, and nominal times of draws."""

    kind: str
    #: Format of pictures with light above 1: half floats have four times the steps of bytes.
    light_format: str
    #: Seconds of an actor and of each of its cells, and of a pixel of an impostor's card.
    actor_s: float
    cell_s: float
    pixel_s: float
    #: Nanoseconds of a triangle, at one sample per pixel and at PyVista's default of eight.
    triangle_ns: float
    multisampled_triangle_ns: float
    #: Of an instance drawn as a mesh, without its triangles, and as a card, without its pixels.
    mesh_ns: float
    card_ns: float
    card_pixel_ns: float
    #: Per pixel of the square around what is near: of meshes, and of cards by shader.
    mesh_square_ns: float
    card_square_ns: Mapping[str, float]
    #: Frames within which a bake must have paid off.
    bake_frames: int

    @property
    def is_software(self) -> bool:
        """Whether it draws on the CPU."""
        return self is SOFTWARE

    def expected_seconds(self, cells) -> float:
        """Return the nominal seconds to draw a mesh."""
        return self.actor_s + self.cell_s * cells


# llvmpipe on two cores: at most four samples, and whole floats are sampled faster than halves.
SOFTWARE = Driver(
    kind='software',
    light_format='rgba32f',
    actor_s=5e-5,
    cell_s=7e-8,
    pixel_s=3e-8,
    triangle_ns=80.0,
    multisampled_triangle_ns=300.0,
    mesh_ns=500.0,
    card_ns=1_300.0,
    card_pixel_ns=8.0,
    mesh_square_ns=20.0,
    card_square_ns=MappingProxyType({'parallax': 43.0, 'blended': 100.0, 'fine': 400.0}),
    bake_frames=60,
)
# An NVIDIA H200, which draws like a modest card: actors cost the processor more than the GPU.
HARDWARE = Driver(
    kind='hardware',
    light_format='rgba16f',
    actor_s=3e-5,
    cell_s=1e-9,
    pixel_s=1e-9,
    triangle_ns=1.0,
    multisampled_triangle_ns=1.2,
    mesh_ns=500.0,
    card_ns=30.0,
    card_pixel_ns=0.1,
    mesh_square_ns=0.1,
    card_square_ns=MappingProxyType({'parallax': 0.2, 'blended': 0.5, 'fine': 2.0}),
    bake_frames=600,
)
_KINDS = {driver.kind: driver for driver in (SOFTWARE, HARDWARE)}


def driver_of(window=None) -> Driver:
    """Return the kind of driver; deterministic pictures take the software's choices on any."""
    if is_deterministic():
        return SOFTWARE
    kind = os.environ.get(VARIABLE)
    if kind:
        if kind not in _KINDS:
            raise ValueError(f'{VARIABLE} must be one of {", ".join(_KINDS)}, got {kind!r}')
        return _KINDS[kind]
    return SOFTWARE if _SOFTWARE_NAMES.search(renderer_name(window)) else HARDWARE


def renderer_name(window=None) -> str:
    """Return the driver's name of what renders, as `pvibr doctor` shows it."""
    if not _names:
        if window is None or window.GetNeverRendered():
            from pvibr.gl.hidden_window import hidden_window

            with hidden_window() as (hidden, _renderer):
                _names.append(capabilities_of(hidden).get('renderer', 'unknown'))
        else:
            _names.append(capabilities_of(window).get('renderer', 'unknown'))
    return _names[0]


def capabilities_of(window) -> dict[str, str]:
    """Return what a window's driver calls its vendor, renderer and version."""
    return dict(re.findall(r'OpenGL (\w+) string: *(.*)', window.ReportCapabilities()))


@contextmanager
def timed(window, nominal):
    """Measure the seconds of draws in software; a GPU is not waited for: take the nominal time."""
    measured = SimpleNamespace(seconds=nominal)
    if is_deterministic() or not driver_of(window).is_software:
        yield measured
        return
    TOTAL.waits += 1
    window.WaitForCompletion()
    start = perf_counter()
    yield measured
    window.WaitForCompletion()
    measured.seconds = elapsed(start, nominal)
