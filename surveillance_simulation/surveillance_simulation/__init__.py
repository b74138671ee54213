"""Stand-in for robot hardware and Gazebo: camera, arm, base, lidar and time."""
