"""What pvibr raises and warns of."""

from __future__ import annotations

import importlib


class PvibrWarning(UserWarning):
    """Something was left out of the picture; the message names it and the remedy.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter('ignore', PvibrWarning)
    """


class PvibrError(Exception):
    """Base of the errors that are pvibr's own.

    Examples
    --------
    >>> issubclass(ShaderError, PvibrError)
    True
    """


class ShaderError(PvibrError, RuntimeError):
    """A shader does not compile on this driver; the message holds what the driver says first.

    Parameters
    ----------
    message : str
        What is wrong.
    log : str, optional
        All that the driver says.
    """

    def __init__(self, message, log=''):
        super().__init__(message)
        self.log = log


class ClosedError(PvibrError, RuntimeError):
    """The plotter or the window is closed; what was drawn there is released."""


def require(module, extra, what):
    """Return a module that one of pvibr's extras installs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition('.')[0]
        msg = f"{what} need {package}: run pip install 'pvibr[{extra}]'"
        raise ImportError(msg) from error
