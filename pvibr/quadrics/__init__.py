"""Spheres, cylinders and ellipsoids, ray-cast on cards."""
