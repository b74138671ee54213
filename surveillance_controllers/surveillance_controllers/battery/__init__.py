"""The battery: its model, what a robot draws, and its ROS side."""
