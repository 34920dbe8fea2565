"""Textures on the GPU."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from pvibr.core import _vtk
from pvibr.core.counts import TOTAL
from pvibr.gl import enums as gl

_VTK_TYPES = {
    np.dtype('uint8'): _vtk.VTK_UNSIGNED_CHAR,
    np.dtype('uint16'): _vtk.VTK_UNSIGNED_SHORT,
    np.dtype('float32'): _vtk.VTK_FLOAT,
}
# Render targets: GL's sized format (None if VTK derives it from the type), data type, channels and
# bytes per texel.
_FORMATS = {
    'rgba8': (None, 'VTK_UNSIGNED_CHAR', 4, 4),
    'rgb8': (None, 'VTK_UNSIGNED_CHAR', 3, 3),
    'rgba16f': (0x881A, 'VTK_FLOAT', 4, 8),
    'rgba32f': (0x8814, 'VTK_FLOAT', 4, 16),
    'rg32f': (0x8230, 'VTK_FLOAT', 2, 8),
    'r32f': (0x822E, 'VTK_FLOAT', 1, 4),
    'r8': (None, 'VTK_UNSIGNED_CHAR', 1, 1),
}
_FITS = 1024  # texels a side that core profile 3.2 guarantees
# Passes that allocate textures bind them to the unit used last: make it the last one that core
# profile 3.2 guarantees. VTK hands out the first ones.
SPARE_UNIT = gl.TEXTURE0 + 47
#: Textures that draws have bound by window, in the order of their units: see Binder.
BOUND: WeakKeyDictionary[Any, list] = WeakKeyDictionary()


def texture_limit(window) -> int:
    """Return the largest 2D texture size of a window's driver, in texels."""
    return int(_vtk.vtkTextureObject.GetMaximumTextureSize(window))


def texture_units(window) -> int:
    """Return how many textures a fragment shader may sample."""
    unit_count = [0]
    window.GetState().vtkglGetIntegerv(gl.MAX_TEXTURE_IMAGE_UNITS, unit_count)
    return max(unit_count[0], 16)


def release(*owners):
    """Free the GPU memory of owners; None is skipped."""
    for owner in owners:
        if owner is not None:
            owner.release()


def nbytes_of(*owners) -> int:
    """Return the bytes that owners hold on the GPU; None holds none."""
    return sum(owner.nbytes for owner in owners if owner is not None)


@contextmanager
def filtered(texture, filter='linear'):
    """Sample a texture with a filter within the block."""
    texture_object = texture.object
    old_filters = texture_object.GetMagnificationFilter(), texture_object.GetMinificationFilter()
    gl_filter = texture_object.Nearest if filter == 'nearest' else texture_object.Linear
    if old_filters == (gl_filter, gl_filter):
        yield
        return
    texture_object.SetMagnificationFilter(gl_filter)
    texture_object.SetMinificationFilter(gl_filter)
    try:
        yield
    finally:
        texture_object.SetMagnificationFilter(old_filters[0])
        texture_object.SetMinificationFilter(old_filters[1])


