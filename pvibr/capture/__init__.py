"""The clock, adaptive quality, tiled screenshots, movies, off-screen stages."""
