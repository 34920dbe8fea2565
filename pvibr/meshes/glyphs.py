"""Glyphs: a mesh at every point of a dataset, turned, scaled and chosen by its arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.errors import warn
from pvibr.core.params import checked_flag
from pvibr.core.spelling import nearest
from pvibr.maths.arguments import check_one_of
from pvibr.maths.transforms import trs
from pvibr.meshes.parts import are_parts
from pvibr.meshes.posed import checked_factor, kept_apart, named, toward

_MODES = 'scale', 'scalar', 'vector'


@dataclass(frozen=True)
class Glyphs:
    """What ``add_instances`` draws of a dataset's glyphs."""

    meshes: list
    poses: np.ndarray
    index: np.ndarray
    scalars: np.ndarray | None
    #: Arrays of the dataset, a value for each glyph, by name.
    arrays: Mapping

    def __repr__(self) -> str:
        return f'<{len(self.poses):,} glyphs of {len(self.meshes)} meshes>'


def glyph(
    dataset,
    orient=True,
    scale=True,
    factor=1.0,
    geom=None,
    indices=None,
    tolerance=None,
    absolute=False,
    clamping=False,
    rng=None,
    color_mode='scale',
    progress_bar=False,
) -> Glyphs:
    """Return the glyphs that ``dataset.glyph`` would make triangles of."""
    if checked_flag('progress_bar', progress_bar):
        raise ValueError(
            'progress_bar is True: no filter runs that would have a progress; leave it out'
        )
    check_one_of('color_mode', color_mode, _MODES)
    factor, span = checked_factor(factor), _checked_range(rng)
    clamping, absolute = checked_flag('clamping', clamping), checked_flag('absolute', absolute)
    meshes = _checked_meshes(geom, indices)
    dataset = dataset.copy(deep=False)
    chooser = dataset.active_scalars  # before there are others, of the sizes
    scaled, turned = _activate(dataset, 'scale', scale), _activate(dataset, 'orient', orient)
    at = _Points(dataset, scaled, turned, tolerance, absolute)
    sizes = at.sizes(scaled, span if clamping else None)
    factors = kept_apart(sizes * factor) if scaled else np.full(len(sizes), factor)
    poses = trs(at.points, scales=factors)
    if turned:
        poses[:, :3, :3] = toward(at.vectors) * factors[:, None, None]
    index = np.zeros(len(poses), int)
    if len(meshes) > 1 and chooser is not None:
        values = at.lengths if chooser.ndim > 1 else at.first
        index = np.trunc((values - span[0]) * len(meshes) / _width(span)).astype(int)
    index = index.clip(0, len(meshes) - 1)
    return Glyphs(meshes, poses, index, at.colors(color_mode, scaled, sizes), at.arrays)


class _Points:
    """Where glyphs are, and the arrays that are active there."""

    def __init__(self, dataset, scaled, turned, tolerance, absolute):
        names = dataset.active_scalars_name, dataset.active_vectors_name
        on_cells = [
            info.association == pv.FieldAssociation.CELL
            for info, used in (
                (dataset.active_scalars_info, scaled),
                (dataset.active_vectors_info, turned),
            )
            if used
        ]
        if len(set(on_cells)) > 1:
            raise ValueError(
                'scale and orient name data of points and of cells; both must be of the same'
            )
        if any(on_cells):
            dataset = dataset.cell_centers()
        if tolerance is not None:
            dataset = _merged(dataset, tolerance, absolute)
        self.points = np.asarray(dataset.points, float)
        self.arrays = dict(dataset.point_data)
        count = dataset.n_points
        found = [dataset.point_data.get(n) for n in names]
        self.name, (self.scalars, self.vectors) = names[0], found
        zeros = np.zeros(count)
        many = self.scalars is not None and self.scalars.ndim > 1
        self.by_length = many and scaled
        self.first = zeros if self.scalars is None else self.scalars.reshape(count, -1)[:, 0]
        spread = self.scalars if self.vectors is None and many else self.vectors
        self.lengths = zeros if spread is None else np.linalg.norm(spread, axis=1)

    def sizes(self, scaled, span) -> np.ndarray:
        """Return the sizes before the factor, mapped to a range if there is one."""
        sizes = np.asarray(self.lengths if self.by_length else self.first, float)
        if self.scalars is None:
            sizes = np.ones(len(self.points))
        bad = np.flatnonzero(~np.isfinite(sizes) & scaled)
        if len(bad):
            raise ValueError(
                f'scale is {self.name!r}: [{bad[0]}] is {sizes[bad[0]]}; it must be finite'
            )
        return sizes if span is None else (sizes.clip(*span) - span[0]) / _width(span)

    def colors(self, mode, scaled, sizes):
        """Return the values that glyphs are coloured by, with their name."""
        if mode == 'vector' and self.vectors is not None:
            return named(self.lengths, 'VectorMagnitude')
        if self.scalars is None:
            return None
        if mode == 'scale':
            return named(sizes, self.name if scaled and not self.by_length else 'GlyphScale')
        several = self.scalars.ndim > 1
        return named(np.linalg.norm(self.scalars, axis=1) if several else self.first, self.name)


