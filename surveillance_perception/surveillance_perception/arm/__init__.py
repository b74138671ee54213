"""The arm that carries the camera."""
