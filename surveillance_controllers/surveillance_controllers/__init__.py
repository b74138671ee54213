"""The controllers of the patrol robot: battery, planner and motion, each in three execution modes.

The nodes are `battery_controller`, `planner_controller` and `motion_controller`; whoever needs
their parts alone finds them in the sub-packages, each of which exports what it offers:

- `battery`: the model of a battery, and its use in a robot;
- `planning`: paths over an occupancy grid, routes over doors;
- `motion`: localisation, path following, and the ways to move a robot;
- `manual`: an operator's commands and requests;
- `surveillance_controllers.geometry`: poses and paths in the plane.
"""
