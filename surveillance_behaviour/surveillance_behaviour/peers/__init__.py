"""Whom the machines talk to, without ROS (`ports`) and on the robot.

- `ports`: what the machines need, as interfaces (`Ports`), which raise `CallError`;
- `ros_ports`: services, actions and the log behind them; `armor_knowledge`: the ontology behind
  its port;
- `deciding`: what a node that decides has and offers (`decision`, `why_not`, `go_to`).
"""
