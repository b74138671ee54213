"""Shared ground of the packages: what rclpy nodes stand on, a place's description, the arm."""
