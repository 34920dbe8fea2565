"""Shadows: maps, moments, volumes."""
