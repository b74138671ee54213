"""The memory of a mission.

- `mission`: where the robot is, what it heads for and what failed (`Mission`, `MissionSettings`);
  begin there; `dock_state` is whether it stands at a station;
- `recovery`: what to try after a failure, and which places to leave alone for a while;
- `mission_notes`: what it writes down, `mission_log`: what that adds up to (`summarize`);
- `mission_watchdog`: tells when it does nothing, and why that is so.
"""
