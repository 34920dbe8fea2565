"""Conversion to plain actors, GLB and HTML."""
