"""From the scan to the velocity: localisation, what is in the way, driving, and who carries it out.

These need no ROS:

- `navigator` takes odometry and scans, asks the others, and carries out one task at a time;
- `localisation` says where the robot is, `place_regions` in which place that is;
- `tracking` finds what moves, `obstacle_memory` what stands and is not on the map;
- `driving` is a drive along a path with its recoveries. It steers by `path_following`, and by the
  local planner of `sampled_planning` while somebody moves nearby;
- `sensor_age` says how fast a robot may be that heard nothing new.

These are the ROS side:

- `arrival` says what a way to move the robot offers (`Motion`). There are `navigation_motion`, with
  `base_interface` between topics and navigator, and `nav2`; `docking` docks at the end of either;
- `command_publisher` publishes velocities, `transforms` frames, `place_recording` places;
- `robot_parameters` has what the robot is told about itself.

They are imported from their modules, for the libraries behind them take their time.
"""
