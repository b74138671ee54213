"""What stands behind the machines' ports on the robot.

- `peers`: services, actions and the log; `armor_knowledge`: the ontology behind its port;
- `reason_client`: the reasoner in another process;
- `decision_services`: what a node that decides offers (`decision`, `why_not`, `go_to`).
"""
