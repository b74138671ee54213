"""Where the robot is, in which place that is, and what moves around it."""
