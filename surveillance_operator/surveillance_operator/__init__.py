"""Seeing, steering and keeping a mission: terminal view, page, console, recording, replay, report.

Free of ROS:

- `Snapshot`, `follow`, `changes`: what is known of a mission, and what changed.
- `Framer`: snapshots as the page's parts, and patches between them.

With ROS:

- `MissionFeed` (`surveillance_operator.mission_feed`) keeps a snapshot of a running mission.
- `MissionActions` (`surveillance_operator.mission_actions`) does what a person wants.
"""

from surveillance_operator.frames import Framer
from surveillance_operator.snapshot import Change, Snapshot, Status, changes, follow
from surveillance_runtime.place.occupancy_grid import Grid

__all__ = ['Change', 'Framer', 'Grid', 'Snapshot', 'Status', 'changes', 'follow']
