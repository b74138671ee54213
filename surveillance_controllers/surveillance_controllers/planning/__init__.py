"""Routes over doors (`map_planner`) and doors that are watched (`door_watch`), as ROS sees them.

They are imported from their modules, for the libraries behind them take their time.
"""
