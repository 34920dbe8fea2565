"""Text, scalar bars, axes and labels of subplots, as a page lays them out in SVG."""

from __future__ import annotations


def why_no_annotation(renderer) -> list:
    """Return pairs of a function and props that it says why a page does not draw."""
    return []
