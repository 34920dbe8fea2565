"""Observers that call a method while its owner lives: VTK keeps them, and C++ would keep both."""

from __future__ import annotations

import weakref

from pvibr.core import _vtk


def weakly(method):
    """Return an observer that calls a method while its owner lives."""
    method = weakref.WeakMethod(method)
    return lambda *_: (found := method()) and found()


def tell_programs(mapper, method):
    """Have a method called with the program of each draw of a mapper, while its owner lives."""
    method = weakref.WeakMethod(method)

    @_vtk.calldata_type(_vtk.VTK_OBJECT)
    def update(_mapper, _event, program):
        alive = method()
        if alive is not None:
            alive(program)

    mapper.AddObserver('UpdateShaderEvent', update)
