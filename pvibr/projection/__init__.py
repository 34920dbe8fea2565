"""Pictures projected on meshes, and what is visible from where."""