class Texture:
    """A 2D texture: uploaded or allocated, bound to a unit, released with its window."""

    def __init__(self, window, *, filter='nearest', repeat=False, samples=0):
        self.window = window
        self.object = texture_object = _vtk.vtkTextureObject()
        texture_object.SetContext(window)
        texture_object.SetSamples(samples)
        wrap_mode = texture_object.Repeat if repeat else texture_object.ClampToEdge
        texture_object.SetWrapS(wrap_mode)
        texture_object.SetWrapT(wrap_mode)
        gl_filter = texture_object.Nearest if filter == 'nearest' else texture_object.Linear
        texture_object.SetMagnificationFilter(gl_filter)
        texture_object.SetMinificationFilter(gl_filter)
        self.nbytes = 0

    @classmethod
    def of(cls, window, object, *, filter='nearest') -> Texture:
        """Wrap a texture object of VTK's, which VTK frees."""
        texture = cls.__new__(cls)
        texture.window, texture.object, texture.nbytes = window, object, 0
        if object.GetSamples() > 1:  # GL does not filter multisampled textures
            return texture
        gl_filter = object.Nearest if filter == 'nearest' else object.Linear
        for wrap in (object.SetWrapS, object.SetWrapT):
            wrap(object.ClampToEdge)
        for scale in (object.SetMagnificationFilter, object.SetMinificationFilter):
            scale(gl_filter)
        return texture

    def upload(self, array) -> Texture:
        """Upload an array of shape (height, width[, channels]), replacing the content."""
        if not array.flags.c_contiguous:
            array = np.ascontiguousarray(array)
        height, width = array.shape[:2]
        channel_count = array.shape[2] if array.ndim == 3 else 1
        if not (0 < width <= _FITS and 0 < height <= _FITS):
            self._check_size(width, height)
        if array.dtype not in _VTK_TYPES:
            dtypes = ', '.join(map(str, _VTK_TYPES))
            raise ValueError(f'texture dtype must be one of {dtypes}, got {array.dtype}')
        data_type = _VTK_TYPES[array.dtype]
        if not self.object.Create2DFromRaw(width, height, channel_count, data_type, array):
            raise RuntimeError(f'the driver refused a texture of {array.shape} {array.dtype}')
        self.nbytes = array.nbytes
        TOTAL.uploaded_bytes += array.nbytes
        return self

    def _check_size(self, width, height):
        """Raise an error unless the driver has room for an image."""
        size_limit = texture_limit(self.window)
        if not (0 < width <= size_limit and 0 < height <= size_limit):
            raise ValueError(
                f'texture size must be 1 to {size_limit} here, got {width} x {height}'
            )

    def allocate(self, width, height, format='rgba8') -> Texture:
        """Allocate an empty texture to draw into."""
        if format == 'depth32f':
            texel_bytes = 4
            is_allocated = self.object.AllocateDepth(width, height, self.object.Float32)
        else:
            sized_format, data_type, channel_count, texel_bytes = _FORMATS[format]
            if sized_format is not None:
                self.object.SetInternalFormat(sized_format)
            data_type = getattr(_vtk, data_type)
            is_allocated = self.object.Create2D(width, height, channel_count, data_type, False)
        if not is_allocated:
            raise RuntimeError(f'the driver refused a {format} target of {width} x {height}')
        self.nbytes = width * height * texel_bytes * max(self.object.GetSamples(), 1)
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
        """Let samplers compare depth and filter the result: ``sampler2DShadow``."""
        texture_object = self.object
        texture_object.SetDepthTextureCompare(True)
        texture_object.SetDepthTextureCompareFunction(texture_object.Lequal)
        texture_object.SetMagnificationFilter(texture_object.Linear)
        texture_object.SetMinificationFilter(texture_object.Linear)
        return self

    def activate(self) -> int:
        """Bind to a texture unit and return its number for a sampler."""
        self.object.Activate()
        self.window.GetState().vtkglActiveTexture(SPARE_UNIT)
        return self.object.GetTextureUnit()

    def deactivate(self):
        """Release the texture unit."""
        self.object.Deactivate()

    def download(self) -> np.ndarray:
        """Wait for the texels, and return them (height, width, channels), row 0 at v = 0."""
        TOTAL.waits += 1
        return self.fetch().texels()

    def fetch(self) -> PendingTexels:
        """Start a copy of the texels, which the GPU makes when it has drawn them."""
        # Rows are packed; Qt windows align them to four bytes.
        self.window.GetState().vtkglPixelStorei(gl.PACK_ALIGNMENT, 1)
        return PendingTexels(self.object)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.object.ReleaseGraphicsResources(self.window)
        self.nbytes = 0
        # Another one may get its name from GL: see Binder.
        bound = BOUND.get(self.window, [])
        if self in bound:
            bound[bound.index(self)] = None


class PendingTexels:
    """A copy of a texture's texels, on its way from the GPU."""

    def __init__(self, texture_object):
        self._buffer = texture_object.Download()
        if self._buffer.GetReferenceCount() > 1:  # VTK's own, which Python never gives back
            self._buffer.UnRegister(None)
        self._buffer.UnBind()  # else the window's next readback goes into it
        width, height = texture_object.GetWidth(), texture_object.GetHeight()
        self._shape = height, width, texture_object.GetComponents()
        self._data_type = texture_object.GetVTKDataType()

    def texels(self) -> np.ndarray:
        """Return the texels (height, width, channels) once; waits for what is not there yet."""
        height, width, channel_count = self._shape
        dtype = {_vtk.VTK_FLOAT: np.float32, _vtk.VTK_UNSIGNED_CHAR: np.uint8}[self._data_type]
        texels = np.empty(self._shape, dtype)
        self._buffer.Download2D(self._data_type, texels, (width, height), channel_count, (0, 0))
        self.release()
        return texels

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._buffer.UnBind()
        self._buffer.SetContext(None)  # which deletes the buffer of OpenGL
