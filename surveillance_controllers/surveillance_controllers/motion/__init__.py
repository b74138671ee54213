"""Localisation, path following, and the ways to move a robot.

`localisation`, `tracking`, `path_following`, `sampled_planning`, `driving` and `navigator` need no
ROS. `base_interface`, `navigation_motion`, `nav2`, `docking` and `place_recording` are the ROS
side. They are imported from their modules, for the libraries behind them take their time.
"""
