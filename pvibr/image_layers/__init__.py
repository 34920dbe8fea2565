"""Parts of a scene drawn as images that are reused between frames."""
