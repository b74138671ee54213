"""The machines' peers on the robot: services and actions behind the ports.

Deadlines are steady time and come from the node's parameters; what takes long on the mission's
clock (a move, a charge) has none but that its server lives and gets on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from std_srvs.srv import Empty

from surveillance_behaviour import conversions
from surveillance_behaviour.mission.battery_gauge import BatteryGauge
from surveillance_behaviour.peers.armor_knowledge import ArmorKnowledge, Whereabouts
from surveillance_behaviour.peers.ports import (
    InterruptedWaitError,
    PeerError,
    Point,
    UnknownPlaceError,
)
from surveillance_behaviour.peers.ros_calls import ask, call, run
from surveillance_fsm import Interrupt
from surveillance_interfaces.action import ComputePath, Control, FollowPath, Plan
from surveillance_interfaces.msg import RobotPlace
from surveillance_interfaces.srv import Reason, ReferenceName, RoomPosition
from surveillance_ontology.armor_client import RosTransport
from surveillance_runtime import waiting
from surveillance_runtime.calls import GoalCaller, ServiceCaller
from surveillance_runtime.conversions import nanoseconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS


@dataclass(frozen=True)
class Deadlines:
    """Seconds of steady time; 0 where a peer may take as long as it lives.

    Attributes:
        answer: For a service's answer, and for a goal to be accepted.
        build: For the ontology's map, and for looking around at the start.
        plan: For a path.
        move: For following one.
        charge: For the battery to get on while it is charged.
    """

    answer: float = 5.0
    build: float = 120.0
    plan: float = 600.0
    move: float = 600.0
    charge: float = 60.0


def ros_knowledge(node: PatrolNode, deadlines: Deadlines) -> ArmorKnowledge:
    """The ontology over ``armor_interface_serialized_srv`` and ``ontology_map/reference_name``."""
    names = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
    wake = waiting.Interrupt()

    def reference(interrupt: Interrupt) -> str:
        request = ReferenceName.Request()
        answer = ask(names, request, deadlines.build, interrupt, deadlines.answer)
        if not answer.name:
            raise PeerError(names.name, 'the reference name is empty')
        return str(answer.name)

    transport = RosTransport(
        node, 'armor_interface_srv', 'armor_interface_serialized_srv', deadlines.answer, wake
    )
    whereabouts = Whereabouts()
    node.create_subscription(
        RobotPlace,
        'robot_place',
        lambda told: whereabouts.note(told.place, nanoseconds_of(told.header.stamp)),
        STATE_QOS,
    )
    return ArmorKnowledge(
        node.get_name(), transport, wake, reference, whereabouts, deadlines.answer
    )


class RosPlaces:
    """Positions of places, from ``ontology_map/room_position``."""

    def __init__(self, node: PatrolNode, deadlines: Deadlines) -> None:
        self._deadlines = deadlines
        self._service = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')

    def position(self, place: str, interrupt: Interrupt) -> Point:
        """A point in the place."""
        request = RoomPosition.Request(room_name=place)
        answer = call(self._service, request, self._deadlines.answer, interrupt)
        if not answer.valid:
            raise UnknownPlaceError(self._service.name, f'there is no place {place}')
        return conversions.point_from(answer.position)


class RosMotion:
    """``compute_path`` and ``follow_path``."""

    def __init__(self, node: PatrolNode, deadlines: Deadlines) -> None:
        self._deadlines = deadlines
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        self._controller = GoalCaller(node, FollowPath, 'follow_path')
        self._position: Point | None = None

    def plan(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        """A path from ``start`` to ``goal``."""
        request = ComputePath.Goal(
            start=conversions.point_message(start), goal=conversions.point_message(goal)
        )
        limits = self._deadlines
        result = run(self._planner, request, limits.answer, limits.plan, interrupt)
        return conversions.points_from(result.path)

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drives along the path."""
        request = FollowPath.Goal(path=conversions.point_messages(path))
        limits = self._deadlines

        def moved(feedback: FollowPath.Feedback) -> None:
            self._position = conversions.point_from(feedback.position)

        result = run(self._controller, request, limits.answer, limits.move, interrupt, moved)
        self._position = conversions.point_from(result.position)
        return self._position

    def last_position(self) -> Point | None:
        """Where the robot was when it was last heard of."""
        return self._position


class RosRoutine:
    """``start``, ``reason``, ``motion/planner``, ``motion/controller`` and ``recharge``."""

    def __init__(self, node: PatrolNode, deadlines: Deadlines, gauge: BatteryGauge) -> None:
        self._deadlines = deadlines
        self._gauge = gauge
        self._start = ServiceCaller(node, Empty, 'start')
        self._reason = ServiceCaller(node, Reason, 'reason')
        self._planner = GoalCaller(node, Plan, 'motion/planner')
        self._controller = GoalCaller(node, Control, 'motion/controller')
        self._recharge = ServiceCaller(node, Empty, 'recharge')

    def start(self, interrupt: Interrupt) -> None:
        """Has the robot look around and build the ontology."""
        limits = self._deadlines
        ask(self._start, Empty.Request(), limits.build, interrupt, limits.answer)

    def reason(self, interrupt: Interrupt) -> str:
        """The reasoner's choice."""
        answer = call(self._reason, Reason.Request(), self._deadlines.answer, interrupt)
        if not answer.point:
            raise PeerError(self._reason.name, 'it names no place; its log says why')
        return str(answer.point)

    def plan(self, target: str, interrupt: Interrupt) -> list[Point]:
        """Via points to the place."""
        limits = self._deadlines
        goal = Plan.Goal(target=target)
        result = run(self._planner, goal, limits.answer, limits.plan, interrupt)
        return conversions.points_from(result.via_points)

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drives through the points."""
        limits = self._deadlines
        goal = Control.Goal(point_set=conversions.point_messages(via_points))
        result = run(self._controller, goal, limits.answer, limits.move, interrupt)
        return conversions.point_from(result.reached_point)

    def recharge(self, interrupt: Interrupt) -> None:
        """Has the battery charged; gives up when its level does not change for too long.

        A service cannot tell that it still works on the answer, and a full charge may take an
        hour: the battery's level is what shows that it does.
        """
        stalled = threading.Event()
        either = Interrupt()

        def give_up() -> None:
            stalled.set()
            either.set()

        watchdog = _Watchdog(self._deadlines.charge, give_up)
        forget = (interrupt.subscribe(either.set), self._gauge.watch(watchdog.feed))
        try:
            watchdog.feed()
            limits = self._deadlines
            call(self._recharge, Empty.Request(), LONGEST_CHARGE, either, limits.answer)
        except InterruptedWaitError:
            if interrupt.is_set() or not stalled.is_set():
                raise
            raise PeerError(
                self._recharge.name, f'nothing came from it for {self._deadlines.charge:g} s'
            ) from None
        finally:
            for end in forget:
                end()
            watchdog.stop()


LONGEST_CHARGE = 24 * 3600.0
"""The longest time a charge may take even when it gets on, seconds."""


class _Watchdog:
    """Calls back when it was not fed for a while."""

    def __init__(self, seconds: float, bark: Callable[[], None]) -> None:
        self._seconds = seconds
        self._bark = bark
        self._timer: threading.Timer | None = None

    def feed(self) -> None:
        """Starts the time anew."""
        self.stop()
        if self._seconds > 0.0:
            self._timer = threading.Timer(self._seconds, self._bark)
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        """Never calls back again."""
        if self._timer is not None:
            self._timer.cancel()
