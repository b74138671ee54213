"""What all packages share: the base of nodes, parameters, the description of a place.

What others may use, by module:

- `node`: `PatrolNode`, the base class with checked parameters and threads that end with it.
  `process`: `run_node`, `run_nodes`, `ExecutorThread`.
- `health`: `Health`, what a node says of itself on `/diagnostics`.
- `parameters`: `parameter`, `parameters` and `converted`, the fields of a record that a node
  declares; `ParameterError`. `configuration`: files, place and arguments merged and checked,
  without ROS.
- `files`: `FileError`, the error of all files; `LineFile`, `KeptFile` and `replace_text`, which
  leave no half; `in_one_line`, what users read of an `OSError`.
- `waiting`: `AwaitedWork` and `AwaitedEvent` for callbacks. `state_file`: `StateFile`, what
  outlives a killed process.
- `place`: `Place`, `FloorPlan`, `read_place_file`, without ROS.
- `qos`, `conversions`, `logging`, `yaml_file`, `robot_arm`, `settled_frames`, `image_effects`,
  `testing`.

The modules are imported by themselves, so that a program without ROS can use those that need none.
"""
