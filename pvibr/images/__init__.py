"""Images as textures."""
