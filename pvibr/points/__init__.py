"""Items at points: images that face the eye; spheres, cylinders and ellipsoids, ray-cast."""
