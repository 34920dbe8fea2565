"""Meshes as a few textured planes."""
