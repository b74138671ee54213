"""Poses and polylines in the plane."""
