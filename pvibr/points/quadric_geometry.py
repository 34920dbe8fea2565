"""The geometry of quadrics in world space: bounds, texels of shaders, meshes and rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pvibr.points.quadric_cards import Shape, residual_texels
from pvibr.points.quadric_rays import Meeting, meet_cylinders, meet_ellipsoids, meet_spheres
from pvibr.points.unit_meshes import along, balls, linear, tubes
from pvibr.things.placing import is_similar

_FLATTEST = 1e-4  # least semi-axis over the largest, for float precision
_CAPS = {None: 0, 'flat': 1, 'round': 2}


class Geometry(Protocol):
    """What a set of quadrics asks of the geometry of its items."""

    @property
    def shape(self) -> Shape:
        """The shader's type of quadric."""

    def spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centres, shape (n, 3), and radii of bounding spheres; radius 0 is not drawn."""

    def extents(self) -> np.ndarray:
        """Return the half sizes of the bounding boxes, shape (n, 3)."""

    def rows(self, middles) -> np.ndarray:
        """Return the shader's texels, shape (n, t, 4); `middles` are relative to their blocks."""

    def residuals(self, eye, index) -> np.ndarray:
        """Return residuals at the eye, see :func:`residual_texels`."""

    def meet(self, start, direction, index) -> Meeting:
        """Return the intersections of a ray with some items."""

    def bodies(self, prop, indices, colors) -> list:
        """Return meshes of some items: levels, sizes, matrices, and colours or None."""


@dataclass(frozen=True, eq=False)
class SphereGeometry:
    """Spheres: centres (n, 3) and radii (n,)."""

    centers: np.ndarray
    radii: np.ndarray
    shape = Shape('spheres', texels=1, largest_sprite_px=60.0)

    def spheres(self):
        """Return centres and radii."""
        return self.centers, self.radii

    def extents(self):
        """Return the half sizes of the bounding boxes, shape (n, 1)."""
        return self.radii[:, None]

    def rows(self, middles):
        """Return the shader's texels."""
        return np.column_stack([middles, self.radii])[:, None]

    def residuals(self, eye, index):
        """Return residuals at the eye."""
        eye_distance, radii = np.linalg.norm(self.centers[index] - eye, axis=1), self.radii[index]
        return residual_texels((eye_distance - radii) * (eye_distance + radii), radii**2)

    def meet(self, start, direction, index):
        """Return the intersections of a ray with some items."""
        return meet_spheres(start, direction, self.centers[index], self.radii[index])

    def bodies(self, prop, indices, colors):
        """Return meshes of some items."""
        axes = self.radii[indices, None, None] * np.eye(3)
        return [(*balls(prop), linear(self.centers[indices], axes), colors)]


@dataclass(frozen=True, eq=False)
class EllipsoidGeometry:
    """Ellipsoids: centres (n, 3), semi-axes in columns (n, 3, 3), and the largest of each (n,)."""

    centers: np.ndarray
    axes: np.ndarray
    largest: np.ndarray
    shape = Shape('ellipsoids', texels=3, largest_sprite_px=12.0, fill=0.4)

    @classmethod
    def of_turned(cls, centers, radii, turns, linear_map=None):
        """Return the geometry of semi-axes (n, 3) along the columns of turns, transformed."""
        largest = radii.max(1, initial=0.0)
        axes = turns * np.maximum(radii, _FLATTEST * largest[:, None])[:, None]
        if linear_map is not None:
            axes = _moved_axes(linear_map, axes)
            largest = np.linalg.norm(axes, axis=1).max(1, initial=0.0)
        return cls(centers, axes, largest)

    @classmethod
    def of_stretched(cls, centers, radii, linear_map):
        """Return the geometry of spheres of radii (n,) that are transformed by a linear map."""
        (axes,) = _moved_axes(linear_map, np.eye(3)[None])
        largest = radii * np.linalg.norm(axes, axis=0).max()
        return cls(centers, axes * radii[:, None, None], largest)

    def spheres(self):
        """Return centres and the largest semi-axes."""
        return self.centers, self.largest

    @np.errstate(over='ignore')
    def extents(self):
        """Return the half sizes of the bounding boxes."""
        return np.linalg.norm(self.axes, axis=2)

    def rows(self, middles):
        """Return the shader's texels."""
        return np.concatenate([self.axes.swapaxes(1, 2), middles[:, :, None]], 2)

    def residuals(self, eye, index):
        """Return residuals at the eye."""
        axes = self.axes[index]
        with np.errstate(divide='ignore', invalid='ignore'):  # length 0 is not drawn
            scaled_axes = axes / (axes**2).sum(1, keepdims=True)
        scaled = np.einsum('nji,nj->ni', scaled_axes, self.centers[index] - eye)
        scaled_distance = np.linalg.norm(scaled, axis=1)
        return residual_texels((scaled_distance - 1) * (scaled_distance + 1), 1.0)

    def meet(self, start, direction, index):
        """Return the intersections of a ray with some items."""
        return meet_ellipsoids(start, direction, self.centers[index], self.axes[index])

    def bodies(self, prop, indices, colors):
        """Return meshes of some items."""
        return [(*balls(prop), linear(self.centers[indices], self.axes[indices]), colors)]


