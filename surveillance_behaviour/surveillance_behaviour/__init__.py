"""The robot's mission: what it does next, and why.

- `robot_behavior_node`: the mission's state machine as a node; begin there;
- `machines`: the states; `mission`: what they work on, its record, its recovery from failures;
- `reasoner_node`, `world_model`: the decision, made by the library `patrol_policy`;
- `ports`: what the states ask of other nodes; `ros_adapters`: how;
- `map_from_markers`: the first look around.
"""
