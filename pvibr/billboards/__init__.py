"""Images that face the eye."""
