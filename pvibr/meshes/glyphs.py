"""Glyphs: a mesh at every point of a dataset, turned, scaled and selected by its arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import check_one_of
from pvibr.core.errors import warn
from pvibr.core.params import checked_flag
from pvibr.core.spelling import nearest
from pvibr.maths.transforms import trs
from pvibr.meshes.parts import are_parts
from pvibr.meshes.posed import checked_factor, named, nonzero_scales, toward

_MODES = 'scale', 'scalar', 'vector'


@dataclass(frozen=True)
class Glyphs:
    """The glyphs of a dataset, for ``add_instances``."""

    meshes: list
    poses: np.ndarray
    index: np.ndarray
    scalars: np.ndarray | None
    #: Arrays of the dataset by name, one value per glyph.
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
    """Return the glyphs of ``dataset.glyph``, as instances rather than triangles."""
    if checked_flag('progress_bar', progress_bar):
        raise ValueError('progress_bar must be False, got True: no filter with a progress runs')
    check_one_of('color_mode', color_mode, _MODES)
    factor, scale_range = checked_factor(factor), _checked_range(rng)
    clamping, absolute = checked_flag('clamping', clamping), checked_flag('absolute', absolute)
    meshes = _checked_meshes(geom, indices)
    dataset = dataset.copy(deep=False)
    index_array = dataset.active_scalars  # before `scale` activates others
    is_scaled, is_turned = _activate(dataset, 'scale', scale), _activate(dataset, 'orient', orient)
    points = _Points(dataset, is_scaled, is_turned, tolerance, absolute)
    sizes = points.sizes(scale_range if clamping else None)
    factors = nonzero_scales(sizes * factor) if is_scaled else np.full(len(sizes), factor)
    poses = trs(points.points, scales=factors)
    if is_turned:
        poses[:, :3, :3] = toward(points.vectors) * factors[:, None, None]
        poses[np.isnan(points.vectors).any(1)] = np.nan  # instances refuse them, or hide them
    index = np.zeros(len(poses), int)
    if len(meshes) > 1 and index_array is not None:
        values = points.lengths if index_array.ndim > 1 else points.first
        places = (values - scale_range[0]) * len(meshes) / _width(scale_range)
        index = np.nan_to_num(places).clip(0, len(meshes) - 1).astype(int)
    return Glyphs(meshes, poses, index, points.colors(color_mode, is_scaled, sizes), points.arrays)


class _Points:
    """The positions of glyphs, and the active arrays there."""

    def __init__(self, dataset, is_scaled, is_turned, tolerance, absolute):
        active_names = dataset.active_scalars_name, dataset.active_vectors_name
        on_cells = [
            info.association == pv.FieldAssociation.CELL
            for info, is_used in (
                (dataset.active_scalars_info, is_scaled),
                (dataset.active_vectors_info, is_turned),
            )
            if is_used
        ]
        if len(set(on_cells)) > 1:
            raise ValueError(
                'scale and orient must both be data of points or of cells, got one of each'
            )
        if any(on_cells):
            dataset = dataset.cell_centers()
        if tolerance is not None:
            dataset = _merged(dataset, tolerance, absolute)
        self.points = np.asarray(dataset.points, float)
        self.arrays = dict(dataset.point_data)
        n_points = dataset.n_points
        active_arrays = [dataset.point_data.get(n) for n in active_names]
        self.name, (self.scalars, self.vectors) = active_names[0], active_arrays
        zeros = np.zeros(n_points)
        is_vector = self.scalars is not None and self.scalars.ndim > 1
        self.by_length = is_vector and is_scaled
        self.first = zeros if self.scalars is None else self.scalars.reshape(n_points, -1)[:, 0]
        length_source = self.scalars if self.vectors is None and is_vector else self.vectors
        self.lengths = zeros if length_source is None else np.linalg.norm(length_source, axis=1)

    def sizes(self, size_range) -> np.ndarray:
        """Return the sizes before the factor, mapped to a range if there is one."""
        sizes = np.asarray(self.lengths if self.by_length else self.first, float)
        if self.scalars is None:
            sizes = np.ones(len(self.points))
        if size_range is None:
            return sizes
        return (sizes.clip(*size_range) - size_range[0]) / _width(size_range)

    def colors(self, mode, is_scaled, sizes):
        """Return the values that colour glyphs, with their name."""
        if mode == 'vector' and self.vectors is not None:
            return named(self.lengths, 'VectorMagnitude')
        if self.scalars is None:
            return None
        if mode == 'scale':
            return named(sizes, self.name if is_scaled and not self.by_length else 'GlyphScale')
        is_vector = self.scalars.ndim > 1
        return named(np.linalg.norm(self.scalars, axis=1) if is_vector else self.first, self.name)


def _merged(dataset, tolerance, absolute):
    """Return the points of a dataset, with close ones merged."""
    if isinstance(tolerance, bool) or not np.isreal(tolerance) or not 0 <= tolerance < np.inf:
        raise ValueError(f'tolerance must be None or a number, at least 0, got {tolerance!r}')
    bare_points = pv.PolyData(dataset.points)
    bare_points.point_data.update(dataset.point_data)
    conversions = {f'{name}_to_{to}': False for name, to in _CONVERSIONS}
    return bare_points.clean(
        point_merging=True, merge_tol=tolerance, absolute=absolute, **conversions
    )


_CONVERSIONS = ('lines', 'points'), ('polys', 'lines'), ('strips', 'polys')
_DEFAULTS = {
    'scale': (pv.set_default_active_scalars, 'scalars', pv.DataSet.set_active_scalars),
    'orient': (pv.set_default_active_vectors, 'vectors', pv.DataSet.set_active_vectors),
}


def _activate(dataset, argument, name) -> bool:
    """Activate the array that an argument selects, as ``glyph`` does; False without one."""
    by_default, kind, activate = _DEFAULTS[argument]
    if not isinstance(name, str):
        if not checked_flag(argument, name):
            return False
        try:
            by_default(dataset)
        except (pv.MissingDataError, pv.AmbiguousDataError) as error:
            warn(f'{argument}=False is used in place of True: {error} Name an array of {kind}.')
            return False
        return True
    if name not in dataset.point_data and name not in dataset.cell_data:
        array_names = [*dataset.point_data, *dataset.cell_data]
        raise ValueError(
            f'{argument} must name an array of the dataset, which are {array_names}, got {name!r}'
            + nearest(name, array_names)
        )
    prefer: Literal['cell', 'point'] = 'cell'
    if argument == 'orient':
        on_cells = dataset.active_scalars_info.association == pv.FieldAssociation.CELL
        prefer = 'cell' if on_cells else 'point'
        array = dataset.get_array(name, preference=prefer)
        if array.shape[1:] != (3,):
            raise ValueError(
                f'orient must be vectors, (n, 3), got {name!r} of shape {array.shape}'
            )
    activate(dataset, name, preference=prefer)
    return True


def _checked_meshes(geom, indices) -> list:
    """Return the meshes in the order of their indices."""
    if geom is None:
        arrow = _vtk.vtkArrowSource()
        arrow.Update()
        geom = pv.wrap(arrow.GetOutput())
    is_list = isinstance(geom, list | tuple) and not are_parts(geom)
    meshes = list(geom) if is_list else [geom]
    if not meshes:
        raise ValueError('geom must hold at least one mesh, got none')
    places = np.arange(len(meshes)) if indices is None or len(meshes) == 1 else np.array(indices)
    if not np.array_equal(np.sort(places), np.arange(len(meshes))):
        raise ValueError(f'indices must hold each of 0 to {len(meshes) - 1} once, got {indices!r}')
    return [meshes[k] for k in np.argsort(places)]


def _checked_range(rng) -> tuple[float, float]:
    span = np.asarray((0.0, 1.0) if rng is None else rng, float)
    if span.shape != (2,) or not np.isfinite(span).all() or span[0] > span[1]:
        raise ValueError(f'rng must be two finite numbers, the lower one first, got {rng!r}')
    low, high = span.tolist()
    return low, high


def _width(span) -> float:
    return (span[1] - span[0]) or 1.0
