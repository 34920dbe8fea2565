"""Shared by what draws in a scene: item sets, looks, picking, lights, casters, buffers, order."""
