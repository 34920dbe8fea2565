"""Foundations: settings, effects, frames, reports, errors, files."""
