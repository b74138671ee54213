"""From the scan to the velocity: localisation, what is in the way, driving, and who carries it out.

These need no ROS:

- `navigator` takes odometry and scans, asks the others, and carries out one task at a time;
- `localisation` says where the robot is, `place_locator` in which place that is;
- `tracking` finds what moves, `obstacle_memory` what stands and is not on the map;
- `driving` is a drive along a path with its recoveries. It steers by `path_following`, and by the
  local planner of `sampled_planning` while somebody moves nearby.

These are the ROS side:

- `arrival` says what a way to move the robot offers (`Motion`). There are `navigation_motion`, with
  a navigator of its own, and `nav2`, which has the docking at the end of either, too;
- `command_publisher` publishes velocities, as fast as the age of the last messages allows;
- `transforms` reads scans by where the lidar sits, `place_recording` tells the robot's place.

They are imported from their modules, for the libraries behind them take their time.
"""
