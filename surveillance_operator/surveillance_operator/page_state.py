"""A snapshot as the page shows it: named parts of plain values, and patches of what changed.

The page over the network and the time line in a recording carry the same parts. A part is computed
only when a field that it comes from has changed.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from patrol_policy.policies import POLICIES
from patrol_policy.promises import lines as promise_lines
from surveillance_operator.mission_state import (
    NO_POINTS,
    TRAIL_STEP,
    MissionState,
    NodeReport,
    doing,
    is_out,
    shares,
    troubles,
)
from surveillance_operator.room_outlines import room_outlines
from surveillance_runtime.place.occupancy_grid import Grid

Parts = dict[str, Any]

FIGURES = frozenset({'memory_mb', 'restarts'})

MOST_TRAIL = 600
"""Points of the trail that viewers are shown, the newest."""


def lengthen(trail: list[list[float]], pose: list[float]) -> None:
    """Add where a pose is to a trail, unless it is where the trail ends."""
    # Poses are rounded: a step of just this length counts.
    if not trail or math.dist(trail[-1], pose[:2]) > 0.99 * TRAIL_STEP:
        trail.append(pose[:2])
        del trail[:-MOST_TRAIL]


def _points(points: NDArray[np.float64] | None) -> list[list[float]]:
    return [] if points is None else np.round(points, 2).tolist()


def _grid(grid: Grid | None) -> Any:
    if grid is None:
        return None
    # Transparent where nothing is known, so that the page's own colours show through.
    colours = np.zeros((*grid.cells.shape, 2), np.uint8)
    colours[grid.occupied] = 0, 255
    colours[grid.free] = 128, 28
    file = io.BytesIO()
    Image.fromarray(colours[::-1], 'LA').save(file, 'PNG', optimize=True)
    return {
        'image': 'data:image/png;base64,' + base64.b64encode(file.getvalue()).decode(),
        'box': list(grid.bounds),
        'known': list(grid.known),
    }


def _decision(snapshot: MissionState) -> Any:
    decision = snapshot.decision
    if decision is None:
        return None
    scores = [[name, round(value, 3)] for name, value in decision.scores.items()]
    more = {'number': snapshot.number, 'from': decision.from_place, 'scores': scores}
    return {**vars(decision), **more}


def _promises(snapshot: MissionState) -> Any:
    return {
        each.place: {
            'verdict': each.verdict,
            'threshold': _seconds(each.threshold),
            'wait': _seconds(each.wait),
            'words': each.words,
            'hours': snapshot.hours.get(each.place, ''),
        }
        for each in snapshot.promises
    }


def _seconds(value: float) -> float | None:
    """Return seconds as JSON has them; None: without an end."""
    return None if math.isinf(value) else round(value, 1)


def _status(snapshot: MissionState) -> Any:
    status = snapshot.status
    return status and {**vars(status), 'whereabouts': status.whereabouts}


def _plan(snapshot: MissionState) -> Any:
    """Return the way that the robot means to drive; none while it waits for help."""
    waits = snapshot.status is not None and snapshot.status.waiting_for_help
    return [] if waits else _points(snapshot.plan)


def _places(snapshot: MissionState) -> Any:
    names = sorted({*snapshot.positions, *snapshot.visited_at})
    return {
        name: {
            'at': snapshot.positions.get(name),
            'visited': snapshot.visited_at.get(name) or None,
            'urgent': name in snapshot.urgent,
        }
        for name in names
    }


def _transitions(snapshot: MissionState) -> Any:
    return [
        [
            each.sequence,
            each.time,
            each.path,
            each.from_state,
            each.outcome,
            each.to_state,
            round(each.duration, 2),
        ]
        for each in snapshot.transitions[-20:]
    ]


def _regions(snapshot: MissionState) -> Any:
    if snapshot.grid is None:
        return {}
    found = room_outlines(snapshot.grid, snapshot.positions, snapshot.door_lines)
    return {
        name: {
            'boxes': [[round(edge, 2) for edge in box] for box in each.boxes],
            'label': [round(value, 2) for value in each.label],
            'room': round(each.room, 2),
        }
        for name, each in found.items()
    }


def health(snapshot: MissionState) -> Any:
    """Return what is known of each node, with its own reports, and what else is reported.

    A program that robots share, as the simulator, may have a node in the namespace of each: its
    report is that node's, too.
    """
    reports = {_in_namespace(name, snapshot): each for name, each in snapshot.health.items()}
    reports = dict(sorted(reports.items()))
    nodes = {}
    for name in sorted({*snapshot.nodes, *snapshot.ended}):
        own = [each for each in reports if each == name or each.startswith(f'{name}:')]
        nodes[name] = {
            'up': name in snapshot.nodes,
            'restarts': snapshot.restarts.get(name, 0),
            'reports': [_report(reports.pop(each)) for each in own],
        }
    others = {name: _report(each) for name, each in reports.items()}
    return {'nodes': nodes, 'others': others, 'silent': dict(snapshot.silent)}


def _in_namespace(name: str, snapshot: MissionState) -> str:
    """Return the name of who reports, without the namespace of the robot that is shown."""
    return name.removeprefix(f'{snapshot.namespace}/') if snapshot.namespace else name


def _report(health: NodeReport) -> Any:
    return {'level': health.level, 'message': health.message}


def _figures(snapshot: MissionState) -> Any:
    """Return what viewers are shown of the figures that nodes report of themselves."""
    return {
        _in_namespace(name, snapshot): {key: value for key, value in each.values if key in FIGURES}
        for name, each in sorted(snapshot.health.items())
        if ':' not in name
    }


def _history(snapshot: MissionState) -> Any:
    history = snapshot.history
    return {
        'visits': [[round(at, 1), place] for at, place in history.visits],
        'battery': [[round(at, 1), level] for at, level in history.battery],
        'marks': [[round(at, 1), kind, text] for at, kind, text in history.marks],
    }


def events_of(snapshot: MissionState) -> Any:
    """Return the latest events, as `merged_events` takes them."""
    # A third value says that the event is of the place.
    return [[round(at, 1), text, *([1] if shared else [])] for at, text, shared in snapshot.events]


PARTS: Mapping[str, tuple[tuple[str, ...], Callable[[MissionState], Any]]] = {
    'mission': (
        ('where', 'mode', 'threshold', 'policy', 'nodes'),
        lambda s: {
            'where': s.where,
            'mode': s.mode,
            'threshold': s.threshold,
            'policy': s.policy,
            'policies': list(POLICIES),
            'running': bool(s.nodes),
        },
    ),
    'status': (('status',), _status),
    'decision': (('decision', 'number'), _decision),
    'promises': (('promises', 'hours'), _promises),
    # As the log says it: a place that is late by little is no trouble.
    'kept': (('promises',), lambda s: promise_lines(s.promises)[0] if s.promises else None),
    'battery': (
        ('battery', 'battery_low'),
        lambda s: None if s.battery is None else {'level': s.battery, 'low': s.battery_low},
    ),
    'grid': (('grid',), lambda s: _grid(s.grid)),
    'places': (('positions', 'visited_at', 'urgent'), _places),
    'regions': (('grid', 'positions', 'door_lines'), _regions),
    'links': (('links',), lambda s: sorted(map(list, s.links))),
    'doors': (
        ('doors', 'door_lines'),
        lambda s: {
            name: {'open': (s.doors or {}).get(name), 'line': s.door_lines.get(name)}
            for name in sorted({*(s.doors or {}), *s.door_lines})
        },
    ),
    'zones': (
        ('zones',),
        lambda s: {
            name: {'corners': [list(corner) for corner in zone.corners], 'speed': zone.speed}
            for name, zone in s.zones.items()
        },
    ),
    'stations': (
        ('stations',),
        lambda s: {room: [round(v, 3) for v in pose] for room, pose in s.stations.items()},
    ),
    'pose': (('pose',), lambda s: None if s.pose is None else [round(v, 3) for v in s.pose]),
    'others': (
        ('others',),
        lambda s: {name: [round(v, 3) for v in pose] for name, pose in s.others.items()},
    ),
    'plan': (('plan', 'status'), _plan),
    'scan': (('scan',), lambda s: _points(s.scan)),
    'obstacles': (('obstacles',), lambda s: _points(s.obstacles)),
    'machine': (('containers',), lambda s: [asdict(each) for each in s.containers]),
    'stopped': (('stopped',), lambda s: s.stopped),
    'active': (
        ('active', 'paused', 'waiting'),
        lambda s: {'paths': list(s.active), 'paused': s.paused, 'waiting': list(s.waiting)},
    ),
    'transitions': (('transitions',), _transitions),
    'markers': (
        ('detections', 'scan_progress', 'markers'),
        lambda s: {
            'seen': [list(each) for each in s.detections],
            'progress': s.scan_progress,
            'at': {str(number): list(point) for number, point in sorted(s.markers.items())},
        },
    ),
    'requests': (('requests',), lambda s: dict(s.requests)),
    'health': (('namespace', 'nodes', 'ended', 'restarts', 'health', 'silent'), health),
    'figures': (('namespace', 'health'), _figures),
    'doing': (('status', 'share', 'paused', 'stopped', 'nodes'), doing),
    'shares': (('share',), shares),
    'out': (('share',), is_out),
    'troubles': (('status', 'stopped', 'nodes', 'ended', 'health', 'namespace'), troubles),
    'events': (('events',), events_of),
    'history': (('history',), _history),
}
"""Each part with the snapshot's fields that it comes from."""

