"""Seeing, steering and keeping a mission: terminal view, page, console, recording, replay, report.

Free of ROS:

- `MissionState`, `follow`, `changes`: what is known of a mission, and what changed.
- `PatchMaker`: states as the page's parts, and patches between them.

With ROS:

- `MissionSubscriber` (in `mission_subscriber`) keeps the state of a running mission.
- `MissionActions` (in `mission_actions`) does what a person wants.
"""

from surveillance_operator.mission_changes import changes, follow
from surveillance_operator.mission_state import MissionState, Notice, Status
from surveillance_operator.page_state import PatchMaker

__all__ = ['Grid', 'MissionState', 'Notice', 'PatchMaker', 'Status', 'changes', 'follow']
