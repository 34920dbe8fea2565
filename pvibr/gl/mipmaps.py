"""Mip levels and rows of textures, uploaded or copied from a target."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.dilation import Dilation
from pvibr.gl.target import Target, blit
from pvibr.gl.texture import Texture, release


class MipTexture(Texture):
    """An 8-bit texture with mip levels."""

    def __init__(self, window, *, repeat=False):
        super().__init__(window, filter='linear')
        self._vtk_texture = _vtk.vtkOpenGLTexture()
        self._vtk_texture.MipmapOn()
        self._vtk_texture.InterpolateOn()
        # Some drivers' anisotropic filter blurs surfaces that face the eye.
        self._vtk_texture.SetMaximumAnisotropicFiltering(1.0)
        self._vtk_texture.SetRepeat(repeat)
        self._vtk_texture.SetEdgeClamp(not repeat)
        self._renderer = _vtk.vtkRenderer()  # vtkTexture needs one to find its window
        self._renderer.SetRenderWindow(window)
        self._levels: list = []
        self._dilation: Dilation | None = None

    def upload(self, array) -> MipTexture:
        """Upload an array and generate the mip levels."""
        height, width, channels = array.shape
        self._forget_levels()
        image_data = _vtk.vtkImageData()
        image_data.SetDimensions(width, height, 1)
        texels = np.ascontiguousarray(array).reshape(-1, channels)
        image_data.GetPointData().SetScalars(_vtk.numpy_to_vtk(texels, deep=True))
        self._vtk_texture.SetInputData(image_data)
        self._vtk_texture.Render(self._renderer)
        self._vtk_texture.PostRender(self._renderer)
        self.object = self._vtk_texture.GetTextureObject()
        self.object.SetWrapT(self.object.ClampToEdge)
        self.nbytes = array.nbytes * 4 // 3
        return self

    def take(self, source):
        """Copy a target, scaled to this size, and generate the mip levels."""
        self._levels = self._levels or self._create_levels()
        copy(source, self._levels[0])
        for large, small in zip(self._levels, self._levels[1:], strict=False):
            copy(large, small)

    def dilate(self, image=None, *, keep):
        """Replace all levels by those of its own image, or of premultiplied RGBA, dilated.

        `keep` what the computation allocates for the next image.
        """
        dilation = self._dilation or Dilation(self.window, *self.size)
        levels = dilation.levels(image or self, premultiplied=image is not None)
        self._levels = self._levels or self._create_levels()
        for source, level in zip(levels, self._levels, strict=True):
            copy(source, level)
        width, height = self.size
        self.nbytes = width * height * 4 * 4 // 3 + keep * dilation.nbytes
        if not keep:
            release(dilation)
        self._dilation = dilation if keep else None

    def put_level(self, k, array):
        """Replace a smaller mip level by an array."""
        self._levels = self._levels or self._create_levels()
        height, width = array.shape[:2]
        texture = Texture(self.window).upload(array)
        source = Level(self.window, texture.object, 0, width, height)
        copy(source, self._levels[k])
        release(source, texture)

    def _create_levels(self):
        width, height = self.size
        level_count = int(np.log2(max(width, height))) + 1
        return [
            Level(self.window, self.object, k, max(width >> k, 1), max(height >> k, 1))
            for k in range(level_count)
        ]

    def _forget_levels(self):
        release(*self._levels)
        self._levels = []

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._forget_levels()
        release(self._dilation)
        self._dilation = None
        self._vtk_texture.ReleaseGraphicsResources(self.window)
        self.nbytes = 0


class Level:
    """A framebuffer for one mip level of a texture."""

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
    """Copy colours; larger sources are averaged."""
    left, right = (source.width, 0) if turned else (0, source.width)
    source_and_target = (left, 0, right, source.height), (0, 0, target.width, target.height)
    state = source.window.GetState()
    blit(state, source.object, target.object, gl.COLOR_BUFFER_BIT, *source_and_target, gl.LINEAR)


def put_rows(texture, array, row_indices):
    """Replace rows, in ascending order, of a texture by those of an array of its size."""
    height, width = array.shape[:2]
    if 2 * len(row_indices) > height:
        texture.upload(array)
        return
    row_texture = Texture(texture.window).upload(array[row_indices])
    source = Level(texture.window, row_texture.object, 0, width, len(row_indices))
    target = Level(texture.window, texture.object, 0, width, height)
    run_starts = np.flatnonzero(np.diff(row_indices, prepend=-2) != 1).tolist()
    for a, b in pairwise([*run_starts, len(row_indices)]):
        first_row = int(row_indices[a])
        rects = (0, a, width, b), (0, first_row, width, first_row + b - a)
        blit(texture.window.GetState(), source.object, target.object, gl.COLOR_BUFFER_BIT, *rects)
    release(source, target, row_texture)
