"""The quad that shows a layer's warped image with depth."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl import shader_source
from pvibr.gl.binder import Binder
from pvibr.gl.feature import Feature, sections
from pvibr.things.soft_draws import SOLID, SoftDraws


def _feature() -> Feature:
    """Return the shader of a layer by VTK's tags."""
    shader_parts = sections(shader_source(__file__, 'image_layers'))
    return Feature(
        'layer',
        {
            'VTK::PositionVC::Dec': shader_parts['vertex.declare'],
            'VTK::PositionVC::Impl': shader_parts['vertex.position'],
        },
        {
            'VTK::PositionVC::Dec': shader_parts['fragment.declare'],
            'VTK::PositionVC::Impl': shader_parts['fragment.sample'],
            'VTK::Normal::Impl': shader_parts['fragment.normal'],
            'VTK::Depth::Impl': shader_parts['fragment.depth'] + '//VTK::Depth::Impl\n',
            'VTK::Light::Impl': '//VTK::Light::Impl\n' + shader_parts['fragment.light'],
        },
    )


class LayerCard(SoftDraws):
    """A quad for one image at a time."""

    def __init__(self):
        super().__init__(_feature(), prop=pv.Property(lighting=False), binder=Binder())
        self.window: _vtk.vtkRenderWindow | None = None
        self._inputs: tuple[dict, dict] = {}, {}
        self._bounds: tuple | None = None

    def inputs(self) -> tuple[dict, dict]:
        """Return the textures and the uniforms of all parts."""
        return self._inputs

    def show(self, frame, picture, fit, bounds, *, deep):
        """Draw an image in a frame; `deep` writes the depth of soft edges."""
        self.window = frame.window
        bounds = tuple(map(float, bounds))
        if bounds != self._bounds:
            self._bounds = bounds
            self.bound(bounds)
        textures = {'ibr_picture': picture.color, 'ibr_deep': picture.depth}
        self._inputs = textures, _uniforms(frame, picture, fit.warp, fit.turn)
        parts = self.parts(solid=not picture.blends, deep=deep)
        for draws in self.every:
            draws.part = parts.get(draws, SOLID)
            draws.show_spans([(0, 1)] if draws in parts else ())

    def release(self, window):
        """Free GPU memory; the context is current."""
        self._inputs = {}, {}
        super().release(window)


def _uniforms(frame, picture, warp, turn) -> dict:
    x0, y0, x1, y1 = picture.rect
    pixel_from_uv = np.array([[x1 - x0, 0, x0], [0, y1 - y0, y0], [0, 0, 1.0]])
    clip_from_pixel = np.diag([2 / frame.size[0], 2 / frame.size[1], 1.0])
    clip_from_pixel[:2, 2] = -1
    # Homogeneous, so normalized below for float precision.
    clip_from_uv = clip_from_pixel @ warp @ pixel_from_uv
    ndc_from_uv = np.array([[2.0, 0, 0, -1], [0, 2, 0, -1], [0, 0, 2, -1], [0, 0, 0, 1]])
    clip = frame.clip_from_view
    clip_from_depth = clip @ turn @ np.linalg.inv(picture.clip_from_view) @ ndc_from_uv
    depth_rows = np.zeros((4, 4))
    depth_rows[:2] = clip_from_depth[2:] / np.abs(clip_from_depth[3]).max()
    x, y = clip[0, 0], clip[1, 1]
    if frame.parallel:
        scale = 1 / x, 1 / y, 1 / clip[2, 2], 0.0
        shift = -clip[0, 3], -clip[1, 3], -clip[2, 3] / clip[2, 2], 0.0
    else:
        scale, shift = (1 / x, 1 / y, 0.0, -clip[2, 3]), (clip[0, 2], clip[1, 2], 0.0, clip[2, 2])
    return {
        'ibr_clip_from_uv': clip_from_uv / np.abs(clip_from_uv[2]).max(),
        'ibr_depth_from_uv': depth_rows,
        'ibr_crop': tuple(map(float, picture.crop)),
        'ibr_eye_from_clip': tuple(map(float, scale)),
        'ibr_eye_shift': tuple(map(float, shift)),
        'ibr_is_parallel': int(frame.parallel),
    }
