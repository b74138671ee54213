"""What is known of a mission at one moment, and in words what changed between two moments.

Every view shows a `MissionState`: the terminal, the page, the recording's time line. It is
immutable; `follow` gives the next one its events and its history.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol_policy.promises import Promise
from patrol_policy.world import Decision
from surveillance_runtime.place.floor_plan import Segment
from surveillance_runtime.place.occupancy_grid import Grid
from surveillance_runtime.place.zones import Zone

NO_POINTS: NDArray[np.float64] = np.empty((0, 2))
TRAIL_STEP = 0.1
"""Least distance of two points of a trail, metres."""
BATTERY_STEP = 10
"""Percent between two lines about the battery."""
KEPT_EVENTS = 50
WAITS_FOR_HELP = 'the robot waits for help'
STOPPED = 'the robot is stopped'
ERROR, STALE = 2, 3
"""Levels of health: of what does not work, and of what no longer reports."""
HISTORY_SECONDS = 3600.0
MOST_HISTORY = 5000
"""How far back histories go, seconds of the mission's time, and their most entries."""

Pose = tuple[float, float, float]
"""x, y in metres and yaw in radians."""


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
class MachineContainer:
    """One container of the state machine: its states, and the transitions between them.

    Attributes:
        path: E.g. `surveillance/PERFORM_ROOM_TASKS`.
        kind: StateMachine, Concurrence, ...
        states, initial, outcomes: Labels.
        edges: From state, outcome, to state.
    """

    path: str
    kind: str
    states: tuple[str, ...]
    initial: tuple[str, ...]
    outcomes: tuple[str, ...]
    edges: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class MachineTransition:
    """One transition of the state machine; see FsmTransition.msg."""

    sequence: int
    time: float
    path: str
    from_state: str
    outcome: str
    to_state: str
    duration: float


@dataclass(frozen=True)
class NodeReport:
    """What one node reports on `/diagnostics`.

    Attributes:
        level: 0 is good, 1 a warning, 2 an error, `STALE`.
        message: In words.
        values: Further figures by name.
        hardware: What it runs on.
        heard: When it came, seconds of steady time.
    """

    level: int
    message: str
    values: tuple[tuple[str, str], ...]
    hardware: str = ''
    heard: float = 0.0


@dataclass(frozen=True)
class MissionHistory:
    """What happened in the last hour of the mission's time; oldest first, times in seconds.

    Attributes:
        visits: Time and place.
        battery: Time and level in percent, at each change of a percent.
        marks: Time, kind (recharge, failure, recovery, help) and words.
    """

    visits: tuple[tuple[float, str], ...] = ()
    battery: tuple[tuple[float, float], ...] = ()
    marks: tuple[tuple[float, str, str], ...] = ()


@dataclass(frozen=True)
class Change:
    """Something new in words.

    Attributes:
        text: In short.
        detail: What a log says, too.
        routine: Whether the views show it anyway.
        shared: Whether it is of the place, so that whoever watches another robot sees it, too.
    """

    text: str
    detail: str = ''
    routine: bool = False
    shared: bool = False


class Event(NamedTuple):
    """One of the latest changes.

    Attributes:
        at: When, seconds since 1970.
        text: What.
        shared: As of a `Change`.
    """

    at: float
    text: str
    shared: bool = False


@dataclass(frozen=True)
class PatrolShare:
    """What a robot of a fleet tells the others; see FleetRobot.msg.

    Attributes:
        tour: The places that are its own, in the order of their tour; it may share them.
        stop: The one that it is to visit next.
        dock: Where it charges, or drives to in order to charge.
        heading_to: Where it wants to go next.
        is_moving: Whether it is on its way there; else it waits for its turn.
        runs_until: When its battery reaches its reserve, mission time in seconds; None: unknown.
        taken_out: Whether a person took it out of the patrol.
    """

    tour: tuple[str, ...] = ()
    stop: str = ''
    dock: str = ''
    heading_to: str = ''
    is_moving: bool = False
    runs_until: float | None = None
    taken_out: bool = False


