"""What the robots of a fleet tell each other on `fleet_robots`, and what is believed of it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

from patrol_policy.fleet import FleetRobot, FleetSettings, Intention, Layout, PartitionCell
from strict_files.settings import parameter
from surveillance_behaviour.fleet import FleetFacts, FleetKnowledge
from surveillance_interfaces.msg import FleetRobot as FleetRobotMessage
from surveillance_runtime.fleet_messages import FLEET_QOS, FLEET_TOPIC, hear_fleet
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import AHEAD, AHEAD_SIMULATED

REPEAT = 1.0
"""Seconds of the mission's time between two signs of life."""
MOST_STOPS = 10_000


@dataclass(frozen=True)
class FleetParameters:
    """What a node that decides for one robot of several is told."""

    fleet: bool = parameter(
        False, 'Whether the patrol is shared with other robots, by the topic fleet_robots.'
    )
    silent_after: float = parameter(
        10.0,
        'A robot of the fleet that was not heard for so long has no share, s.',
        0.5,
        3600.0,
        name='fleet_silent_after',
    )
    docks: tuple[str, ...] = parameter(
        (),
        'Rooms with a station for any robot of the fleet, which all its robots are to know alike; '
        'empty: recharge_rooms. A robot itself charges in its recharge_rooms.',
        of=str,
        name='fleet_docks',
    )
    wide_places: tuple[str, ...] = parameter(
        (), 'Places in which two robots can pass.', of=str, name='traffic.wide_places'
    )
    wide_ways: tuple[str, ...] = parameter(
        (),
        'Pairs of places, as `A B`, whose door two robots can pass side by side.',
        of=str,
        name='traffic.wide_ways',
    )


def fleet_of(node: PatrolNode, robot: str, docks: tuple[str, ...]) -> FleetKnowledge | None:
    """Declare the parameters and join the fleet; None: the robot is alone.

    Args:
        node: The node that decides.
        robot: Its robot's name.
        docks: The places with a charging station for this robot.
    """
    settings = node.declare_fields(FleetParameters())
    if not settings.fleet:
        return None

    def now() -> float:
        return float(1e-9 * node.get_clock().now().nanoseconds)

    publisher = node.create_publisher(FleetRobotMessage, FLEET_TOPIC, FLEET_QOS)

    def publish(facts: FleetFacts) -> None:
        message = message_of(facts)
        message.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    knowledge = FleetKnowledge(
        robot,
        FleetSettings(
            silent_after=settings.silent_after, docks=settings.docks or docks, own_docks=docks
        ),
        Layout.of(settings.wide_places, settings.wide_ways),
        publish,
        time.monotonic,
    )

    ahead = AHEAD_SIMULATED if node.get_parameter('use_sim_time').value else AHEAD
    early: set[str] = set()

    def on_message(message: FleetRobotMessage) -> None:
        try:
            facts = facts_of(message)
        except ValueError as error:
            node.get_logger().error(f'{FLEET_TOPIC}: {error}')
            return
        heard = now()
        believed = without_future(facts, heard + ahead)
        if believed is facts:
            early.discard(facts.robot.name)
        elif facts.robot.name not in early:
            early.add(facts.robot.name)
            node.get_logger().error(
                f'{FLEET_TOPIC}: {facts.robot.name} tells visits up to '
                f'{max(facts.visits.values()) - heard:.0f} s ahead of this clock, which are not '
                f'counted; expected at most {ahead:g} s'
            )
        knowledge.hear(believed, heard)

    told: set[str] = set()

    def on_period() -> None:
        knowledge.repeat()
        standing = knowledge.standing(now())
        for name, text in standing.items():
            node.incidents.begin(('robot', name), text)
        for name in told - standing.keys():
            node.incidents.end(('robot', name))
        told.clear()
        told.update(standing)

    hear_fleet(node, on_message, own=robot)
    node.create_timer(REPEAT, on_period)
    return knowledge


def message_of(facts: FleetFacts) -> FleetRobotMessage:
    """Return a robot's facts as a message, without stamp."""
    robot, intention = facts.robot, facts.intention
    return FleetRobotMessage(
        robot=robot.name,
        place=robot.place,
        since=robot.since,
        tour=[] if robot.cell is None else list(robot.cell.tour),
        stop='' if robot.cell is None else robot.cell.stop,
        dock=robot.dock or '',
        charging_until=_number(robot.charging_until),
        runs_until=_number(robot.runs_until),
        charge_seconds=robot.charge_seconds,
        taken_out=robot.taken_out,
        heading_to=intention.heading_to,
        wanted_since=intention.since,
        is_moving=intention.is_moving,
        visited=list(facts.visits),
        visited_at=[float(at) for at in facts.visits.values()],
    )


def facts_of(message: FleetRobotMessage) -> FleetFacts:
    """Return the facts of a message.

    Raises:
        ValueError: A number is not finite, or lists do not fit together.
    """
    numbers = (message.since, message.charge_seconds, message.wanted_since, *message.visited_at)
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f'{message.robot or "a robot"} tells a time that is not finite')
    if len(message.visited) != len(message.visited_at):
        raise ValueError(
            f'{message.robot}: {len(message.visited_at)} times for {len(message.visited)} places'
        )
    if max(len(message.tour), len(message.visited)) > MOST_STOPS:
        raise ValueError(f'{message.robot}: more places than any map has')
    tour = tuple(message.tour)
    cell = PartitionCell(tour, message.stop) if message.stop in tour else None
    robot = FleetRobot(
        message.robot,
        message.place,
        since=message.since,
        cell=cell,
        charging_until=_maybe(message.charging_until),
        dock=message.dock or None,
        runs_until=_maybe(message.runs_until),
        charge_seconds=message.charge_seconds,
        taken_out=message.taken_out,
    )
    intention = Intention(
        message.robot,
        message.place,
        message.heading_to,
        message.wanted_since,
        message.is_moving,
        is_fixed=bool(message.dock) and not message.heading_to,
    )
    visits = dict(zip(message.visited, message.visited_at, strict=True))
    return FleetFacts(robot, intention, visits)


def without_future(facts: FleetFacts, latest: float) -> FleetFacts:
    """Return a robot's facts without the visits that no clock has reached; itself if none are.

    A robot whose clock is ahead would have its places pass for visited until the others come there.

    Args:
        facts: What was heard.
        latest: The latest visit that is believed, seconds on the mission's clock.
    """
    visits = {place: at for place, at in facts.visits.items() if at <= latest}
    return facts if len(visits) == len(facts.visits) else replace(facts, visits=visits)


def _number(value: float | None) -> float:
    return math.nan if value is None or not math.isfinite(value) else value


def _maybe(value: float) -> float | None:
    return value if math.isfinite(value) else None
