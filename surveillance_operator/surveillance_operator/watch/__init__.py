"""The view of a running mission in a terminal."""
