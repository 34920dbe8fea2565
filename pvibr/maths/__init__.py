"""Numpy only, float64: the formulas that shaders are tested against."""
