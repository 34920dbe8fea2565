"""The benchmarks, which only a clone of the repository has."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

#: The folder that contains the package: the root of a clone.
ROOT = Path(__file__).resolve().parents[2]


def benchmarks() -> ModuleType | None:
    """Return the package `benchmarks` beside ``pvibr``, None if this is no clone."""
    if not (ROOT / 'benchmarks' / '__init__.py').is_file():
        return None
    # In front: a package of this name that is installed is another's.
    sys.path.insert(0, str(ROOT))
    return import_module('benchmarks')
