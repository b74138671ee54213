"""The rest of the robot as the machines see it: ports, and their ROS side."""
