"""What the robot notices, without ROS: looking, comparing, and joining what was seen to events.

- `observations`: the record that every look ends in; begin there;
- `doors`, `floor`: what a lidar says of doors and of things; `views`: what a camera says;
- `events`: sightings of the same thing over visits; `watch_rules`: what a person wants to know of.
"""
