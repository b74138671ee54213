"""The map that the robot learns from markers when it starts."""
