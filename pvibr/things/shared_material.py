"""Copies changes of one material to the materials of several actors."""

from __future__ import annotations

import weakref

from pvibr.core import _vtk
from pvibr.core.observers import weakly

_LOOKS = (
    *('Ambient', 'Diffuse', 'Specular', 'SpecularPower', 'Opacity', 'Interpolation', 'Lighting'),
    *('Metallic', 'Roughness', 'Anisotropy', 'AnisotropyRotation', 'BaseIOR'),
    *('AmbientColor', 'DiffuseColor', 'SpecularColor'),
)
# Culling, and how faces, edges, lines and points are drawn.
_STYLES = (
    *('BackfaceCulling', 'FrontfaceCulling', 'Representation', 'EdgeVisibility', 'EdgeColor'),
    *('EdgeOpacity', 'LineWidth', 'PointSize', 'RenderPointsAsSpheres', 'RenderLinesAsTubes'),
)
_VALUES = (*_LOOKS, *_STYLES)


class CardMaterial(_vtk.vtkProperty):
    """The material of cards: lit like a property, always with filled faces and no edges."""

    def __init__(self, prop=None):
        for name in _LOOKS if prop is not None else ():
            getattr(self, f'Set{name}')(getattr(prop, f'Get{name}')())


def _ignored(_material, *_values):
    """Leave the faces of cards unchanged."""


for _name in _STYLES:
    setattr(CardMaterial, f'Set{_name}', _ignored)


class SharedMaterial:
    """Copies each change of a property to other properties."""

    def __init__(self, prop, others):
        self._others = weakref.WeakMethod(others)
        #: Number of changes made to the others.
        self.changes = 0
        self._last_values = _values(prop)
        self._watch(prop)

    def _watch(self, prop):
        self._prop = prop
        self._tag = prop.AddObserver('ModifiedEvent', weakly(self._apply))

    def wear(self, prop):
        """Switch to another property and copy all of it."""
        self.stop()
        self._last_values = {}
        self._watch(prop)
        self._apply()

    def stop(self):
        """Stop copying changes."""
        self._prop.RemoveObserver(self._tag)

    def _apply(self):
        get_others, values = self._others(), _values(self._prop)
        changes = [(n, v) for n, v in values.items() if self._last_values.get(n) != v]
        self._last_values = values
        if not changes or get_others is None:
            return
        for other in get_others():
            for name, value in changes:
                getattr(other, f'Set{name}')(value)
        self.changes += 1


def _values(prop) -> dict:
    return {name: getattr(prop, f'Get{name}')() for name in _VALUES}
