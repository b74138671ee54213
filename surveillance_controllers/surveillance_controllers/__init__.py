"""The controllers of the patrol robot: battery, planner and motion, each in three execution modes.

The nodes are `battery_controller`, `planner_controller` and `motion_controller`; whoever needs
their parts alone finds them in the sub-packages, each of which exports what it offers:

- `battery`: the model of a battery, and its use in a robot;
- `planning`: routes over doors, doors that are watched; the paths are those of `lidar_navigation`;
- `motion`: the ways to move a robot, by the library's navigator or by Nav2;
- `manual`: an operator's commands and requests.
"""
