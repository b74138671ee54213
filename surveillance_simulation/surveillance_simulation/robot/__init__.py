"""The simulated robot: base, lidar, arm."""