@dataclass(frozen=True)
class MissionState:
    """All that came so far; None and empty for what did not.

    Attributes:
        where: Where the watcher listens, in words.
        namespace: Of the robot, without slashes.
        now: The mission's time, seconds.
        mode: The controllers' execution mode.
        threshold, policy: The behaviour's parameters.
        nodes: The nodes that tell or answer anything of this, and what tells the processes of one
            apart that was started again.
        ended: Those that did and are gone.
        restarts: How often a node was seen to start again.
        status: The latest `mission_status`, kept when its node ends.
        decision, number: The latest decision, and its number.
        promises, hours: What can be kept of each place, and the hours of those that have some.
        battery, battery_low: Percent, and whether that is low.
        grid: The map.
        positions: A point in each place, metres.
        links: Pairs of places that are joined by an open door.
        doors: Whether each door is open.
        door_lines: The doors' openings: x1, y1, x2, y2, metres.
        zones: Where the robot never drives, and where it drives slowly, by name.
        stations: The charging stations' poses by their rooms.
        visited_at: When each place was visited last, seconds of the mission's time; 0: never yet.
        urgent: The places that the ontology has as URGENT.
        pose: Where the robot is.
        localised: Whether somebody estimates that from sensors.
        trail: Where it drove, shape (n, 2), metres, oldest first.
        plan: The planned path, shape (n, 2), metres.
        others: Where other robots are, by namespace.
        pose_time: The stamp of the pose, seconds.
        lidar: The latest scan: its stamp, and its points in the robot's frame.
        scan: What the lidar sees, shape (n, 2), metres, map frame.
        obstacles: What stands about, shape (n, 2), metres.
        containers: The state machine, outermost container first.
        active: Paths of the states that are active, outermost first.
        paused: Whether the machine enters no further state.
        waiting: The transitions of the machine that wait for a person's approval.
        stopped: Whether a person has stopped the robot.
        transitions: The latest transitions.
        detections: The markers of the latest image: id, whether the list of markers has it, whether
            it is confirmed, confidence.
        markers: Where confirmed markers stand by their ids, metres.
        camera: While the arm stands still: its stamp, and the transform (4, 4) from the camera's
            optical frame to the robot.
        stands: Whether the robot stood still between its last two poses.
        scan_progress: View and number of views of the arm's scan.
        requests: What each controller in MANUAL mode announced last.
        health: What the nodes report, by name.
        silent: Why nothing comes on a topic, where that is known.
        share: What it tells the other robots of a fleet; None: there are none.
        events: The latest changes; routine ones left out.
        history: What happened in the last hour.
    """

    where: str = ''
    namespace: str = ''
    now: float = 0.0
    mode: str = ''
    threshold: float | None = None
    policy: str = ''
    nodes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    ended: frozenset[str] = frozenset()
    restarts: Mapping[str, int] = field(default_factory=dict)
    status: Status | None = None
    decision: Decision | None = None
    number: int = 0
    promises: tuple[Promise, ...] = ()
    hours: Mapping[str, str] = field(default_factory=dict)
    battery: float | None = None
    battery_low: bool = False
    grid: Grid | None = None
    positions: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    links: frozenset[tuple[str, str]] = frozenset()
    doors: Mapping[str, bool] | None = None
    door_lines: Mapping[str, Segment] = field(default_factory=dict)
    zones: Mapping[str, Zone] = field(default_factory=dict)
    stations: Mapping[str, Pose] = field(default_factory=dict)
    visited_at: Mapping[str, float] = field(default_factory=dict)
    urgent: frozenset[str] = frozenset()
    pose: Pose | None = None
    localised: bool = False
    trail: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    plan: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    others: Mapping[str, Pose] = field(default_factory=dict)
    pose_time: float = 0.0
    lidar: tuple[float, NDArray[np.float64]] | None = None
    scan: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    obstacles: NDArray[np.float64] | None = None
    containers: tuple[MachineContainer, ...] = ()
    active: tuple[str, ...] = ()
    paused: bool = False
    waiting: tuple[str, ...] = ()
    stopped: bool = False
    transitions: tuple[MachineTransition, ...] = ()
    detections: tuple[tuple[int, bool, bool, float], ...] = ()
    markers: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    camera: tuple[float, NDArray[np.float64]] | None = None
    stands: bool = False
    scan_progress: tuple[int, int] | None = None
    requests: Mapping[str, str] = field(default_factory=dict)
    health: Mapping[str, NodeReport] = field(default_factory=dict)
    silent: Mapping[str, str] = field(default_factory=dict)
    share: PatrolShare | None = None
    events: tuple[Event, ...] = ()
    history: MissionHistory = MissionHistory()


def follow(old: MissionState, new: MissionState, at: float) -> tuple[MissionState, list[Change]]:
    """Return `new` with its events, restarts and history, and what changed since `old`.

    Args:
        old, new: Two moments.
        at: The later one, seconds since 1970.
    """
    told = list(changes(old, new))
    events = [Event(at, each.text, each.shared) for each in told if not each.routine]
    more: dict[str, object] = {}
    if events:
        more['events'] = (*new.events, *events)[-KEPT_EVENTS:]
    if new.nodes is not old.nodes and (again := restarted(old, new)):
        more['restarts'] = {**new.restarts, **{n: new.restarts.get(n, 0) + 1 for n in again}}
    history = _history(old, new)
    if history != new.history:
        more['history'] = history
    return (replace(new, **more) if more else new), told  # type: ignore[arg-type]


