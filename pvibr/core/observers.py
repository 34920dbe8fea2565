"""Observers that do not keep their owner alive: cycles through C++ are never collected."""

from __future__ import annotations

import weakref

from pvibr.core import _vtk
from pvibr.core.counts import count_draw


def weakly(method):
    """Return an observer that calls a method while its owner lives."""
    method = weakref.WeakMethod(method)
    return lambda *_: (bound := method()) and bound()


def tell_programs(mapper, method):
    """Call a method, while its owner lives, with the program before each draw of a mapper."""
    method = weakref.WeakMethod(method)

    @_vtk.calldata_type(_vtk.VTK_OBJECT)
    def update(_mapper, _event, program):
        bound = method()
        if bound is not None:
            count_draw(program)
            bound(program)

    mapper.AddObserver('UpdateShaderEvent', update)
