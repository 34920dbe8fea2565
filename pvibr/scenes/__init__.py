"""Procedural scenes: heavy, without files, reproducible from a seed."""