def restarted(old: MissionState, new: MissionState) -> list[str]:
    """Return the nodes that came back, or of which a new process is there."""
    back = old.ended & new.nodes.keys()
    renewed = {
        node
        for node in old.nodes.keys() & new.nodes.keys()
        if old.nodes[node] and new.nodes[node] - old.nodes[node]
    }
    return sorted(back | renewed)


def changes(old: MissionState, new: MissionState) -> Iterator[Change]:
    """Yield what is new in a snapshot, one line each, as a log would tell it."""
    if new.status is not None and new.status != old.status:
        yield from _status_changes(old.status, new.status)
    if new.decision is not None and (new.decision, new.number) != (old.decision, old.number):
        again = old.decision is not None and _waits(new.decision) and _waits(old.decision)
        yield Change(_decision_line(new), detail=new.decision.reason, routine=again)
    if new.battery is not None:
        before = None if old.battery is None else math.ceil(old.battery / BATTERY_STEP)
        if before != math.ceil(new.battery / BATTERY_STEP):
            yield Change(f'battery at {new.battery:.0f} %', routine=True)
    if new.battery_low != old.battery_low:
        yield Change('battery low' if new.battery_low else 'battery no longer low')
    if new.grid is not None and new.grid is not old.grid:
        rows, columns = new.grid.cells.shape
        cells = f'{columns} x {rows} cells of {new.grid.resolution:g} m'
        yield Change(f'a map of {cells}', routine=True, shared=True)
    doors, before_doors = new.doors or {}, old.doors or {}
    for door, is_open in doors.items():
        if is_open != before_doors.get(door, True):
            yield Change(f'door {door} {"opened" if is_open else "closed"}', shared=True)
    if old.urgent != new.urgent:
        for place in sorted(new.urgent - old.urgent):
            yield Change(f'{place} is URGENT', shared=True)
    if new.obstacles is not None and new.obstacles is not old.obstacles:
        had, has = old.obstacles is not None and len(old.obstacles), len(new.obstacles)
        if has and not had:
            x, y = new.obstacles[0]
            yield Change(f'something stands at ({x:.1f}, {y:.1f})')
        elif had and not has:
            yield Change('nothing stands about any more')
    if old.stopped != new.stopped:
        yield Change(STOPPED if new.stopped else 'the robot is released')
    if old.paused != new.paused:
        yield Change('the state machine is paused' if new.paused else 'the state machine continues')
    if is_out(new) != is_out(old):
        yield Change('taken out of the patrol' if is_out(new) else 'put back into the patrol')
    for each in new.waiting:
        if each not in old.waiting:
            yield Change(f'approval is waited for: {each}')
    yield from _node_changes(old, new)


def _waits(decision: Decision) -> bool:
    """Tell whether the robot stays where it is until another one has made way."""
    return decision.place == decision.from_place


def is_out(snapshot: MissionState) -> bool:
    """Tell whether a person took the robot out of its fleet's patrol."""
    return snapshot.share is not None and snapshot.share.taken_out


def doing(snapshot: MissionState) -> str:
    """Return in a few words what the robot is about."""
    status, share = snapshot.status, snapshot.share
    if status is None:
        return 'begins' if snapshot.nodes else 'not heard yet'
    if not snapshot.nodes:
        return 'not heard any more'
    if snapshot.stopped:
        return 'stopped'
    if status.waiting_for_help:
        return 'waits for help'
    if snapshot.paused:
        return 'paused'
    if is_out(snapshot):
        return 'taken out of the patrol'
    if share is not None and share.dock and share.dock == status.place:
        return f'charging at {share.dock}'
    if share is not None and share.heading_to:
        kind = 'on its way to' if share.is_moving else 'waits to go to'
        to_charge = f' to charge at {share.dock}' if share.dock else ''
        return f'{kind} {share.heading_to}{to_charge}'
    if status.heading_to not in ('', status.place):
        return f'on its way to {status.heading_to}'
    return (status.state or 'begins').lower().replace('_', ' ')


def shares(snapshot: MissionState) -> str:
    """Return which places of a fleet's patrol are the robot's; empty: it is in no fleet."""
    share = snapshot.share
    if share is None:
        return ''
    if not share.tour:
        return 'no share'
    return f'shares {", ".join(share.tour)}, next {share.stop}'


