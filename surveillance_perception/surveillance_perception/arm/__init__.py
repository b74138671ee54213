"""The arm that carries the camera: where it looks, how it moves, and scans of all around."""
