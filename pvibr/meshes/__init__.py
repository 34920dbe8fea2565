"""Meshes of any kind as parts, and their poses."""
