"""The ways to move a robot, and what is told of it; the computing is `lidar_navigation`'s.

- `arrival` says what a way to move the robot offers (`BaseMotion`). There are `navigation_motion`,
  with a navigator of its own, and `nav2`, which has the docking at the end of either, too;
- `goal_execution` carries out one goal at a time with a navigator, and `pose_reports` tells where
  the robot is and what is in doubt;
- `command_publisher` publishes velocities, as fast as the age of the last messages allows;
- `place_recording` tells the robot's place.

They are imported from their modules, for the libraries behind them take their time.
"""
