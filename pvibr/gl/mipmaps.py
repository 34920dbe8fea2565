"""Levels and rows of textures: uploaded, or copied from a target."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.target import Target, blit
from pvibr.gl.texture import Texture


class MipTexture(Texture):
    """An 8-bit texture with mip levels."""

    def __init__(self, window, *, repeat=False):
        super().__init__(window, filter='linear')
        self._maker = _vtk.vtkOpenGLTexture()
        self._maker.MipmapOn()
        self._maker.InterpolateOn()
        self._maker.SetMaximumAnisotropicFiltering(1.0)  # some drivers' blurs what is not slanted
        self._maker.SetRepeat(repeat)
        self._maker.SetEdgeClamp(not repeat)
        self._renderer = _vtk.vtkRenderer()  # a texture asks for one, for its window's sake
        self._renderer.SetRenderWindow(window)
        self._levels: list = []

    def upload(self, array) -> MipTexture:
        """Upload an array and generate its levels."""
        height, width, channels = array.shape
        self._forget_levels()
        image = _vtk.vtkImageData()
        image.SetDimensions(width, height, 1)
        rows = np.ascontiguousarray(array).reshape(-1, channels)
        image.GetPointData().SetScalars(_vtk.numpy_to_vtk(rows, deep=True))
        self._maker.SetInputData(image)
        self._maker.Render(self._renderer)
        self._maker.PostRender(self._renderer)
        self.object = self._maker.GetTextureObject()
        self.object.SetWrapT(self.object.ClampToEdge)
        self.nbytes = array.nbytes * 4 // 3
        return self

    def take(self, source, *, turned=False):
        """Copy a target, scaled to this size, and generate the levels."""
        self._levels = self._levels or self._made_levels()
        copy(source, self._levels[0], turned=turned)
        for large, small in zip(self._levels, self._levels[1:], strict=False):
            copy(large, small)

    def put_level(self, k, array):
        """Replace a smaller level by an array."""
        self._levels = self._levels or self._made_levels()
        height, width = array.shape[:2]
        texture = Texture(self.window).upload(array)
        source = Level(self.window, texture.object, 0, width, height)
        copy(source, self._levels[k])
        source.release()
        texture.release()

    def _made_levels(self):
        width, height = self.size
        count = int(np.log2(max(width, height))) + 1
        return [
            Level(self.window, self.object, k, max(width >> k, 1), max(height >> k, 1))
            for k in range(count)
        ]

    def _forget_levels(self):
        for level in self._levels:
            level.release()
        self._levels = []

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._forget_levels()
        self._maker.ReleaseGraphicsResources(self.window)
        self.nbytes = 0


class Level:
    """One level of a texture, to be copied from and to."""

    def __init__(self, window, texture, number, width, height):
        self.window, self.width, self.height = window, width, height
        self.object = _vtk.vtkOpenGLFramebufferObject()
        self.object.SetContext(window)
        state = window.GetState()
        state.PushFramebufferBindings()
        self.object.Bind()
        self.object.AddColorAttachment(0, texture, 0, 0, number)
        state.PopFramebufferBindings()

    def release(self):
        """Free the framebuffer; the texture stays."""
        self.object.ReleaseGraphicsResources(self.window)


def copy(source: Target | Level, target: Target | Level, *, turned=False):
    """Copy colours; pixels of a larger picture are averaged."""
    left, right = (source.width, 0) if turned else (0, source.width)
    rects = (left, 0, right, source.height), (0, 0, target.width, target.height)
    state = source.window.GetState()
    blit(state, source.object, target.object, gl.COLOR_BUFFER_BIT, *rects, gl.LINEAR)


def put_rows(texture, array, rows):
    """Replace rising rows of a texture by those of an array that is as large."""
    height, width = array.shape[:2]
    if 2 * len(rows) > height:
        texture.upload(array)
        return
    part = Texture(texture.window).upload(array[rows])
    source = Level(texture.window, part.object, 0, width, len(rows))
    target = Level(texture.window, texture.object, 0, width, height)
    starts = np.flatnonzero(np.diff(rows, prepend=-2) != 1).tolist()
    for a, b in pairwise([*starts, len(rows)]):
        row = int(rows[a])
        rects = (0, a, width, b), (0, row, width, row + b - a)
        state = texture.window.GetState()
        blit(state, source.object, target.object, gl.COLOR_BUFFER_BIT, *rects)
    for level in (source, target):
        level.release()
    part.release()
