"""Errors and warnings of pvibr."""

from __future__ import annotations

import importlib
import sys
import warnings
from types import FrameType


class PvibrWarning(UserWarning):
    """Something is missing from the picture; the message names it and the remedy.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter('ignore', PvibrWarning)
    """


class PvibrError(Exception):
    """Base class of pvibr's own errors.

    Examples
    --------
    >>> issubclass(ShaderError, PvibrError)
    True
    """


class ShaderError(PvibrError, RuntimeError):
    """A shader does not compile on this driver; the message quotes the driver's log.

    Parameters
    ----------
    message : str
        What failed.
    log : str, optional
        The driver's full log.
    """

    def __init__(self, message, log=''):
        super().__init__(message)
        self.log = log


class ClosedError(PvibrError, RuntimeError):
    """The plotter or its window is closed, and its resources are released."""


class ThreadError(PvibrError, RuntimeError):
    """pvibr was called in a thread, or a forked process, other than that which draws.

    Examples
    --------
    >>> issubclass(ThreadError, RuntimeError)
    True
    """


#: Packages whose stack frames are not the user's; trame's are matched by prefix.
_LIBRARIES = ('pvibr', 'pvibr_widgets', 'pyvista', 'pyvistaqt', 'importlib', 'contextlib')


def warn(message, category=PvibrWarning):
    """Warn at the first line of user code up the stack, outside pvibr and PyVista."""
    frame: FrameType | None = sys._getframe(1)  # noqa: SLF001
    level = 2
    while frame is not None and _is_library(frame):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level if frame is not None else 2)


def _is_library(frame) -> bool:
    name = frame.f_globals.get('__name__', '')
    return name.partition('.')[0] in _LIBRARIES or name.startswith('trame')


def require(module, extra, feature):
    """Import a module that one of pvibr's extras installs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package_name = module.partition('.')[0]
        raise ImportError(
            f"{feature} need {package_name}: run pip install 'pvibr[{extra}]'", name=package_name
        ) from error
