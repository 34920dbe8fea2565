"""One material for several actors that have their own: changes of it are theirs."""

from __future__ import annotations

import weakref

from pvibr.core import _vtk
from pvibr.core.observers import weakly

_LOOKS = (
    *('Ambient', 'Diffuse', 'Specular', 'SpecularPower', 'Opacity', 'Interpolation', 'Lighting'),
    *('Metallic', 'Roughness', 'Anisotropy', 'AnisotropyRotation', 'BaseIOR'),
    *('AmbientColor', 'DiffuseColor', 'SpecularColor'),
)
# Faces culled, and what is drawn in place of faces or beside them.
_STYLES = (
    *('BackfaceCulling', 'FrontfaceCulling', 'Representation', 'EdgeVisibility', 'EdgeColor'),
    *('EdgeOpacity', 'LineWidth', 'PointSize', 'RenderPointsAsSpheres', 'RenderLinesAsTubes'),
)
_VALUES = (*_LOOKS, *_STYLES)


class CardMaterial(_vtk.vtkProperty):
    """The material of cards: lit as a property says, but always of filled faces without edges."""

    def __init__(self, prop=None):
        for name in _LOOKS if prop is not None else ():
            getattr(self, f'Set{name}')(getattr(prop, f'Get{name}')())


def _ignored(_material, *_values):
    """Leave the faces of cards as they are."""


for _name in _STYLES:
    setattr(CardMaterial, f'Set{_name}', _ignored)


class SharedMaterial:
    """Sets what changes in a property in others, too."""

    def __init__(self, prop, others):
        self._others = weakref.WeakMethod(others)
        #: How many times others were changed.
        self.changes = 0
        self._was = _values(prop)
        self._watch(prop)

    def _watch(self, prop):
        self._prop = prop
        self._tag = prop.AddObserver('ModifiedEvent', weakly(self._apply))

    def wear(self, prop):
        """Take over another property, all of it."""
        self.stop()
        self._was = {}
        self._watch(prop)
        self._apply()

    def stop(self):
        """Leave others alone."""
        self._prop.RemoveObserver(self._tag)

    def _apply(self):
        others, before, now = self._others(), self._was, _values(self._prop)
        changed = {name: value for name, value in now.items() if before.get(name) != value}
        self._was = now
        if not changed or others is None:
            return
        for other in others():
            for name, value in changed.items():
                getattr(other, f'Set{name}')(value)
        self.changes += 1


def _values(prop) -> dict:
    return {name: getattr(prop, f'Get{name}')() for name in _VALUES}
