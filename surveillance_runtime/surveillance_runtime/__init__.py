"""What all packages share: the base of nodes, parameters, the sensors.

What others may use, by module:

- `node`: `PatrolNode`, the base class with checked parameters and threads that end with it.
  `process`: `run_node`, `run_nodes`, `ExecutorThread`.
- `health`: `Health`, what a node says of itself on `/diagnostics`.
- `parameters`: what a parameter takes, `ParameterError`; the fields of a record that a node
  declares are those of `strict_files.settings`. `place_parameters`: the place, as a node is told
  of it. `configuration`: files, place and arguments merged and checked, without ROS.
- `sensing`: streams of sensors, their ages, transforms.
- `waiting`: `AwaitedWork` and `AwaitedEvent` for callbacks. `state_file`: `StateFile`, what
  outlives a killed process.
- `qos`, `conversions`, `logging`, `robot_arm`, `fresh_images`, `image_effects`,
  `testing`.

The modules are imported by themselves, so that a program without ROS can use those that need none.
"""
