"""Scenes that pvibr grows itself: heavy, free of files, the same for the same seed."""