GLANCE = frozenset(
    (
        *('mission', 'status', 'decision', 'battery', 'pose', 'plan', 'stopped', 'active'),
        *('doing', 'shares', 'out', 'troubles', 'events'),
    )
)
"""The parts that are shown of each robot of a fleet, whichever is chosen."""
KEPT_EVENTS = 100
"""Events of all robots that are shown."""
TOLD_WITHIN = 5.0
"""Seconds within which what several robots' events say of the place is one event."""


def merged_events(events: Mapping[str, Any]) -> list[list[Any]]:
    """Return the events of all robots in one order: when, the robot's name, what.

    What is of the place has no name, and stands once.

    Args:
        events: The part `events` by the name of the robot.
    """
    told = sorted(
        ((each[0], robot, each[1], len(each) > 2) for robot in events for each in events[robot]),
        # In old recordings times are texts.
        key=lambda each: (not isinstance(each[0], str), each[0]),
    )
    found: list[list[Any]] = []
    by_text: dict[str, list[tuple[float, set[str]]]] = {}
    for at, robot, text, shared in told:
        if shared:
            known = by_text.setdefault(text, [])
            same = next(
                (who for then, who in known if at - then <= TOLD_WITHIN and robot not in who), None
            )
            if same is not None:
                same.add(robot)
                continue
            known.append((at, {robot}))
        found.append([at, '' if shared else robot, text])
    return found[-KEPT_EVENTS:]


