"""Uniforms of programs and of actors' shaders, set by value type."""

from __future__ import annotations

from itertools import chain, repeat

import numpy as np

from pvibr.core.counts import TOTAL

_VECTORS = {2: 'SetUniform2f', 3: 'SetUniform3f', 4: 'SetUniform4f'}
_IMMUTABLE = {float, int, bool, tuple}
_MATRICES = {(3, 3): 'SetUniformMatrix3x3', (4, 4): 'SetUniformMatrix4x4'}


def set_uniforms(program, uniforms):
    """Set a program's numbers, vectors, matrices, mat4[n] of (n, 4, 4) and float[n] of (n, 1).

    What it holds already is skipped: most values persist from frame to frame, and each call costs.
    """
    _set_changed(program, _held_by(program), uniforms)


def set_shared_uniforms(program, *groups):
    """Set uniforms of each of some dicts, with no name in common, that never change in place.

    Dicts are skipped that the program was given last in their position, and values by their name.
    """
    try:
        held = program.ibr_held
    except AttributeError:
        held = _held_by(program)
    objects = held.objects
    for group, last_group in zip(groups, chain(held.groups, repeat(None)), strict=False):
        if group is not last_group:
            changed = {
                name: value
                for name, value in group.items()
                if name not in objects or objects[name] is not value
            }
            if changed:
                held.objects = objects = objects | changed
                _set_changed(program, held, changed)
    held.groups = groups


def _set_changed(program, held, uniforms):
    """Set the values that a program uses and does not hold."""
    held_values = held.values
    for name, value in uniforms.items():
        if name in held.unused:
            continue
        if type(value) is list:
            value = tuple(value)
        # Arrays may be changed in place.
        held_value = value if type(value) in _IMMUTABLE else value.tobytes()
        if name in held_values:
            if held_values[name] == held_value:
                continue
        elif not program.IsUniformUsed(name):
            held.unused.add(name)
            continue
        held_values[name] = held_value
        TOTAL.uniforms += 1
        if type(value) is float:  # most are
            program.SetUniformf(name, value)
        elif type(value) is tuple:
            getattr(program, _VECTORS[len(value)])(name, value)
        else:
            setter, *values = _setter(value)
            getattr(program, setter)(name, *values)


class _Held:
    """What a program holds: each uniform's value, and the objects and dicts that were set last."""

    def __init__(self):
        self.values: dict = {}
        self.objects: dict = {}
        #: Names that occur nowhere in the program.
        self.unused: set[str] = set()
        self.groups: tuple = ()


def _held_by(program) -> _Held:
    """Return what a program holds; it is gone with the program.

    VTK keeps an object's attributes while its C++ lives, also when nothing in Python refers to it.
    """
    if not hasattr(program, 'ibr_held'):
        program.ibr_held = _Held()
    return program.ibr_held


def set_fragment_uniforms(actors, uniforms):
    """Set custom uniforms of actors' fragment shaders, as :func:`set_uniforms` does."""
    _set_all([a.GetShaderProperty().GetFragmentCustomUniforms() for a in actors], uniforms)


def set_vertex_uniforms(actors, uniforms):
    """Set custom uniforms of actors' vertex shaders, as :func:`set_uniforms` does."""
    _set_all([a.GetShaderProperty().GetVertexCustomUniforms() for a in actors], uniforms)


def _set_all(targets, uniforms):
    setter_calls = [(name, *_setter(value)) for name, value in uniforms.items()]
    for target in targets:
        for name, setter, *values in setter_calls:
            getattr(target, setter)(name, *values)


def _setter(value) -> tuple:
    """Return the name of the setter of a value, and its arguments after the uniform's name."""
    if isinstance(value, np.ndarray):
        return _array_setter(value)
    if isinstance(value, (tuple, list)):
        return _VECTORS[len(value)], [float(v) for v in value]
    if isinstance(value, (int, np.integer)):
        return 'SetUniformi', int(value)
    return 'SetUniformf', float(value)


def _array_setter(value) -> tuple:
    if value.ndim == 1:
        return _VECTORS[len(value)], value.tolist()
    column_major = value.swapaxes(-1, -2).ravel().tolist()  # OpenGL stores matrices by columns
    if value.ndim == 3:
        return 'SetUniformMatrix4x4v', len(value), column_major
    if value.shape[1] == 1:
        return 'SetUniform1fv', len(value), column_major
    return _MATRICES[value.shape], column_major
