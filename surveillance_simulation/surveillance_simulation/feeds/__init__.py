"""The simulation on ROS topics: `sensor_feed`, `camera_feed`, and the `fault_services`."""
