"""What a watcher knows of a mission at one moment, and in words what changed between two."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surveillance_behaviour.policy.situation import Decision
from surveillance_operator.map_raster import Grid, Pose

NO_POINTS: NDArray[np.float64] = np.empty((0, 2))
BATTERY_STEP = 10
"""Percent between two lines about the battery."""


@dataclass(frozen=True)
class Status:
    """What `mission_status` says; see MissionStatus.msg."""

    since: float
    machine: str
    state: str
    place: str
    heading_to: str
    waiting_for_help: bool
    text: str
    avoided: tuple[str, ...]

    @property
    def whereabouts(self) -> str:
        """Where the robot is, and where it goes."""
        if not self.place:
            return 'in no place that is known yet'
        if self.heading_to in ('', self.place):
            return f'in {self.place}'
        return f'in {self.place}, heading for {self.heading_to}'


@dataclass(frozen=True)
class Change:
    """Something new in words.

    Attributes:
        text: In short.
        detail: What a log says, too.
        routine: Whether the picture itself shows it anyway.
    """

    text: str
    detail: str = ''
    routine: bool = False


@dataclass(frozen=True)
class Snapshot:
    """All that came so far; None and empty for what did not.

    Attributes:
        where: Where the watcher listens, in words.
        now: The mission's time, seconds.
        mode: The controllers' execution mode.
        nodes: The nodes that tell or answer anything of this, and what tells the processes of one
            apart that was started again.
        ended: Those that did and are gone.
        status: The latest `mission_status`, kept when its node ends.
        decision, number: The latest decision, and its number.
        battery, battery_low: Percent, and whether that is low.
        grid: The map.
        positions: A point in each place, metres.
        links: Pairs of places that are joined by an open door.
        doors: Whether each door is open.
        door_lines: The doors' openings: x1, y1, x2, y2, metres.
        visited_at: When each place was visited last, seconds of the mission's time.
        urgent: The places that the ontology has as URGENT.
        pose: Where the robot is.
        trail: Where it drove, shape (n, 2), metres, oldest first.
        obstacles: What stands about, shape (n, 2), metres.
        silent: Why nothing comes on a topic, where that is known.
        events: The latest changes with the time of the day, routine ones left out.
    """

    where: str = ''
    now: float = 0.0
    mode: str = ''
    nodes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    ended: frozenset[str] = frozenset()
    status: Status | None = None
    decision: Decision | None = None
    number: int = 0
    battery: float | None = None
    battery_low: bool = False
    grid: Grid | None = None
    positions: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    links: frozenset[tuple[str, str]] = frozenset()
    doors: Mapping[str, bool] | None = None
    door_lines: Mapping[str, tuple[float, float, float, float]] = field(default_factory=dict)
    visited_at: Mapping[str, float] = field(default_factory=dict)
    urgent: frozenset[str] = frozenset()
    pose: Pose | None = None
    trail: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    obstacles: NDArray[np.float64] | None = None
    silent: Mapping[str, str] = field(default_factory=dict)
    events: tuple[tuple[str, str], ...] = ()


def changes(old: Snapshot, new: Snapshot) -> Iterator[Change]:
    """What is new in a snapshot, one line each, as a log would tell it."""
    if new.status is not None and new.status != old.status:
        yield from _status_changes(old.status, new.status)
    if new.decision is not None and (new.decision, new.number) != (old.decision, old.number):
        yield Change(decision_line(new), detail=new.decision.reason)
    if new.battery is not None:
        before = None if old.battery is None else math.ceil(old.battery / BATTERY_STEP)
        if before != math.ceil(new.battery / BATTERY_STEP):
            yield Change(f'battery at {new.battery:.0f} %', routine=True)
    if new.battery_low != old.battery_low:
        yield Change('battery low' if new.battery_low else 'battery no longer low')
    if new.grid is not None and new.grid is not old.grid:
        rows, columns = new.grid.cells.shape
        cells = f'{columns} x {rows} cells of {new.grid.resolution:g} m'
        yield Change(f'a map of {cells}', routine=True)
    doors, before_doors = new.doors or {}, old.doors or {}
    for door, is_open in doors.items():
        if is_open != before_doors.get(door, True):
            yield Change(f'door {door} {"opened" if is_open else "closed"}')
    if old.urgent != new.urgent:
        yield from (Change(f'{place} is URGENT') for place in sorted(new.urgent - old.urgent))
    if new.obstacles is not None and new.obstacles is not old.obstacles:
        had, has = old.obstacles is not None and len(old.obstacles), len(new.obstacles)
        if has and not had:
            x, y = new.obstacles[0]
            yield Change(f'something stands at ({x:.1f}, {y:.1f})')
        elif had and not has:
            yield Change('nothing stands about any more')
    if old.nodes and not new.nodes:
        yield Change('every node has ended: waiting for the next mission')
    elif gone := sorted(new.ended - old.ended):
        yield Change(f'{", ".join(gone)} ended')
    if back := sorted(old.ended & new.nodes.keys()):
        yield Change(f'{", ".join(back)} came back')
    for node in sorted(old.nodes.keys() & new.nodes.keys()):
        if old.nodes[node] and new.nodes[node] - old.nodes[node]:
            yield Change(f'{node} was started again')


def decision_line(snapshot: Snapshot) -> str:
    """The decision without its reason."""
    decision = snapshot.decision
    assert decision is not None
    return f'decision {snapshot.number}: {decision.from_place} → {decision.place} [{decision.rule}]'


def _status_changes(old: Status | None, new: Status) -> Iterator[Change]:
    before = old and (old.machine, old.state, old.whereabouts)
    if before != (new.machine, new.state, new.whereabouts):
        state = new.state or 'not started'
        yield Change(f'{new.machine} {state}: {new.whereabouts}', routine=True)
    if new.text and (old is None or new.text != old.text):
        yield Change(new.text)