def _merged(dataset, tolerance, absolute):
    """Return a dataset of points, those that are close to each other merged."""
    if isinstance(tolerance, bool) or not np.isreal(tolerance) or not 0 <= tolerance < np.inf:
        raise ValueError(f'tolerance is {tolerance!r}; it must be a number of at least 0, or None')
    small = pv.PolyData(dataset.points)
    small.point_data.update(dataset.point_data)
    keep = {f'{name}_to_{to}': False for name, to in _CONVERSIONS}
    return small.clean(point_merging=True, merge_tol=tolerance, absolute=absolute, **keep)


_CONVERSIONS = ('lines', 'points'), ('polys', 'lines'), ('strips', 'polys')
_DEFAULTS = {
    'scale': (pv.set_default_active_scalars, 'scalars', pv.DataSet.set_active_scalars),
    'orient': (pv.set_default_active_vectors, 'vectors', pv.DataSet.set_active_vectors),
}


def _activate(dataset, argument, name) -> bool:
    """Make the array active that an argument names, as ``glyph`` chooses it."""
    by_default, kind, activate = _DEFAULTS[argument]
    if not isinstance(name, str):
        if not checked_flag(argument, name):
            return False
        try:
            by_default(dataset)
        except (pv.MissingDataError, pv.AmbiguousDataError) as error:
            warn(f'{argument} is True: {error} It is set to False; name an array of {kind}.')
            return False
        return True
    if name not in dataset.point_data and name not in dataset.cell_data:
        known = [*dataset.point_data, *dataset.cell_data]
        msg = f'{argument} is {name!r}; the arrays of the dataset are: {known}'
        raise ValueError(msg + nearest(name, known))
    prefer: Literal['cell', 'point'] = 'cell'
    if argument == 'orient':
        of_cells = dataset.active_scalars_info.association == pv.FieldAssociation.CELL
        prefer = 'cell' if of_cells else 'point'
        array = dataset.get_array(name, preference=prefer)
        if array.shape[1:] != (3,):
            raise ValueError(
                f'orient is {name!r}, of shape {array.shape}; it must be vectors, (n, 3)'
            )
    activate(dataset, name, preference=prefer)
    return True


def _checked_meshes(geom, indices) -> list:
    """Return the meshes in the order of their places in the table."""
    if geom is None:
        arrow = _vtk.vtkArrowSource()
        arrow.Update()
        geom = pv.wrap(arrow.GetOutput())
    several = isinstance(geom, list | tuple) and not are_parts(geom)
    meshes = list(geom) if several else [geom]
    if not meshes:
        raise ValueError('geom is empty; give at least one mesh')
    places = np.arange(len(meshes)) if indices is None or len(meshes) == 1 else np.array(indices)
    if not np.array_equal(np.sort(places), np.arange(len(meshes))):
        raise ValueError(
            f'indices is {indices!r}; it must have each of 0 to {len(meshes) - 1} once'
        )
    return [meshes[k] for k in np.argsort(places)]


def _checked_range(rng) -> tuple[float, float]:
    span = np.asarray((0.0, 1.0) if rng is None else rng, float)
    if span.shape != (2,) or not np.isfinite(span).all() or span[0] > span[1]:
        raise ValueError(f'rng is {rng!r}; it must be two finite numbers, the lower one first')
    low, high = span.tolist()
    return low, high


def _width(span) -> float:
    return (span[1] - span[0]) or 1.0
