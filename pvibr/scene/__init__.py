"""Shared by things in a scene: casters, lights, views, buffers, looks, picking."""
