"""Meshes of any kind as parts, and where they stand."""
