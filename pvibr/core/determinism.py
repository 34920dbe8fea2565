"""Pictures that do not depend on how fast the machine is."""

from __future__ import annotations

from contextlib import ContextDecorator
from time import perf_counter

#: What two pictures may differ by, as pytest-pyvista counts it (``error_value``): on the machine
#: and driver that made the first one, on other machines with that driver, with another driver.
THRESHOLDS = {'same machine': 0.0, 'same driver': 10.0, 'other driver': 200.0}

_on = False


class deterministic(ContextDecorator):
    """Draw the same bits in every run: nothing depends on time that was measured.

    For pictures that are compared with earlier ones. While it is on,

    - quality is not reduced while the view moves (``pl.ibr.interactive_frame_ms`` is 0);
    - what is drawn as an image and what as a mesh is chosen by fixed costs, not by those measured
      on this machine, and budgets in milliseconds are unlimited;
    - ``pl.ibr.play()`` advances by a sixtieth of a second each time the clock is read.

    Seeds and dithers are always fixed. The same driver on the same machine gives the same bits; by
    how much others may differ, see ``docs/regression.md``.

    Parameters
    ----------
    on : bool
        Whether it is on: from the call on, or, as a context manager, until the end of the ``with``
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
            raise TypeError(f'on = {on!r}: must be True or False')
        global _on
        self._wanted, self._before = on, [_on]
        _on = on

    def __enter__(self):
        return self

    def __exit__(self, *error):
        global _on
        _on = self._before[0]


def is_deterministic() -> bool:
    """Return True if nothing may depend on time that is measured."""
    return _on


def elapsed(start, nominal) -> float:
    """Return the seconds since a moment, for who chooses by them."""
    return nominal if _on else perf_counter() - start
