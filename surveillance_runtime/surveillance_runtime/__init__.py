"""What all packages share: the base of nodes, parameters, the description of a place.

What others may use, by module:

- `node`: `PatrolNode`, the base class with checked parameters and threads that end with it;
  `StartError`. `process`: `run_node`, `run_nodes`, `ExecutorThread`.
- `diagnostics`: `Health`, what a node says of itself on `/diagnostics`.
- `parameters`: `Described` and `declare_fields`, a table of parameters beside its record;
  `ParameterError`. `configuration`: files, place and arguments merged and checked, without ROS.
- `calls`: `ServiceCaller` and `GoalCaller`, calls that always end, and their errors.
  `action_server`: `GoalServer`, where a new goal takes the place of the one that runs.
- `waiting`: `ClockWait` on ROS time, `AwaitedWork` and `AwaitedEvent` for callbacks.
- `place`: `Place`, `FloorPlan`, `read_place_file`, without ROS.
- `qos`, `conversions`, `logging`, `yaml_file`, `robot_arm`, `settled_frames`, `testing`.

The modules are imported by themselves, so that a program without ROS can use those that need none.
"""
