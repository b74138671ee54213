"""What is known of a mission at one moment: one record, which every view shows.

The terminal, the page and the recording's time line show a `MissionState`. It is immutable. Its
fields stand in records by what they tell of: the task, the state machine, the place, what the
sensors say, the health of the programs. `MissionState.having` changes any of them by its name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid, Zone
from floor_plans.shapes import Segment
from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.situation import Decision
from surveillance_runtime.incidents import Cause, IncidentUpdate

NO_POINTS: NDArray[np.float64] = np.empty((0, 2))
TRAIL_STEP = 0.1
"""Least distance of two points of a trail, metres."""
ERROR, STALE = 2, 3
"""Levels of a node's report: of what does not work, and of what no longer reports."""

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
class Notice:
    """Something that has changed, in words: a line of the views.

    Attributes:
        text: In short.
        detail: What a log says, too.
        routine: Whether the views show it anyway, so that it is no line of theirs.
        shared: Whether it is of the place, so that whoever watches another robot sees it, too.
        at: When, seconds since 1970; 0: just now.
    """

    text: str
    detail: str = ''
    routine: bool = False
    shared: bool = False
    at: float = 0.0


@dataclass(frozen=True)
class FleetReport:
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
class TaskView:
    """What the robot is to do, and does.

    Attributes:
        mode: The controllers' execution mode.
        threshold, policy: The behaviour's parameters.
        status: The latest `mission_status`, kept when its node ends.
        decision, decision_number: The latest decision, and its number.
        idleness_bounds, hours: Of each place, and the hours of those that have some.
        requests: What each controller in MANUAL mode announced last.
        fleet_report: What it tells the other robots of a fleet; None: there are none.
        stopped: Whether a person has stopped the robot.
        battery, battery_low: Percent, and whether that is low.
    """

    mode: str = ''
    threshold: float | None = None
    policy: str = ''
    status: Status | None = None
    decision: Decision | None = None
    decision_number: int = 0
    idleness_bounds: tuple[IdlenessBound, ...] = ()
    hours: Mapping[str, str] = field(default_factory=dict)
    requests: Mapping[str, str] = field(default_factory=dict)
    fleet_report: FleetReport | None = None
    stopped: bool = False
    battery: float | None = None
    battery_low: bool = False

    @property
    def is_out(self) -> bool:
        """Whether a person took the robot out of its fleet's patrol."""
        return self.fleet_report is not None and self.fleet_report.taken_out


@dataclass(frozen=True)
class MachineView:
    """The state machine.

    Attributes:
        containers: Its parts, outermost first.
        active: Paths of the states that are active, outermost first.
        paused: Whether it enters no further state.
        waiting: The transitions that wait for a person's approval.
        transitions: The latest transitions.
    """

    containers: tuple[MachineContainer, ...] = ()
    active: tuple[str, ...] = ()
    paused: bool = False
    waiting: tuple[str, ...] = ()
    transitions: tuple[MachineTransition, ...] = ()


@dataclass(frozen=True)
class PlaceView:
    """The place, and what is known of it.

    Attributes:
        grid: The map.
        positions: A point in each place, metres.
        links: Pairs of places that are joined by an open door.
        doors: Whether each door is open.
        door_lines: The doors' openings: x1, y1, x2, y2, metres.
        zones: Where the robot never drives, and where it drives slowly, by name.
        stations: The charging stations' poses by their rooms.
        visited_at: When each place was visited last, seconds of the mission's time; 0: never yet.
        urgent: The places that the ontology has as URGENT.
        others: Where other robots are, by namespace.
        coverage: Which part of each place was in view within its threshold, 0 to 1.
    """

    grid: Grid | None = None
    positions: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    links: frozenset[tuple[str, str]] = frozenset()
    doors: Mapping[str, bool] | None = None
    door_lines: Mapping[str, Segment] = field(default_factory=dict)
    zones: Mapping[str, Zone] = field(default_factory=dict)
    stations: Mapping[str, Pose] = field(default_factory=dict)
    visited_at: Mapping[str, float] = field(default_factory=dict)
    urgent: frozenset[str] = frozenset()
    others: Mapping[str, Pose] = field(default_factory=dict)
    coverage: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SensorView:
    """Where the robot is, where it drives, and what it sees.

    Attributes:
        robot_place: The place that the robot is in, by the node that localises it; empty: unknown.
        pose: Where the robot is.
        pose_time: The stamp of the pose, seconds.
        localised: Whether somebody estimates the pose from sensors.
        stands: Whether the robot stood still between its last two poses.
        trail: Where it drove, shape (n, 2), metres, oldest first.
        plan: The planned path, shape (n, 2), metres.
        lidar: The latest scan: its stamp, and its points in the robot's frame.
        scan: What the lidar sees, shape (n, 2), metres, map frame.
        obstacles: What stands about, shape (n, 2), metres.
        detections: The markers of the latest image: id, whether the list of markers has it, whether
            it is confirmed, confidence.
        markers: Where confirmed markers stand by their ids, metres.
        camera: While the arm stands still: its stamp, and the transform (4, 4) from the camera's
            optical frame to the robot.
        scan_progress: View and number of views of the arm's scan.
    """

    robot_place: str = ''
    pose: Pose | None = None
    pose_time: float = 0.0
    localised: bool = False
    stands: bool = False
    trail: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    plan: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    lidar: tuple[float, NDArray[np.float64]] | None = None
    scan: NDArray[np.float64] = field(default_factory=lambda: NO_POINTS)
    obstacles: NDArray[np.float64] | None = None
    detections: tuple[tuple[int, bool, bool, float], ...] = ()
    markers: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    camera: tuple[float, NDArray[np.float64]] | None = None
    scan_progress: tuple[int, int] | None = None


