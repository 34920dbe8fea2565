"""Parts of a scene drawn as images that are reused from frame to frame."""
