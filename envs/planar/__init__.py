"""Probing outlines in the plane (memo, 4.1)."""
