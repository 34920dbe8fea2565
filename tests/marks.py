"""Which cases wait for ./test -m slow: those that take long and that a quick one is like."""

import pytest


def slow(*case, when=True, **options):
    """Return a case that is slow, or is when something holds."""
    return pytest.param(*case, marks=[pytest.mark.slow] * bool(when), **options)
