"""Actors drawn as images of themselves."""
