"""File formats, as data."""
