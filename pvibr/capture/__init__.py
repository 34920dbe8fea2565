"""Frames in time: the clock, adaptive quality, tiled screenshots, movies, off-screen stages."""
