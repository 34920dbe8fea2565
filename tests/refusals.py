"""Calls that must raise."""

import pytest


def refused(message, call, *args, kind=ValueError, **kwargs):
    """Check that a call raises an error whose message matches."""
    with pytest.raises(kind, match=message):
        call(*args, **kwargs)
