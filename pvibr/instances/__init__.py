"""Many copies of a mesh, within a screen-space error."""
