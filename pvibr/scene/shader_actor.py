"""An actor that shows pictures by a shader of pvibr's, whose textures are bound as it is drawn."""

from __future__ import annotations

import weakref
from typing import Any

import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl import set_uniforms
from pvibr.gl.binder import Binder


class ShaderActor:
    """One actor, visible only within frames."""

    def __init__(self):
        self.actor = pv.Actor()
        self.mapper = _vtk.vtkPolyDataMapper()
        self.mapper.ScalarVisibilityOff()
        self.actor.SetMapper(self.mapper)
        self.actor.PickableOff()
        self.actor.UseBoundsOff()
        self.actor.VisibilityOff()
        self.failure: str | None = None
        self._observer = self.mapper.AddObserver('UpdateShaderEvent', self._updater())
        self._feature: Any = None
        self._checked = False
        self._textures: dict = {}
        self._uniforms: dict = {}
        self._binder = Binder()

    def _dress(self, feature):
        """Have a shader text, in place of the one before."""
        if self._feature is None or feature.name != self._feature.name:
            if self._feature is not None:
                self._feature.detach(self.actor)
            feature.attach(self.actor)
            self._feature, self._checked = feature, False

    def hide(self):
        """Draw nothing, and give the texture units back."""
        self.actor.VisibilityOff()
        self._binder.unbind()

    def _updater(self):
        # The mapper keeps the function, which must not keep the mapper: no cycle through C++.
        draw = weakref.ref(self)

        @_vtk.calldata_type(_vtk.VTK_OBJECT)
        def update(_mapper, _event, program):
            alive = draw()
            if alive is not None:
                alive._update(program)

        return update

    def _update(self, program):
        set_uniforms(program, self._binder.bind(self, self._textures))
        set_uniforms(program, self._uniforms)
        if not self._checked:
            self._checked = True
            if not self._feature.landed(program):
                self.failure = f'the shader text {self._feature.name} did not land'

    def release(self, window):
        """Free the GPU's memory; the context must be alive."""
        self.hide()
        self._textures = {}
        if window is not None:
            self.actor.ReleaseGraphicsResources(window)
