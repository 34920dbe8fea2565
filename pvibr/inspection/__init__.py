"""Overlays that show how a frame was drawn."""
