"""Whom the machines talk to, without ROS (`ports`) and on the robot.

- `ports`: what the machines need, as interfaces (`Ports`), which raise `CallError`;
- `ros_ports`: services and actions behind them; `armor_knowledge`: the ontology behind its port;
- `announcing`: what the mission publishes; `decision_services`: `why_not` and `go_to`.
"""
