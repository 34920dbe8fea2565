"""Calibrated photographs: camera files, and their projection onto surfaces."""
