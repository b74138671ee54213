"""Paths over an occupancy grid, and routes over doors.

`grid_planning` is the planner (`GridPlanner`, `NoPathError`), `grid_search`
its search; none of them needs ROS. `map_planner` (with the routes over doors) and `door_watch` are
their ROS side. They are imported from their modules, for the libraries behind them take their time.
"""
