"""Actors drawn by a shader whose textures are bound as it draws."""

from __future__ import annotations

import weakref

import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl import set_uniforms
from pvibr.gl.binder import Binder
from pvibr.gl.feature import Feature


def observe_shader(mapper, set_shader):
    """Call a method with the program before each draw of a mapper."""
    # The mapper keeps the function, which must not keep the owner: no cycle through C++.
    method = weakref.WeakMethod(set_shader)

    @_vtk.calldata_type(_vtk.VTK_OBJECT)
    def update(_mapper, _event, program):
        alive = method()
        if alive is not None:
            alive(program)

    mapper.AddObserver('UpdateShaderEvent', update)


def draw_actor(mapper, prop=None, feature=None, *, translucent=None):
    """Return an actor that is visible within frames only, without bounds and not picked."""
    actor = pv.Actor()
    actor.SetMapper(mapper)
    if prop is not None:
        actor.SetProperty(prop)
    if translucent is not None:
        (actor.ForceTranslucentOn if translucent else actor.ForceOpaqueOn)()
    actor.VisibilityOff()
    actor.PickableOff()
    actor.UseBoundsOff()
    if feature is not None:
        feature.attach(actor)
    return actor


class ShaderActor:
    """One actor, visible only within frames."""

    def __init__(self):
        self.mapper = _vtk.vtkPolyDataMapper()
        self.mapper.ScalarVisibilityOff()
        self.actor = draw_actor(self.mapper)
        self.failure: str | None = None
        observe_shader(self.mapper, self._set_shader)
        self._feature: Feature | None = None
        self._checked = False
        self._textures: dict = {}
        self._uniforms: dict = {}
        self._binder = Binder()

    def _attach(self, feature):
        """Replace the attached shader text."""
        if self._feature is None or feature.name != self._feature.name:
            if self._feature is not None:
                self._feature.detach(self.actor)
            feature.attach(self.actor)
            self._feature, self._checked = feature, False

    def hide(self):
        """Draw nothing, and give the texture units back."""
        self.actor.VisibilityOff()
        self._binder.unbind()

    def _set_shader(self, program):
        """Bind textures and set uniforms of a program that is about to draw."""
        set_uniforms(program, self._binder.bind(self, self._textures))
        set_uniforms(program, self._uniforms)
        if not self._checked:
            self._checked = True
            if self._feature is not None and not self._feature.landed(program):
                self.failure = f'the shader text {self._feature.name} did not land'

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.hide()
        self._textures = {}
        if window is not None:
            self.actor.ReleaseGraphicsResources(window)
