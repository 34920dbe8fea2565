"""What pvibr raises and warns of."""

from __future__ import annotations


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
    """A shader does not compile on this driver; the message holds the driver's log."""


class ClosedError(PvibrError, RuntimeError):
    """The plotter or the window is closed; what was drawn there is released."""
