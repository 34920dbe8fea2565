"""Image-based rendering for PyVista."""
