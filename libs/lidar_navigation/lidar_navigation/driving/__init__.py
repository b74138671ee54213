"""Driving along a path: what is in the way, how fast, and one task at a time."""
