"""What a robot notices indoors as it comes again and again, and which rule of a person that breaks.

Begin with `ChangeMonitor`: it takes sweeps of a lidar, pictures of a camera, and the places where
the robot is; it gives `Observation`s, and joins them to `Event`s in an `EventBook`. A person's
rules come from `read_watch_file`. Time, poses and pictures are handed in; nothing here knows ROS.
`python -m indoor_watch.demo` shows a room in which a box appears.

    book = EventBook(told=lambda event, _: print(event.words()))
    monitor = ChangeMonitor(rules, book, local=datetime.fromtimestamp, robot='Robot1')
    monitor.use_map(grid)
    monitor.arrive('hall', stamp)
    monitor.sweep(sensor, ends, met, stamp)  # for each turn of the lidar
    monitor.assess(stamp)  # every few seconds

Each name is imported when it is first used; OpenCV only then.

Public modules: `answers` (what a person says of events), `work_queue` (of one thread), `day_book`
(what was seen on a day), `detectors` and `onnx_network` (networks that find persons), `doors`,
`hung_markers` (where markers hang), `inspection_plan`, `marker_checks` and `viewpoints` (from where
to look), `lost_sight` (what of the sensors was of no use), `other_robots`, `persons` (who is in a
picture), `privacy` (pictures that may leave the machine), `reference_views`, `sees_around`, `views`
(what differs between two pictures), `visit`, `passages` (what a thing blocks).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from indoor_watch.change_monitor import ChangeMonitor as ChangeMonitor
    from indoor_watch.events import Event as Event
    from indoor_watch.events import EventBook as EventBook
    from indoor_watch.events import EventState as EventState
    from indoor_watch.evidence import EvidenceStore as EvidenceStore
    from indoor_watch.floor_layers import MOST_CELLS as MOST_CELLS
    from indoor_watch.floor_layers import same_map as same_map
    from indoor_watch.observations import Kind as Kind
    from indoor_watch.observations import Observation as Observation
    from indoor_watch.visit import Coverage as Coverage
    from indoor_watch.watch_rules import DEFAULT_RULES as DEFAULT_RULES
    from indoor_watch.watch_rules import Level as Level
    from indoor_watch.watch_rules import WatchRule as WatchRule
    from indoor_watch.watch_rules import read_watch_file as read_watch_file
    from indoor_watch.watch_rules import rule_from as rule_from
    from indoor_watch.watch_rules import with_baseline as with_baseline

_HOME = {
    'ChangeMonitor': 'change_monitor',
    'Coverage': 'visit',
    'DEFAULT_RULES': 'watch_rules',
    'Event': 'events',
    'EventBook': 'events',
    'EventState': 'events',
    'EvidenceStore': 'evidence',
    'Kind': 'observations',
    'Level': 'watch_rules',
    'MOST_CELLS': 'floor_layers',
    'Observation': 'observations',
    'WatchRule': 'watch_rules',
    'read_watch_file': 'watch_rules',
    'rule_from': 'watch_rules',
    'same_map': 'floor_layers',
    'with_baseline': 'watch_rules',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
