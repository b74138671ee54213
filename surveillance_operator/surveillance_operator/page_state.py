"""A state as the page shows it: named parts of plain values, and patches of what changed.

The page over the network and the time line in a recording carry the same parts. A part is computed
only when a field that it comes from has changed.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from floor_plans import Grid
from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.idleness_bounds import lines as bound_lines
from patrol_policy.policies import POLICIES
from surveillance_operator.figures import figures_line, figures_of
from surveillance_operator.mission_state import (
    NO_POINTS,
    RECORDS,
    TRAIL_STEP,
    MissionState,
    NodeReport,
    Pose,
)
from surveillance_operator.mission_words import doing, shares, troubles
from surveillance_operator.room_outlines import room_outlines

Parts = dict[str, Any]

USAGE = frozenset({'memory_mb', 'restarts'})

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


def _decision(state: MissionState) -> Any:
    decision = state.task.decision
    if decision is None:
        return None
    scores = [[name, round(value, 3)] for name, value in decision.scores.items()]
    more = {'number': state.task.decision_number, 'from': decision.from_place, 'scores': scores}
    return {**vars(decision), **more}


def _idleness_bounds(state: MissionState) -> Any:
    return {
        each.place: {
            'verdict': each.verdict,
            'threshold': _seconds(each.threshold),
            'wait': _seconds(each.wait),
            'words': each.words,
            'hours': state.task.hours.get(each.place, ''),
        }
        for each in _kept(state)
    }


def _kept(state: MissionState) -> list[IdlenessBound]:
    """Return what can be kept of each place; none of a place that was removed meanwhile."""
    there = state.place.positions
    return [each for each in state.task.idleness_bounds if not there or each.place in there]


def _seconds(value: float) -> float | None:
    """Return seconds as JSON has them; None: without an end."""
    return None if math.isinf(value) else round(value, 1)


def _rounded(pose: Pose) -> list[float]:
    return [round(value, 3) for value in pose]


def _status(state: MissionState) -> Any:
    status = state.task.status
    if status is None:
        return None
    return {**vars(status), 'place': state.robot_place, 'whereabouts': state.whereabouts}


def _plan(state: MissionState) -> Any:
    """Return the way that the robot means to drive; none while it waits for help."""
    waits = state.task.status is not None and state.task.status.waiting_for_help
    return [] if waits else _points(state.sensors.plan)


def _places(state: MissionState) -> Any:
    names = sorted({*state.place.positions, *state.place.visited_at})
    return {
        name: {
            'at': state.place.positions.get(name),
            'visited': state.place.visited_at.get(name) or None,
            'urgent': name in state.place.urgent,
        }
        for name in names
    }


def _transitions(state: MissionState) -> Any:
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
        for each in state.machine.transitions[-20:]
    ]


def _regions(state: MissionState) -> Any:
    if state.place.grid is None:
        return {}
    found = room_outlines(state.place.grid, state.place.positions, state.place.door_lines)
    return {
        name: {
            'boxes': [[round(edge, 2) for edge in box] for box in each.boxes],
            'label': [round(value, 2) for value in each.label],
            'room': round(each.room, 2),
        }
        for name, each in found.items()
    }


def health(state: MissionState) -> Any:
    """Return what is known of each node, with its own reports, and what else is reported.

    A program that robots share, as the simulator, may have a node in the namespace of each: its
    report is that node's, too.
    """
    reports = {_in_namespace(name, state): each for name, each in state.health.reports.items()}
    reports = dict(sorted(reports.items()))
    nodes = {}
    for name in sorted({*state.health.nodes, *state.health.ended}):
        own = [each for each in reports if each == name or each.startswith(f'{name}:')]
        nodes[name] = {
            'up': name in state.health.nodes,
            'restarts': state.health.restarts.get(name, 0),
            'reports': [_report(reports.pop(each)) for each in own],
        }
    others = {name: _report(each) for name, each in reports.items()}
    return {'nodes': nodes, 'others': others, 'silent': dict(state.health.silent)}


def _in_namespace(name: str, state: MissionState) -> str:
    """Return the name of who reports, without the namespace of the robot that is shown."""
    return name.removeprefix(f'{state.namespace}/') if state.namespace else name


def _report(health: NodeReport) -> Any:
    return {'level': health.level, 'message': health.message}


def _usage(state: MissionState) -> Any:
    """Return what viewers are shown of what each node reports that it takes."""
    return {
        _in_namespace(name, state): {key: value for key, value in each.values if key in USAGE}
        for name, each in sorted(state.health.reports.items())
        if ':' not in name
    }


def _history(state: MissionState) -> Any:
    history = state.history
    return {
        'visits': [[round(at, 1), place] for at, place in history.visits],
        'battery': [[round(at, 1), level] for at, level in history.battery],
        'marks': [[round(at, 1), kind, text] for at, kind, text in history.marks],
    }


def events_of(state: MissionState) -> Any:
    """Return the latest notices, the events of the page, as `merged_events` takes them."""
    # A third value says that the event is of the place.
    return [[round(each.at, 1), each.text, *([1] if each.shared else [])] for each in state.notices]


PARTS: Mapping[str, Callable[[MissionState], Any]] = {
    'mission': lambda s: {
        'where': s.where,
        'mode': s.task.mode,
        'threshold': s.task.threshold,
        'policy': s.task.policy,
        'policies': list(POLICIES),
        'running': bool(s.health.nodes),
    },
    'status': _status,
    'figures': lambda s: [
        [each.figure.name, each.figure.label, each.words, each.is_bad, each.fraction]
        for each in figures_of(s)
        if each.words
    ],
    'brief': lambda s: figures_line(s, brief=True),
    'decision': _decision,
    'idleness_bounds': _idleness_bounds,
    # As the log says it: a place that is late by little is no trouble.
    'kept': lambda s: bound_lines(kept)[0] if (kept := _kept(s)) else None,
    'grid': lambda s: _grid(s.place.grid),
    'places': _places,
    'regions': _regions,
    'links': lambda s: sorted(map(list, s.place.links)),
    'doors': lambda s: {
        name: {'open': (s.place.doors or {}).get(name), 'line': s.place.door_lines.get(name)}
        for name in sorted({*(s.place.doors or {}), *s.place.door_lines})
    },
    'zones': lambda s: {
        name: {'corners': [list(corner) for corner in zone.corners], 'speed': zone.speed}
        for name, zone in s.place.zones.items()
    },
    'stations': lambda s: {room: _rounded(pose) for room, pose in s.place.stations.items()},
    'coverage': lambda s: {name: round(share, 2) for name, share in s.place.coverage.items()},
    'pose': lambda s: None if s.sensors.pose is None else _rounded(s.sensors.pose),
    'others': lambda s: {name: _rounded(pose) for name, pose in s.place.others.items()},
    'plan': _plan,
    'scan': lambda s: _points(s.sensors.scan),
    'obstacles': lambda s: _points(s.sensors.obstacles),
    'machine': lambda s: [asdict(each) for each in s.machine.containers],
    'stopped': lambda s: s.task.stopped,
    'active': lambda s: {
        'paths': list(s.machine.active),
        'paused': s.machine.paused,
        'waiting': list(s.machine.waiting),
    },
    'transitions': _transitions,
    'markers': lambda s: {
        'seen': [list(each) for each in s.sensors.detections],
        'progress': s.sensors.scan_progress,
        'at': {str(number): list(point) for number, point in sorted(s.sensors.markers.items())},
    },
    'requests': lambda s: dict(s.task.requests),
    'health': health,
    'usage': _usage,
    'doing': doing,
    'shares': shares,
    'out': lambda s: s.task.is_out,
    'troubles': troubles,
    'events': events_of,
    'history': _history,
}
"""The parts of the page, each with what computes it; which fields it reads is found by itself."""

GLANCE = frozenset(
    (
        *('mission', 'status', 'brief', 'decision', 'pose', 'plan', 'stopped', 'active'),
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


class _Traced:
    """Passes on what a state's records hold, and notes each field that is read.

    Args:
        record: The state, or one of its records.
        name: Of the record in the state; empty for the state itself.
        read: Where the fields are noted, with the values that they have.
    """

    def __init__(self, record: Any, name: str, read: dict[str, Any]) -> None:
        self._record, self._name, self._read = record, name, read

    def __getattr__(self, field: str) -> Any:
        attribute = getattr(type(self._record), field, None)
        if isinstance(attribute, property) and attribute.fget is not None:
            return attribute.fget(self)  # it reads fields itself
        value = getattr(self._record, field)
        if not self._name and field in RECORDS:
            return _Traced(value, field, self._read)
        self._read[field] = value
        return value


def traced(
    compute: Callable[[MissionState], Any], state: MissionState
) -> tuple[Any, dict[str, Any]]:
    """Return what a function of a state returns, and the fields that it has read.

    Returns:
        The value; and by the names of the fields, what they hold.
    """
    read: dict[str, Any] = {}
    return compute(cast(MissionState, _Traced(state, '', read))), read


class PatchMaker:
    """Turns a series of states into patches: the parts of which a field has changed.

    Args:
        without: Parts to leave out.
    """

    def __init__(self, without: frozenset[str] = frozenset()) -> None:
        self._parts = {name: part for name, part in PARTS.items() if name not in without}
        self._last: MissionState | None = None
        self._read: dict[str, dict[str, Any]] = {}
        self.parts: Parts = {}

    def patch(self, state: MissionState, only: frozenset[str] | None = None) -> Parts:
        """Return the parts that differ from the last state's, and a trail that begins anew.

        Args:
            state: What is known.
            only: The parts that are asked for; None: all.
        """
        last, changed = self._last, {}
        self._last = state
        if last is not None and len(state.sensors.trail) < len(last.sensors.trail):
            changed['trail'] = _points(state.sensors.trail)
        for name, compute in self._parts.items():
            if only is not None and name not in only:
                continue
            read = self._read.get(name)
            if read is not None and all(state.field(field) is held for field, held in read.items()):
                continue
            value, self._read[name] = traced(compute, state)
            if name not in self.parts or self.parts[name] != value:
                self.parts[name] = changed[name] = value
        return changed

    def whole(self) -> Parts:
        """Return all parts, and the trail, which patches leave to whoever follows the pose."""
        trail = NO_POINTS if self._last is None else self._last.sensors.trail
        return {**self.parts, 'trail': _points(trail[-MOST_TRAIL:])}
