"""Textures on the GPU."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import enums as gl

_VTK_TYPES = {'uint8': 'VTK_UNSIGNED_CHAR', 'uint16': 'VTK_UNSIGNED_SHORT', 'float32': 'VTK_FLOAT'}
# Render targets: GL's sized format, where VTK does not choose it by the data type, the type,
# channels, and bytes of a texel.
_FORMATS = {
    'rgba8': (None, 'VTK_UNSIGNED_CHAR', 4, 4),
    'rgb8': (None, 'VTK_UNSIGNED_CHAR', 3, 3),
    'rgba16f': (0x881A, 'VTK_FLOAT', 4, 8),
    'rgba32f': (0x8814, 'VTK_FLOAT', 4, 16),
    'rg32f': (0x8230, 'VTK_FLOAT', 2, 8),
    'r32f': (0x822E, 'VTK_FLOAT', 1, 4),
    'r8': (None, 'VTK_UNSIGNED_CHAR', 1, 1),
}
# Passes that allocate textures bind them to whichever unit was used last: let it be the last one
# that core profile 3.2 has for certain. VTK hands out the first ones.
SPARE_UNIT = gl.TEXTURE0 + 47


def texture_limit(window) -> int:
    """Return the widest 2D texture that the driver of a window takes, in texels."""
    return int(_vtk.vtkTextureObject.GetMaximumTextureSize(window))


def texture_units(window) -> int:
    """Return how many textures a fragment shader may sample."""
    found = [0]
    window.GetState().vtkglGetIntegerv(gl.MAX_TEXTURE_IMAGE_UNITS, found)
    return max(found[0], 16)


def release(*owners):
    """Free the GPU memory of owners; None has none."""
    for owner in owners:
        if owner is not None:
            owner.release()


def nbytes_of(*owners) -> int:
    """Return the bytes that owners hold on the GPU; None holds none."""
    return sum(owner.nbytes for owner in owners if owner is not None)


@contextmanager
def filtered(texture, filter='linear'):
    """Sample a texture with a filter within."""
    to = texture.object
    before = to.GetMagnificationFilter(), to.GetMinificationFilter()
    smooth = to.Nearest if filter == 'nearest' else to.Linear
    if before == (smooth, smooth):
        yield
        return
    to.SetMagnificationFilter(smooth)
    to.SetMinificationFilter(smooth)
    try:
        yield
    finally:
        to.SetMagnificationFilter(before[0])
        to.SetMinificationFilter(before[1])


class Texture:
    """A 2D texture: made from an array or empty, sampled by a unit, released with its window."""

    def __init__(self, window, *, filter='nearest', repeat=False, samples=0):
        self.window = window
        self.object = to = _vtk.vtkTextureObject()
        to.SetContext(window)
        to.SetSamples(samples)
        wrap = to.Repeat if repeat else to.ClampToEdge
        to.SetWrapS(wrap)
        to.SetWrapT(wrap)
        smooth = to.Nearest if filter == 'nearest' else to.Linear
        to.SetMagnificationFilter(smooth)
        to.SetMinificationFilter(smooth)
        self.nbytes = 0

    @classmethod
    def of(cls, window, object, *, filter='nearest') -> Texture:
        """Return a texture of VTK's, which VTK frees."""
        found = cls.__new__(cls)
        found.window, found.object, found.nbytes = window, object, 0
        if object.GetSamples() > 1:  # read sample by sample: GL has no filters for them
            return found
        smooth = object.Nearest if filter == 'nearest' else object.Linear
        for wrap in (object.SetWrapS, object.SetWrapT):
            wrap(object.ClampToEdge)
        for scale in (object.SetMagnificationFilter, object.SetMinificationFilter):
            scale(smooth)
        return found

    def upload(self, array) -> Texture:
        """Upload an array of shape (height, width[, channels]), replacing the content."""
        array = np.ascontiguousarray(array)
        height, width = array.shape[:2]
        channels = array.shape[2] if array.ndim == 3 else 1
        limit = texture_limit(self.window)
        if not (0 < width <= limit and 0 < height <= limit):
            raise ValueError(
                f'texture of {width} x {height} texels: each side must be 1 to {limit} here'
            )
        if array.dtype.name not in _VTK_TYPES:
            raise ValueError(
                f'texture of dtype {array.dtype}: must be one of {", ".join(_VTK_TYPES)}'
            )
        kind = getattr(_vtk, _VTK_TYPES[array.dtype.name])
        if not self.object.Create2DFromRaw(width, height, channels, kind, array):
            raise RuntimeError(
                f'the driver refused a texture of {width} x {height} x {channels} {array.dtype}'
            )
        self.nbytes = array.nbytes
        return self

    def allocate(self, width, height, format='rgba8') -> Texture:
        """Allocate an empty texture to draw into."""
        if format == 'depth32f':
            texel, made = 4, self.object.AllocateDepth(width, height, self.object.Float32)
        else:
            internal, kind, channels, texel = _FORMATS[format]
            if internal is not None:
                self.object.SetInternalFormat(internal)
            made = self.object.Create2D(width, height, channels, getattr(_vtk, kind), False)
        if not made:
            raise RuntimeError(f'the driver refused a {format} target of {width} x {height}')
        self.nbytes = width * height * texel * max(self.object.GetSamples(), 1)
        return self

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.object.GetWidth(), self.object.GetHeight()

    @property
    def is_float(self) -> bool:
        """Whether it holds floats, which may be above 1 or NaN."""
        return self.object.GetVTKDataType() == _vtk.VTK_FLOAT

    def compare(self) -> Texture:
        """Let the sampler compare and filter: a ``sampler2DShadow``."""
        to = self.object
        to.SetDepthTextureCompare(True)
        to.SetDepthTextureCompareFunction(to.Lequal)
        for smooth in (to.SetMagnificationFilter, to.SetMinificationFilter):
            smooth(to.Linear)
        return self

    def activate(self) -> int:
        """Bind to a texture unit and return its number, for a sampler."""
        self.object.Activate()
        self.window.GetState().vtkglActiveTexture(SPARE_UNIT)
        return self.object.GetTextureUnit()

    def deactivate(self):
        """Release the texture unit."""
        self.object.Deactivate()

    def download(self) -> np.ndarray:
        """Return the texels as an array (height, width, channels), row 0 at v = 0."""
        # Rows lie close together: windows of Qt have them begin at multiples of four.
        self.window.GetState().vtkglPixelStorei(gl.PACK_ALIGNMENT, 1)
        buffer = self.object.Download()
        kind = self.object.GetVTKDataType()
        width, height, channels = *self.size, self.object.GetComponents()
        dtype = {_vtk.VTK_FLOAT: np.float32, _vtk.VTK_UNSIGNED_CHAR: np.uint8}[kind]
        out = np.empty((height, width, channels), dtype)
        buffer.Download2D(kind, out, (width, height), channels, (0, 0))
        buffer.UnBind()  # else the window's next read-back goes into it
        buffer.ReleaseMemory()
        buffer.UnBind()
        return out

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.object.ReleaseGraphicsResources(self.window)
        self.nbytes = 0
