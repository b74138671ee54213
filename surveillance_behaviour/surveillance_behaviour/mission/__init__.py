"""The memory of a mission.

- `mission`: where the robot is, what it heads for and what failed (`Mission`, `MissionSettings`);
- `recovery`: what to try after a failure, and which places to leave alone for a while;
- `mission_log`: the record on disk (`MissionRecord`, `read`, `summarize`).
"""
