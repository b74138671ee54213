"""A wheeled robot with a lidar, without ROS: where it is, how it gets there, what it has not seen.

Begin with `driving.navigator`, which takes odometry and scans and carries out one task at a time.
`localisation` says where the robot is, `planning` finds paths, `exploration` maps a building.
"""
