"""Observers that do not keep their owner alive: cycles through C++ are never collected."""

from __future__ import annotations

import weakref

from pvibr.core import _vtk
from pvibr.core.counts import count_draw


def weakly(method):
    """Return an observer that calls a method while its owner lives."""
    # Not a WeakMethod, whose calls take longer.
    owner, function = weakref.ref(method.__self__), method.__func__
    return lambda *_: None if (living := owner()) is None else function(living)


def tell_programs(mapper, method):
    """Call a method, while its owner lives, with the program before each draw of a mapper."""
    owner, function = weakref.ref(method.__self__), method.__func__

    @_vtk.calldata_type(_vtk.VTK_OBJECT)
    def update(_mapper, _event, program):
        living = owner()
        if living is not None:
            count_draw(program)
            function(living, program)

    mapper.AddObserver('UpdateShaderEvent', update)
