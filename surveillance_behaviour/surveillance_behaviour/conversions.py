"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point as PointMessage
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState

from surveillance_behaviour.fsm.active import ActiveContainer
from surveillance_behaviour.fsm.export import to_mermaid
from surveillance_behaviour.fsm.record import Transition
from surveillance_behaviour.fsm.structure import structure_of
from surveillance_behaviour.map_raster import Grid, Pose
from surveillance_behaviour.mission_snapshot import Status
from surveillance_behaviour.policy.situation import Decision
from surveillance_behaviour.ports import Point
from surveillance_behaviour.survey import PlaceNote
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.msg import (
    DoorStates,
    FsmContainer,
    FsmEdge,
    FsmStatus,
    FsmStructure,
    FsmTransition,
    MissionStatus,
    OntologyMap,
    OntologyPlace,
    RoomConnection,
)
from surveillance_runtime.stamps import seconds_of


def point_from(message: PointMessage) -> Point:
    """A point in metres."""
    return (message.x, message.y, message.z)


def point_message(point: Sequence[float]) -> PointMessage:
    """A point from x, y and perhaps z, metres."""
    x, y, z = (*(float(value) for value in point), 0.0)[:3]
    return PointMessage(x=x, y=y, z=z)


def points_from(messages: Iterable[PointMessage]) -> list[Point]:
    """A path in metres."""
    return [point_from(message) for message in messages]


def point_messages(points: Iterable[Sequence[float]]) -> list[PointMessage]:
    """A path as messages."""
    return [point_message(point) for point in points]


def decision_message(decision: Decision, sequence: int, stamp: Any) -> DecisionMessage:
    """A decision, numbered and stamped."""
    return DecisionMessage(
        stamp=stamp,
        sequence=sequence,
        policy=decision.policy,
        from_place=decision.from_place,
        place=decision.place,
        target=decision.target,
        rule=decision.rule,
        reason=decision.reason,
        candidates=list(decision.scores),
        scores=[float(value) for value in decision.scores.values()],
    )


def decision_from(message: DecisionMessage) -> Decision:
    """A decision as it was published."""
    return Decision(
        time=seconds_of(message.stamp),
        from_place=message.from_place,
        place=message.place,
        target=message.target,
        rule=message.rule,
        policy=message.policy,
        reason=message.reason,
        scores=dict(zip(message.candidates, message.scores, strict=True)),
    )


def charging_from(message: BatteryState) -> bool | None:
    """Whether a battery is being charged, or is full at its charger; None: it does not say."""
    status = message.power_supply_status
    if status in (
        BatteryState.POWER_SUPPLY_STATUS_CHARGING,
        BatteryState.POWER_SUPPLY_STATUS_FULL,
    ):
        return True
    return None if status == BatteryState.POWER_SUPPLY_STATUS_UNKNOWN else False


def status_from(message: MissionStatus) -> Status:
    """What the machine does, as it was published."""
    return Status(
        since=seconds_of(message.stamp),
        machine=message.machine,
        state=message.state,
        place=message.place,
        heading_to=message.heading_to,
        waiting_for_help=message.waiting_for_help,
        text=message.text,
        avoided=tuple(message.avoided),
    )


def doors_from(message: DoorStates) -> dict[str, bool]:
    """Whether each door is open, by name."""
    states = {**dict.fromkeys(message.open, True), **dict.fromkeys(message.closed, False)}
    return dict(sorted(states.items()))


def pose_from(message: PoseMessage) -> Pose:
    """x, y in metres and yaw in radians of a pose."""
    q = message.orientation
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    return message.position.x, message.position.y, yaw


def grid_from(message: OccupancyGrid) -> Grid:
    """A map.

    Raises:
        ValueError: It has no cells, not as many as it says, or is turned.
    """
    info = message.info
    cells = np.array(message.data, dtype=np.int8)
    if not cells.size or cells.size != info.width * info.height or info.resolution <= 0:
        size = f'{info.width} x {info.height} of {info.resolution:g} m'
        raise ValueError(f'{cells.size} cells came where it says {size}')
    x, y, yaw = pose_from(info.origin)
    if abs(yaw) > 1e-6:
        raise ValueError(f'it is turned by {yaw:.3f} rad, which is not drawn')
    return Grid(cells.reshape(info.height, info.width), float(info.resolution), (x, y))


def place_note_from(response: Any) -> PlaceNote | None:
    """What a marker stands for, from the answer of `room_info`; None when it is not known."""
    if not response.connections:
        return None
    doors = {each.through_door: each.connected_to for each in response.connections}
    return PlaceNote(response.room, (response.x, response.y), doors)


def map_message(places: Iterable[PlaceNote], robot_room: str) -> OntologyMap:
    """The message that enters places into the ontology."""
    return OntologyMap(
        places=[
            OntologyPlace(
                name=place.room,
                position=point_message(place.position),
                connections=[
                    RoomConnection(connected_to=behind, through_door=door)
                    for door, behind in place.connections.items()
                ],
            )
            for place in places
        ],
        robot_room=robot_room,
    )


def transition_message(transition: Transition, active: list[str], stamp: Any) -> FsmTransition:
    """A transition of a machine, with the paths that are active and the time of publishing."""
    return FsmTransition(
        stamp=stamp,
        sequence=transition.sequence,
        path=transition.path,
        from_state=transition.from_state,
        outcome=transition.outcome,
        to_state=transition.to_state,
        kind=transition.kind,
        duration=float(transition.duration),
        visits=transition.visits,
        active=active,
        userdata_keys=list(transition.userdata),
        userdata_values=[json.dumps(value) for value in transition.userdata.values()],
    )


def transition_from(message: FsmTransition) -> Transition:
    """The transition of a message; its time is the time of publishing, in seconds."""
    return Transition(
        sequence=message.sequence,
        time=seconds_of(message.stamp),
        path=message.path,
        from_state=message.from_state,
        outcome=message.outcome,
        to_state=message.to_state,
        kind=message.kind,
        duration=message.duration,
        visits=message.visits,
        userdata={
            key: json.loads(value)
            for key, value in zip(message.userdata_keys, message.userdata_values, strict=True)
        },
    )


def status_message(root: ActiveContainer, sequence: int, stamp: Any) -> FsmStatus:
    """What a machine's root is doing, after the transition with number `sequence`."""
    return FsmStatus(
        stamp=stamp,
        root=root.get_name(),
        sequence=sequence,
        running=root.is_running(),
        paused=root.control.paused,
        active=root.control.active_paths(),
        left_behind=root.control.left_behind(),
    )


def structure_message(root: ActiveContainer, stamp: Any) -> FsmStructure:
    """A machine's root and all its containers."""
    return FsmStructure(
        stamp=stamp,
        root=root.get_name(),
        containers=[
            FsmContainer(
                path=structure.path,
                kind=structure.kind,
                states=list(structure.states),
                interrupts=list(structure.interrupts),
                initial_states=structure.initial,
                outcomes=structure.outcomes,
                edges=[
                    FsmEdge(from_state=edge.source, outcome=edge.outcome, to_state=edge.target)
                    for edge in structure.edges
                ],
            )
            for structure in structure_of(root).walk()
        ],
        mermaid=to_mermaid(root),
    )
