"""The simulated sensors as ROS topics, and the fault services."""
