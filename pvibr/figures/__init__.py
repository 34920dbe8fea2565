"""Animated figures and crowds, posed on the GPU."""