@dataclass(frozen=True)
class HealthView:
    """The programs of the mission.

    Attributes:
        nodes: The nodes that tell or answer anything of this, and what tells the processes of one
            apart that was started again.
        ended: Those that did and are gone.
        restarts: How often a node was seen to start again.
        reports: What the nodes report, by name.
        silent: Why nothing comes on a topic, where that is known.
        incidents: What goes wrong, as its owner told it last, by owner and cause.
    """

    nodes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    ended: frozenset[str] = frozenset()
    restarts: Mapping[str, int] = field(default_factory=dict)
    reports: Mapping[str, NodeReport] = field(default_factory=dict)
    silent: Mapping[str, str] = field(default_factory=dict)
    incidents: Mapping[tuple[str, Cause], IncidentUpdate] = field(default_factory=dict)


@dataclass(frozen=True)
class MissionState:
    """All that came so far; None and empty for what did not.

    Attributes:
        where: Where the watcher listens, in words.
        namespace: Of the robot, without slashes.
        now: The mission's time, seconds.
        task, machine, place, sensors, health: What is known of each.
        measured: What came for the figures that have a topic of their own, by name (`figures`).
        notices: The latest changes; routine ones left out.
        history: What happened in the last hour.
    """

    where: str = ''
    namespace: str = ''
    now: float = 0.0
    task: TaskView = TaskView()
    machine: MachineView = MachineView()
    place: PlaceView = PlaceView()
    sensors: SensorView = SensorView()
    health: HealthView = HealthView()
    measured: Mapping[str, Any] = field(default_factory=dict)
    notices: tuple[Notice, ...] = ()
    history: MissionHistory = MissionHistory()

    def having(self, **values: Any) -> MissionState:
        """Return the state with other values of some fields, whichever record they stand in.

        Raises:
            KeyError: There is no field of that name.
        """
        by_record: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            by_record.setdefault(RECORD_OF[name], {})[name] = value
        own = by_record.pop('', {})
        for record, changed in by_record.items():
            own[record] = replace(getattr(self, record), **changed)
        return replace(self, **own)

    def field(self, name: str) -> Any:
        """Return the value of a field, whichever record it stands in.

        Raises:
            KeyError: There is no field of that name.
        """
        record = RECORD_OF[name]
        return getattr(getattr(self, record) if record else self, name)

    @property
    def robot_place(self) -> str:
        """The place that the robot is in, for all views; empty: unknown.

        The node that localises the robot says it at once. `mission_status` has it as of the last
        transition of the state machine, and counts where nobody else says it.
        """
        status = self.task.status
        return self.sensors.robot_place or (status.place if status is not None else '')

    @property
    def whereabouts(self) -> str:
        """Where the robot is, and where it goes, in words."""
        place, status = self.robot_place, self.task.status
        if not place:
            return 'in no place that is known yet'
        if status is None or status.heading_to in ('', place):
            return f'in {place}'
        return f'in {place}, heading for {status.heading_to}'


RECORDS: Mapping[str, type[Any]] = {
    '': MissionState,
    'task': TaskView,
    'machine': MachineView,
    'place': PlaceView,
    'sensors': SensorView,
    'health': HealthView,
}
"""The records of a state by the names that they have in it; the state itself has none."""
RECORD_OF: Mapping[str, str] = {
    each.name: name for name, record in RECORDS.items() for each in fields(record)
}
"""The record of each field; no two records have a field of the same name."""
