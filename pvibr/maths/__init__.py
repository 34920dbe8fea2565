"""The formulas behind the shaders in numpy and float64; private, but for the camera classes."""