def troubles(snapshot: MissionState) -> list[str]:
    """Return what a person should look at, in words, the most important first."""
    found = []
    status = snapshot.status
    if snapshot.stopped:
        found.append('stopped until a person releases it')
    if status is not None and status.waiting_for_help:
        found.append(f'waits for help: {status.text}')
    if status is not None and not snapshot.nodes:
        return [*found, 'none of its programs is heard']
    if snapshot.ended:
        found.append(f'ended: {", ".join(sorted(snapshot.ended))}')
    start = f'{snapshot.namespace}/' if snapshot.namespace else ''
    silent = []
    for name, each in sorted(snapshot.health.items()):
        own = name.removeprefix(start)
        is_own = name.startswith(start) and '/' not in own
        if not is_own or each.level < ERROR or own.partition(':')[0] in snapshot.ended:
            continue
        if each.level == STALE:
            silent.append(own)
        else:
            found.append(f'{own}: {each.message}')
    if silent:
        found.append(f'silent: {", ".join(silent)}')
    return found


def _decision_line(snapshot: MissionState) -> str:
    """Return the decision without its reason."""
    decision = snapshot.decision
    assert decision is not None
    return f'decision {snapshot.number}: {decision.from_place} → {decision.place} [{decision.rule}]'


def why(snapshot: MissionState) -> tuple[str, str] | None:
    """Return what the robot is about and the reason: the decision, or what it waits for."""
    status, decision = snapshot.status, snapshot.decision
    if snapshot.stopped:
        return STOPPED, 'until a person releases it'
    if status is not None and status.waiting_for_help:
        return WAITS_FOR_HELP, status.text
    return None if decision is None else (_decision_line(snapshot), decision.reason)


def _node_changes(old: MissionState, new: MissionState) -> Iterator[Change]:
    if old.nodes is new.nodes and old.ended is new.ended:
        return
    if old.nodes and not new.nodes:
        yield Change('every node has ended: waiting for the next mission')
    elif gone := sorted(new.ended - old.ended):
        yield Change(f'{", ".join(gone)} ended')
    if back := sorted(old.ended & new.nodes.keys()):
        yield Change(f'{", ".join(back)} came back')
    for node in restarted(old, new):
        if node not in old.ended:
            yield Change(f'{node} was started again')


def _status_changes(old: Status | None, new: Status) -> Iterator[Change]:
    before = old and (old.machine, old.state, old.whereabouts)
    if before != (new.machine, new.state, new.whereabouts):
        state = new.state or 'not started'
        yield Change(f'{new.machine} {state}: {new.whereabouts}', routine=True)
    if new.text and (old is None or new.text != old.text):
        yield Change(f'{WAITS_FOR_HELP}: {new.text}' if new.waiting_for_help else new.text)


def _history(old: MissionState, new: MissionState) -> MissionHistory:
    history = new.history
    if (
        new.visited_at is old.visited_at
        and new.battery == old.battery
        and new.transitions is old.transitions
    ):
        return history
    visits = [
        (at, place)
        for place, at in new.visited_at.items()
        if at > max(0.0, old.visited_at.get(place, 0.0))
    ]
    battery = []
    if new.battery is not None and (
        not history.battery or abs(history.battery[-1][1] - new.battery) >= 1.0
    ):
        battery.append((new.now, new.battery))
    last = old.transitions[-1].sequence if old.transitions else 0
    # The sequence of a machine that was started again begins anew.
    if new.transitions and new.transitions[-1].sequence < last:
        last = 0
    marks = [mark for each in new.transitions if each.sequence > last for mark in _marks(each)]
    since = new.now - HISTORY_SECONDS

    def recent(entries: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(each for each in entries if each[0] >= since)[-MOST_HISTORY:]

    return MissionHistory(
        recent((*history.visits, *sorted(visits))),
        recent((*history.battery, *battery)),
        recent((*history.marks, *marks)),
    )


def _marks(transition: MachineTransition) -> Iterator[tuple[float, str, str]]:
    """Yield the marks of a transition on the strips of time."""
    if re.search('RECHARG|CHARGING', transition.to_state):
        yield transition.time, 'recharge', transition.to_state
    elif 'HELP' in transition.to_state:
        yield transition.time, 'help', f'{transition.from_state} {transition.outcome}'
    elif transition.outcome == 'failed':
        yield transition.time, 'failure', f'{transition.from_state} failed'
    elif transition.from_state == 'RECOVER':
        yield transition.time, 'recovery', transition.outcome
