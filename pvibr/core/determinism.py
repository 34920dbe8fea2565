"""Pictures that do not depend on the speed of the machine."""

from __future__ import annotations

from contextlib import ContextDecorator
from time import perf_counter

#: Largest allowed difference of two pictures, as pytest-pyvista's ``error_value``: on the same
#: machine and driver, on other machines with the same driver, with another driver.
THRESHOLDS = {'same machine': 0.0, 'same driver': 5.0, 'other driver': 200.0}

_on = False


class deterministic(ContextDecorator):
    """Draw the same bits in every run: nothing depends on measured time.

    For pictures that are compared with references. While it is on,

    - quality is not reduced while the view moves (``pl.ibr.interactive_frame_ms`` is 0);
    - images or meshes are chosen by the fixed costs of a software renderer, on a GPU, too, and
      budgets in milliseconds are unlimited;
    - ``pl.ibr.play()`` advances by a sixtieth of a second each time the clock is read.

    Seeds and dithers are always fixed. The same driver on the same machine gives the same bits;
    ``docs/regression.md`` states how much others differ.

    Parameters
    ----------
    on : bool
        Whether it is on: from the call on, or as a context manager until the end of the ``with``
        block.

    Examples
    --------
    For a whole program or, in ``conftest.py``, for all tests:

    >>> import pvibr
    >>> _ = pvibr.deterministic()

    For a block, or for a function as ``@pvibr.deterministic()``; and off again:

    >>> with pvibr.deterministic(False):
    ...     pass
    >>> _ = pvibr.deterministic(False)
    """

    def __init__(self, on=True):
        if not isinstance(on, bool):
            raise TypeError(f'on must be True or False, got {on!r}')
        global _on
        self._before, _on = _on, on

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        global _on
        _on = self._before


def is_deterministic() -> bool:
    """Return True if nothing may depend on measured time."""
    return _on


def elapsed(start, nominal) -> float:
    """Return the seconds since `start`, for callers that decide by elapsed time."""
    return nominal if _on else perf_counter() - start
