"""Markers in pictures: detection, pose, confirmation."""
