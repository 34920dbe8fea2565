"""Colours of projected images at points and cells, as data."""

from __future__ import annotations

import numpy as np

from pvibr.maths.camera_views import view_of
from pvibr.maths.draping import blend, border, exposure_gains, sample, weights
from pvibr.visibility import depth_test
from pvibr.visibility.depth_maps import depth_maps
from pvibr.visibility.surface_samples import Samples, bounds_of

_GRAZING = 1e-3  # minimum cosine of surfaces that may face away
_GAIN_POINTS = 20_000  # at which exposures are compared


class SlidePainter:
    """Paints samples of surfaces; the depth of each camera is drawn once."""

    def __init__(self, slides, settings, surfaces, time, side):
        self.slides, self.settings = slides, settings
        self.surfaces, self.time, self.side = surfaces, time, side
        self._gains: np.ndarray | None = None
        self._depths: dict = {}

    def solve_gains(self, mesh):
        """Solve gains on the whole mesh, instead of on each batch of samples."""
        if self.settings.gains == 'auto':
            self._gains = solved_gains(self.slides, self.settings, [mesh], self.surfaces)

    def at(self, samples):
        """Return colours (n, 4) uint8, coverage (n,) bool and the number of pictures (n,)."""
        looks = [_Look(self, slide, samples) for slide in self.slides]
        covers, colors = np.stack([k.cover for k in looks]), np.stack([k.colors for k in looks])
        cosines, texels = np.stack([k.cosine for k in looks]), np.stack([k.texel for k in looks])
        settings = self.settings
        blend_weights = weights(cosines, texels, masks=covers, method=settings.blend)
        if settings.gains == 'auto':
            gains = exposure_gains(colors, covers) if self._gains is None else self._gains
            colors *= gains[:, None]
        blended = np.nan_to_num(blend(colors * settings.gain, blend_weights))
        cover = np.max(covers, axis=0) * (blend_weights.sum(0) > 0)
        blended = np.concatenate([blended, 255 * cover[:, None] * settings.opacity], 1)
        blended = np.rint(np.clip(blended, 0, 255)).astype(np.uint8)
        return blended, cover > 0, np.sum(covers > 0, axis=0)

    def of_tiles(self, mesh):
        """Return a function that paints tiles of a mesh's texture."""

        def paint(tile, _):
            return {'': tile.filled(*self.at(tile.samples(mesh))[:2])}

        return paint

    def depth(self, slide):
        """Return the view of a slide's camera, None if all is behind it, and its depth."""
        if id(slide) not in self._depths:
            map_resolution = slide.side(self.settings.resolution)
            view, depth = view_of(slide.camera(), bounds_of(self.surfaces), map_resolution), None
            if view is not None:
                (depth,) = depth_maps([view], self.surfaces, map_resolution)
            self._depths[id(slide)] = view, depth
        return self._depths[id(slide)]


def solved_gains(slides, settings, meshes, casters) -> np.ndarray:
    """Return the RGB gains of pictures that match exposures in overlaps on meshes, (v, 3)."""
    parts = [Samples.of(m, 'cells') for m in meshes]
    points = np.concatenate([p.points for p in parts])
    normals = np.concatenate([p.normals for p in parts])
    sample_step = -(-len(points) // _GAIN_POINTS) or 1
    samples = Samples.at(points[::sample_step], normals[::sample_step])
    painter = SlidePainter(slides, settings, casters, 0.0, 0)
    looks = [_Look(painter, slide, samples) for slide in slides]
    colors, covers = np.stack([k.colors for k in looks]), np.stack([k.cover for k in looks])
    return exposure_gains(np.nan_to_num(colors), covers)


class _Look:
    """One image at points or cells: coverage, cosine, pixel size, colours."""

    def __init__(self, painter, slide, samples):
        settings, camera, points = painter.settings, slide.camera(), samples.points
        uv, _ = camera.project(points)
        toward = camera.toward(points)
        cosine = samples.facing(toward, painter.side)
        min_cosine = max(float(np.cos(np.radians(settings.max_angle))), 0.0)
        cover = border(uv, settings.feather) * (cosine > min_cosine)
        covered = np.flatnonzero(cover)
        colors = np.full((len(points), 4), np.nan)
        colors[covered] = sample(slide.picture(painter.time, settings), uv[covered])
        cover[covered] *= colors[covered, 3] / 255
        if settings.occlusion and len(covered):
            view, depth = painter.depth(slide)
            if view is not None:
                normals = samples.turned(toward)[covered]
                bias = settings.normal_bias
                cover[covered] *= depth_test.seen(view, depth, points[covered], normals, bias)
        texel_size = np.where(cover > 0, camera.texel(points), np.inf)
        self.cover = samples.most(cover)
        self.cosine = samples.most(np.maximum(cosine, _GRAZING) * (cover > 0))
        self.texel = 1 / np.maximum(samples.most(1 / texel_size), 1e-300)
        self.colors = samples.mean(colors[:, :3], cover)
