"""glTF files written by hand, for meshes as for figures."""

from tests.animation.conftest import glb  # noqa: F401
