"""Scenes for browsers and files that know no pvibr."""
