"""Battery, planner and motion controllers of the surveillance robot."""