@dataclass(frozen=True, eq=False)
class CylinderGeometry:
    """Cylinders: two ends (n, 3) each, and radii (n,)."""

    ends: tuple[np.ndarray, np.ndarray]
    radii: np.ndarray
    caps: str | None
    shape: Shape

    @staticmethod
    def shape_of(caps, blend) -> Shape:
        """Return the shader of caps, with colours of both ends that may blend."""
        defines = ('CAPS', _CAPS[caps]), ('BLEND', int(blend))
        return Shape('cylinders', 2, 2, 12.0, 0.4, open=caps is None, defines=defines)

    def _halves(self):
        """Return vectors from the centres to the second ends, half lengths, and directions."""
        halves = (self.ends[1] - self.ends[0]) / 2
        half_lengths = np.linalg.norm(halves, axis=1)
        unit_axes = np.where(half_lengths[:, None] > 0, halves, [0, 0, 1.0])
        unit_axes /= np.where(half_lengths > 0, half_lengths, 1)[:, None]
        return halves, half_lengths, unit_axes

    def spheres(self):
        """Return centres and radii of bounding spheres."""
        _, lengths, _ = self._halves()
        is_drawn = (self.radii > 0) & ((lengths > 0) | (self.caps == 'round'))
        reach = lengths + self.radii if self.caps == 'round' else np.hypot(lengths, self.radii)
        return (self.ends[0] + self.ends[1]) / 2, reach * is_drawn

    def extents(self):
        """Return the half sizes of the bounding boxes."""
        halves, _, units = self._halves()
        disc_extents = 1.0 if self.caps == 'round' else np.sqrt(np.maximum(1 - units**2, 0))
        return np.abs(halves) + self.radii[:, None] * disc_extents

    def rows(self, middles):
        """Return the shader's texels."""
        _, lengths, units = self._halves()
        texels = [np.column_stack([middles, self.radii]), np.column_stack([units, lengths])]
        return np.stack(texels, 1)

    def residuals(self, eye, index):
        """Return residuals at the eye, and heights of both ends."""
        middles, (_, lengths, units) = self.spheres()[0], self._halves()
        offsets, radii = middles[index] - eye, self.radii[index]
        height = np.einsum('ni,ni->n', offsets, units[index])
        axis_distance = np.linalg.norm(offsets - height[:, None] * units[index], axis=1)
        end_heights = height[:, None] + lengths[index, None] * [-1, 1]
        residuals = (axis_distance - radii) * (axis_distance + radii)
        return residual_texels(residuals, radii**2, end_heights)

    def meet(self, start, direction, index):
        """Return the intersections of a ray with some items."""
        middles, halves = self.spheres()[0][index], self._halves()[0][index]
        return meet_cylinders(start, direction, middles, halves, self.radii[index], self.caps)

    def bodies(self, prop, indices, colors):
        """Return meshes of some items; colours are of each, or of both ends, (n, 2, 3)."""
        halves, radii = self._halves()[0][indices], self.radii[indices]
        middles = self.spheres()[0][indices]
        first_colors = second_colors = colors
        levels = tubes(prop, self.caps == 'flat')
        with np.errstate(invalid='ignore'):  # without length there is no tube
            if colors is None or colors.ndim == 2:
                bodies = [(*levels, along(middles, halves, radii), colors)]
            else:
                first_colors, second_colors = np.moveaxis(colors, 1, 0)
                bodies = [
                    (*levels, along(middles + side * halves / 2, halves / 2, radii), end_colors)
                    for side, end_colors in ((-1, first_colors), (1, second_colors))
                ]
        if self.caps == 'round':
            ball_axes = radii[:, None, None] * np.eye(3)
            for ends, end_colors in zip(self.ends, (first_colors, second_colors), strict=True):
                bodies.append((*balls(prop), linear(ends[indices], ball_axes), end_colors))
        return bodies


def _moved_axes(linear_map, axes):
    """Return semi-axes, (n, 3, 3) in columns, of ellipsoids transformed by a matrix."""
    sheared_axes = linear_map @ axes
    if is_similar(linear_map):
        return sheared_axes
    directions, lengths, _ = np.linalg.svd(sheared_axes)
    largest = lengths.max(1, keepdims=True, initial=0.0)
    return directions * np.maximum(lengths, _FLATTEST * largest)[:, None]
