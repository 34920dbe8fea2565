"""Actors and meshes drawn as images or planes of themselves."""
