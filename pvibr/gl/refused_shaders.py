"""Features whose text a driver refuses: VTK prints that, and draws nothing of the actor."""

from __future__ import annotations

import re
from typing import Any

from pvibr.core import _vtk

#: The driver's log by name of feature, until the frame has ended.
REFUSED: dict[str, str] = {}
_FAILED = 'vtkShaderProgram ('
_MARK = re.compile(r'// (end of )?pvibr:(\S+)')
#: Of drivers, such as 0:173(2) and 0(173).
_LINE = re.compile(r'\b\d+[:(](\d+)\b')
_watched: Any = None  # what VTK prints errors to
_source = ''  # that failed last


def watch():
    """Hear what VTK prints, unless that is so already."""
    global _watched
    output = _vtk.vtkOutputWindow.GetInstance()
    if _watched is not output:
        _watched = output
        output.AddObserver('ErrorEvent', _vtk.calldata_type(_vtk.VTK_STRING)(_hear))


def _hear(_output, _event, text):
    """Note the features of a program that does not compile: its source comes before its log."""
    global _source
    if _FAILED not in text:
        return
    if '#version' in text:
        _source = text
    elif text.partition('):')[2].strip():
        log = text.partition('):')[2].strip()
        REFUSED.update(dict.fromkeys(blamed(_source, log), log))


def blamed(source, log) -> list[str]:
    """Return the feature in which the log finds an error; all of the source if it names none."""
    lines = source.splitlines()
    match = _LINE.search(log)
    start = next((k for k, line in enumerate(lines) if '1: #version' in line), 0)
    before = lines[start : start + int(match[1])] if match else []
    marks = [_MARK.search(line) for line in before]
    inside = [m for m in marks if m]
    if inside and not inside[-1][1]:
        return [inside[-1][2]]
    return sorted({m[2] for m in map(_MARK.search, lines) if m and not m[1]})
