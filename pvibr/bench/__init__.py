"""Measure run time against error."""
