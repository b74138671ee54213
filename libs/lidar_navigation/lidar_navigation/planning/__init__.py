"""Paths over an occupancy grid: `grid_planning` is the planner, `grid_search` its search."""
