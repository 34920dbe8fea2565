"""Images projected onto meshes, and visibility."""
