"""Colours of images at points and cells, as data."""

from __future__ import annotations

import numpy as np

from pvibr.maths import depth_test
from pvibr.maths.draping import blend, border, exposure_gains, sample, weights
from pvibr.projection.depth_maps import depth_maps, view_of
from pvibr.projection.samples import Samples, bounds_of

_GRAZING = 1e-3  # minimum cosine of surfaces that may face away
_GAIN_POINTS = 20_000  # on which exposures are compared


def painted(slides, settings, samples, surfaces, time, side):
    """Return colours (n, 4) uint8, whether any picture shows there, and how many do."""
    looks = [_Look(slide, settings, samples, surfaces, time, side) for slide in slides]
    covers, colors = np.stack([k.cover for k in looks]), np.stack([k.colors for k in looks])
    cosines, texels = np.stack([k.cosine for k in looks]), np.stack([k.texel for k in looks])
    shares = weights(cosines, texels, masks=covers, method=settings.blend)
    if settings.gains == 'auto':
        colors *= exposure_gains(colors, covers)[:, None]
    mixed = np.nan_to_num(blend(colors * settings.gain, shares))
    cover = np.max(covers, axis=0) * (shares.sum(0) > 0)
    mixed = np.concatenate([mixed, 255 * cover[:, None] * settings.opacity], 1)
    mixed = np.rint(np.clip(mixed, 0, 255)).astype(np.uint8)
    return mixed, cover > 0, np.sum(covers > 0, axis=0)


def solved_gains(slides, settings, meshes, casters) -> np.ndarray:
    """Return the gains of each picture that make overlaps on meshes alike, (v, 3)."""
    parts = [Samples.of(m, 'cells') for m in meshes]
    points = np.concatenate([p.points for p in parts])
    normals = np.concatenate([p.normals for p in parts])
    step = -(-len(points) // _GAIN_POINTS) or 1
    samples = Samples.at(points[::step], normals[::step])
    looks = [_Look(slide, settings, samples, casters, 0.0, 0) for slide in slides]
    colors, covers = np.stack([k.colors for k in looks]), np.stack([k.cover for k in looks])
    return exposure_gains(np.nan_to_num(colors), covers)


class _Look:
    """One image at points or cells: coverage, cosine, pixel size, colours."""

    def __init__(self, slide, settings, samples, surfaces, time, side):
        camera, points = slide.camera(), samples.points
        uv, _ = camera.project(points)
        toward = camera.toward(points)
        cosine = samples.facing(toward, side)
        limit = max(float(np.cos(np.radians(settings.max_angle))), 0.0)
        cover = border(uv, settings.feather) * (cosine > limit)
        rows = np.flatnonzero(cover)
        colors = np.full((len(points), 4), np.nan)
        colors[rows] = sample(slide.picture(time, settings), uv[rows])
        cover[rows] *= colors[rows, 3] / 255
        if settings.occlusion and len(rows):
            texels = slide.side(settings.resolution)
            view = view_of(camera, bounds_of(surfaces), texels)
            if view is not None:
                (depth,) = depth_maps([view], surfaces, texels)
                normals = samples.turned(toward)[rows]
                bias = settings.normal_bias
                cover[rows] *= depth_test.seen(view, depth, points[rows], normals, bias)
        texel = np.where(cover > 0, camera.texel(points), np.inf)
        self.cover = samples.most(cover)
        self.cosine = samples.most(np.maximum(cosine, _GRAZING) * (cover > 0))
        self.texel = 1 / np.maximum(samples.most(1 / texel), 1e-300)
        self.colors = samples.mean(colors[:, :3], cover)
