"""Shared by tests of figures."""

from tests.animation.conftest import glb  # noqa: F401
