"""Seeing, steering and keeping a mission: terminal view, page, console, recording, replay, report.

Begin with `mission_state`: the one record that every view shows. `mission_subscriber` keeps it of a
running mission by the table of `topics`, `recording.stored` of a recorded one. `figures` is the
table of what is shown everywhere, `page_state` that of the page's parts, which `page.broadcaster`
passes on and `recording.timeline` keeps. `mission_actions` does what a person wants.
"""

from surveillance_operator.mission_changes import changes, follow
from surveillance_operator.mission_state import MissionState, Notice, Status
from surveillance_operator.page_state import PatchMaker

__all__ = ['Grid', 'MissionState', 'Notice', 'PatchMaker', 'Status', 'changes', 'follow']
