"""The robot's mission: what it does next, and why.

- `robot_behavior_node`: the mission's state machine as a node; begin there;
- `machines`: the states; `mission`: what they work on, its record, its recovery from failures;
- `decision_maker`: the decision, made by the library `patrol_policy`, and what it needs to know
  (`ontology_view`, `patrol_map`, `learned_times`, `traffic`); `reasoner_node` offers it as a node;
- `ports`: what the states ask of other nodes; `ros_adapters`: how;
- `map_from_markers`: the first look around.
"""