assert {name for sources, _ in PARTS.values() for name in sources} <= {
    field.name for field in fields(MissionState)
}


class PatchMaker:
    """Turns a series of snapshots into patches.

    Args:
        without: Parts to leave out.
    """

    def __init__(self, without: frozenset[str] = frozenset()) -> None:
        self._parts = {name: part for name, part in PARTS.items() if name not in without}
        self._last: MissionState | None = None
        self._seen: dict[str, tuple[Any, ...]] = {}
        self.parts: Parts = {}

    def patch(self, snapshot: MissionState, only: frozenset[str] | None = None) -> Parts:
        """Return the parts that differ from the last snapshot's, and a trail that begins anew.

        Args:
            snapshot: What is known.
            only: The parts that are asked for; None: all.
        """
        last, changed = self._last, {}
        self._last = snapshot
        if last is not None and len(snapshot.trail) < len(last.trail):
            changed['trail'] = _points(snapshot.trail)
        for name, (sources, compute) in self._parts.items():
            if only is not None and name not in only:
                continue
            values = tuple(getattr(snapshot, source) for source in sources)
            seen = self._seen.get(name)
            if seen is not None and all(a is b for a, b in zip(seen, values, strict=True)):
                continue
            self._seen[name] = values
            value = compute(snapshot)
            if name not in self.parts or self.parts[name] != value:
                self.parts[name] = changed[name] = value
        return changed

    def whole(self) -> Parts:
        """Return all parts, and the trail, which patches leave to whoever follows the pose."""
        trail = NO_POINTS if self._last is None else self._last.trail
        return {**self.parts, 'trail': _points(trail[-MOST_TRAIL:])}
