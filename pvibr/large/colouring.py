"""How a large mesh is coloured: the look of ``add_mesh``, and values of its vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.meshes.parts import Part, as_parts

#: PyVista's title of scalars without a name.
_UNNAMED = 'Data'
_TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class Values:
    """Scalars of vertices."""

    name: str
    #: Scalars, (v,) float32, or colours, (v, 3 or 4) uint8.
    by_vertex: np.ndarray


@dataclass(frozen=True)
class Coloring:
    """What a large mesh looks like."""

    #: An actor with the look; its mesh is one triangle.
    part: Part
    name: str = ''
    #: Scalars or colours by point of the user's mesh, None for one colour.
    by_point: np.ndarray | None = None

    @classmethod
    def of(cls, source, scalars, look) -> Coloring:
        """Return the colouring of a mesh by scalars, a name, an array or None."""
        if scalars is None and look.get('color') is None:
            scalars = source.active
        if scalars is None:
            if look.get('rgb'):
                raise ValueError('rgb must be with scalars: colours by point, or their name')
            return cls(as_parts(_triangle(), **look)[0])
        name, values = source.values_of(scalars)
        name, is_rgb = name or _UNNAMED, bool(look.get('rgb'))
        if is_rgb != (values.ndim == 2):
            wanted = 'colours of shape (n, 3) or (n, 4)' if is_rgb else 'one number per point'
            remedy = '' if is_rgb else '; colours require rgb=True'
            raise ValueError(f'scalars must be {wanted}, got shape {values.shape}{remedy}')
        if is_rgb:
            values = _as_bytes(values)
        elif look.get('clim') is None:
            look = look | {'clim': _range_of(values)}
        triangle = _triangle()
        triangle.point_data[name] = values[[0, 0, 0]] if len(values) else np.zeros(3)
        return cls(as_parts(triangle, scalars=name, **look)[0], name, values)

    @property
    def has_table(self) -> bool:
        """Whether scalars are looked up in a table of colours."""
        return self.by_point is not None and self.by_point.ndim == 1

    def values_of(self, hierarchy) -> Values | None:
        """Return the values of a hierarchy's vertices."""
        if self.by_point is None:
            return None
        means = hierarchy.averaged(self.by_point)
        if self.has_table:
            return Values(self.name, means[:, 0])
        return Values(self.name, np.rint(np.nan_to_num(means)).astype(np.uint8))


def _triangle() -> pv.PolyData:
    return pv.PolyData.from_regular_faces(_TRIANGLE, np.array([[0, 1, 2]]))


def _as_bytes(colors) -> np.ndarray:
    if colors.dtype == np.uint8:
        return colors
    if not (np.isfinite(colors).all() and colors.min() >= 0 and colors.max() <= 1):
        raise ValueError('scalars must be uint8, or numbers from 0 to 1, with rgb=True')
    return np.rint(255 * colors).astype(np.uint8)


def _range_of(values):
    """Return the range of finite values, None if there are none."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
