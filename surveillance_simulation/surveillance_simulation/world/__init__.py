"""The simulated place: walls, doors, obstacles, markers."""
