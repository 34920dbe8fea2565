"""Calibrated photographs: read from and written for photogrammetry programs."""
