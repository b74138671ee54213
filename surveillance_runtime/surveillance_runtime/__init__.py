"""Rclpy ground of the surveillance nodes: parameters, waits, calls, actions, process life cycle."""
