"""The machines' peers on the robot: topics, services, actions and the log behind the ports.

Deadlines are steady time and come from the node's parameters; what takes long on the mission's
clock (a move, a charge) has none but that its server lives and gets on.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from std_msgs.msg import Bool, UInt8
from std_srvs.srv import Empty

import state_machines as fsm
from state_machines import Interrupt
from state_machines.ros import (
    CallError,
    CallInterruptedError,
    CallTimeoutError,
    ClockWait,
    GoalCaller,
    ServiceCaller,
)
from state_machines.structure import Structure
from strict_files.settings import parameter
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.recovery import WAITING_FOR_HELP
from surveillance_behaviour.ports import Point, UnknownPlaceError
from surveillance_behaviour.ros_adapters.armor_knowledge import ArmorKnowledge, Whereabouts
from surveillance_interfaces.action import ComputePath, Control, FollowPath, Plan
from surveillance_interfaces.msg import MissionStatus, RobotPlace
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor_client import RosTransport, declared_robot_name
from surveillance_runtime.conversions import (
    nanoseconds_of,
    point_from,
    point_message,
    point_messages,
    seconds_of,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

ASK_AGAIN = 10.0
"""How long one question to a service that takes long waits for its answer, seconds."""
MARGIN = 1e-6
"""By how much a wait is announced longer than it is, seconds: more than stamps are rounded by."""
KNOWN_PATIENCE = 1.0
"""How long the map is waited for that tells again what it told before, seconds."""
LONGEST_CHARGE = 24 * 3600.0
"""The longest time a charge may take even when it gets on, seconds."""


class MissionClock(ClockWait):
    """The mission's clock, in seconds of ROS time.

    Under `use_sim_time` it says on `mission_waits_until` until when the mission waits, zero for an
    event, so that a simulator lets no time pass while the mission is at work.
    """

    def __init__(self, node: PatrolNode) -> None:
        super().__init__(node)
        self._topic = None
        if node.get_parameter('use_sim_time').value:
            self._topic = OwnedTopic(node, Time, 'mission_waits_until', repeat=None)

    def sleep(self, seconds: float, interrupt: fsm.Interrupt | None = None) -> bool:
        """Wait; return False when the interrupt ended it early."""
        # A little later than it waits: time that stops a nanosecond early would wake nobody.
        self._announce(self.now() + seconds + MARGIN)
        return super().sleep(seconds, interrupt)

    def wait_for_time(self, interrupt: fsm.Interrupt) -> bool:
        """Wait for the clock's first message; return False when the interrupt came first."""
        if not self.now():
            self._announce(MARGIN)
        return super().wait_for_time(interrupt)

    def wait_for_event(self) -> None:
        """Say that what comes next ends by an event, whenever that is."""
        self._announce(0.0)

    def _announce(self, until: float) -> None:
        if self._topic is not None:
            fraction, whole = math.modf(until)
            self._topic.publish(Time(sec=int(whole), nanosec=int(fraction * 1e9)))


@dataclass(frozen=True)
class Deadlines:
    """Seconds of steady time; 0 where a peer may take as long as it lives."""

    answer: float = parameter(
        5.0,
        "Seconds of real time for a service's answer, and for a goal to be accepted.",
        0.1,
        86_400.0,
    )
    build: float = parameter(
        120.0,
        'Seconds of real time for the ontology to be built, and for looking around at the start.',
        0.1,
        86_400.0,
    )
    plan: float = parameter(
        600.0, 'Seconds of real time for a path; 0: as long as the planner lives.', 0.0, 86_400.0
    )
    move: float = parameter(
        600.0,
        'Seconds of real time for following a path; 0: as long as the controller lives.',
        0.0,
        86_400.0,
    )
    charge: float = parameter(
        60.0,
        'Seconds of real time for the battery to get on while it is charged by `recharge`; '
        '0: for ever.',
        0.0,
        86_400.0,
    )


def ros_ontology(node: PatrolNode, deadlines: Deadlines) -> ArmorKnowledge:
    """Return the ontology over ``armor_interface_serialized_srv``, its reference name over
    ``ontology_map/reference_name``, and the robot's place by the topic ``robot_place``."""
    names = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
    wake = Interrupt()

    def reference(interrupt: Interrupt) -> str:
        request = ReferenceName.Request()
        answer = ask(names, request, deadlines.build, interrupt, deadlines.answer)
        if not answer.name:
            raise CallError(f'{names.name}: the reference name is empty')
        return str(answer.name)

    transport = RosTransport(
        node, 'armor_interface_srv', 'armor_interface_serialized_srv', deadlines.answer, wake
    )
    whereabouts = Whereabouts()
    StateSubscription(
        node,
        RobotPlace,
        'robot_place',
        lambda told: whereabouts.note(told.place, nanoseconds_of(told.header.stamp)),
        stamp=lambda told: seconds_of(told.header.stamp),
        owner='motion_controller',
    )
    return ArmorKnowledge(
        node.get_name(),
        transport,
        wake,
        reference,
        whereabouts,
        deadlines.answer,
        transport.is_ready,
        declared_robot_name(node),
        transport.look_for_answer,
    )


def hear_battery(node: PatrolNode, battery: BatteryMonitor) -> None:
    """Have a monitor follow the topics ``battery_level`` and ``battery_low``."""
    owner = 'battery_controller'
    StateSubscription(
        node, UInt8, 'battery_level', lambda m: battery.set_level(float(m.data)), owner=owner
    )
    StateSubscription(node, Bool, 'battery_low', lambda m: battery.set_low(m.data), owner=owner)


class RosPlaces:
    """Positions of places, from ``ontology_map/room_position``.

    While that does not answer, a place is where it was when it was asked for last.
    """

    def __init__(self, node: PatrolNode, deadlines: Deadlines) -> None:
        self._deadlines = deadlines
        self._service = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        self._known: dict[str, Point] = {}
        self._answers: Callable[[float], bool] | None = None

    def position(self, place: str, interrupt: Interrupt) -> Point:
        """Return a point in the place."""
        request = RoomPosition.Request(room_name=place)
        known = self._known.get(place)
        if known is not None and self._answers is not None and not self._answers(0.0):
            return known
        patience = self._deadlines.answer
        try:
            answer = self._service.call(
                request, patience if known is None else min(KNOWN_PATIENCE, patience), interrupt
            )
        except CallInterruptedError:
            raise
        except CallError:
            if known is None:
                raise
            self._answers = self._service.look_for_answer(request)
            return known
        self._answers = None
        if not answer.valid:
            self._known.pop(place, None)
            raise UnknownPlaceError(f'{self._service.name}: there is no place {place}')
        self._known[place] = point = point_from(answer.position)
        return point


TRACE_STEP = 0.3
"""Least distance between two points of the way driven that are kept, metres."""


class RosMotion:
    """``compute_path`` and ``follow_path``."""

    def __init__(self, node: PatrolNode, deadlines: Deadlines) -> None:
        self._deadlines = deadlines
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        self._controller = GoalCaller(node, FollowPath, 'follow_path')
        self._position: Point | None = None
        self._driven: list[Point] = []

    def plan(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        """Return a path from ``start`` to ``goal``."""
        request = ComputePath.Goal(start=point_message(start), goal=point_message(goal))
        limits = self._deadlines
        result = run(self._planner, request, limits.answer, limits.plan, interrupt)
        return [point_from(each) for each in result.path]

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drive along the path."""
        request = FollowPath.Goal(path=point_messages(path))
        limits = self._deadlines

        def moved(feedback: FollowPath.Feedback) -> None:
            self._moved(point_from(feedback.position))

        result = run(self._controller, request, limits.answer, limits.move, interrupt, moved)
        end = point_from(result.position)
        self._moved(end)
        return end

    def _moved(self, position: Point) -> None:
        self._position = position
        if not self._driven or math.dist(self._driven[-1][:2], position[:2]) >= TRACE_STEP:
            self._driven.append(position)

    def last_position(self) -> Point | None:
        """Return where the robot was when it was last heard of."""
        return self._position

    def driven(self) -> list[Point]:
        """Return where the robot was on its way, since this was asked last."""
        driven, self._driven = self._driven, []
        return driven


class RosRoutine:
    """``start``, ``motion/planner``, ``motion/controller`` and ``recharge``."""

    def __init__(
        self,
        node: PatrolNode,
        deadlines: Deadlines,
        battery: BatteryMonitor,
        clock: MissionClock,
    ) -> None:
        self._deadlines = deadlines
        self._clock = clock
        self._battery = battery
        self._start = ServiceCaller(node, Empty, 'start')
        self._planner = GoalCaller(node, Plan, 'motion/planner')
        self._controller = GoalCaller(node, Control, 'motion/controller')
        self._recharge = ServiceCaller(node, Empty, 'recharge')

    def start(self, interrupt: Interrupt) -> None:
        """Have the robot look around and build the ontology."""
        limits = self._deadlines
        self._clock.wait_for_event()
        ask(self._start, Empty.Request(), limits.build, interrupt, limits.answer)

    def plan(self, target: str, interrupt: Interrupt) -> list[Point]:
        """Via points to the place."""
        limits = self._deadlines
        goal = Plan.Goal(target=target)
        result = run(self._planner, goal, limits.answer, limits.plan, interrupt)
        return [point_from(each) for each in result.via_points]

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        """Drive through the points."""
        limits = self._deadlines
        goal = Control.Goal(point_set=point_messages(via_points))
        result = run(self._controller, goal, limits.answer, limits.move, interrupt)
        return point_from(result.reached_point)

    def recharge(self, interrupt: Interrupt) -> None:
        """Have the battery charged; give up when its level does not change for too long.

        A service cannot tell that it still works on the answer, and a full charge may take an
        hour: the battery's level is what shows that it does.
        """
        stalled = threading.Event()
        either = Interrupt()

        def give_up() -> None:
            stalled.set()
            either.set()

        watchdog = _Watchdog(self._deadlines.charge, give_up)
        forget = (interrupt.subscribe(either.set), self._battery.watch(watchdog.feed))
        try:
            watchdog.feed()
            limits = self._deadlines
            self._clock.wait_for_event()
            self._recharge.call(Empty.Request(), LONGEST_CHARGE, either, discovery=limits.answer)
        except CallInterruptedError:
            if interrupt.is_set() or not stalled.is_set():
                raise
            raise CallError(
                f'{self._recharge.name}: nothing came from it for {self._deadlines.charge:g} s'
            ) from None
        finally:
            for end in forget:
                end()
            watchdog.stop()


class _Watchdog:
    """Calls back when it was not fed for a while."""

    def __init__(self, seconds: float, bark: Callable[[], None]) -> None:
        self._seconds = seconds
        self._bark = bark
        self._timer: threading.Timer | None = None

    def feed(self) -> None:
        """Start the time anew."""
        self.stop()
        if self._seconds > 0.0:
            self._timer = threading.Timer(self._seconds, self._bark)
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        """Never calls back again."""
        if self._timer is not None:
            self._timer.cancel()


def ask(
    caller: ServiceCaller, request: Any, deadline: float, interrupt: Interrupt, discovery: float
) -> Any:
    """Call a service whose answer takes long and that may be asked twice.

    It is asked anew now and then: a server that has just taken the place of another one may have
    been found before its end of the line was there, and does not know that anybody waits.
    """
    late = time.monotonic() + deadline
    while True:
        patience = min(ASK_AGAIN, max(discovery, late - time.monotonic()))
        try:
            return caller.call(request, patience, interrupt, discovery=discovery)
        except CallTimeoutError:
            if time.monotonic() >= late:
                raise


def run(
    caller: GoalCaller,
    goal: Any,
    accept_deadline: float,
    result_deadline: float,
    interrupt: Interrupt,
    on_feedback: Callable[[Any], None] | None = None,
) -> Any:
    """Run a goal to its result.

    Args:
        caller: The action.
        goal: The goal message.
        accept_deadline: Seconds of steady time until the goal is accepted.
        result_deadline: Seconds of steady time for the result; 0: as long as the server lives.
        interrupt: Ends the wait and cancels the goal.
        on_feedback: Called with each feedback message.

    Raises:
        CallError: No server, or the goal was rejected, aborted, or not done in time.
        CallInterruptedError: The interrupt was raised.
    """
    end = caller.run(
        goal,
        accept_timeout=accept_deadline,
        result_timeout=result_deadline or None,
        interrupt=interrupt,
        on_feedback=on_feedback,
    )
    if end.status != 'succeeded':
        raise CallError(f'{caller.name}: the goal was {end.status}')
    return end.result


class RosAnnouncer:
    """The machines' announcer on the robot.

    Args:
        node: The node that speaks.

    Attributes:
        text: What was said last.
        waits: Why the robot waits for help; empty: it does not.
        words: How many transitions and words there were.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._lock = threading.Lock()
        self.text = self.waits = ''
        self.words = 0
        self._status: Callable[[], MissionStatus] = MissionStatus
        # Where the robot was, and where it went, when that was said.
        self._whereabouts: Callable[[], tuple[str, str]] = lambda: ('', '')
        self._said_in = ('', '')
        self._topic = OwnedTopic(node, MissionStatus, 'mission_status')

    def attach(self, mission: Mission, machine: fsm.StateMachine) -> None:
        """Report this machine's state from now on, at every transition and every message."""

        def status() -> MissionStatus:
            level = mission.battery.level
            return MissionStatus(
                stamp=self._node.get_clock().now().to_msg(),
                machine=mission.machine,
                state='/'.join(active_path(machine)),
                place=mission.place,
                heading_to=mission.heading_to,
                battery_level=math.nan if level is None else float(level),
                waiting_for_help=bool(self.waits),
                # What was said in another place, or of another way, is no news of this one.
                text=self.text if self.waits or self._said_in == self._whereabouts() else '',
                avoided=sorted(mission.recovery.avoided(mission.now())),
            )

        self._status = status
        self._whereabouts = lambda: (mission.place, mission.heading_to)
        for inner in Structure(machine).walk():
            inner.container.register_start_cb(lambda _data, _states: self._publish())
            inner.container.register_transition_cb(lambda _data, _states: self._publish())

    def say(self, text: str, *, warning: bool = False) -> None:
        """Log and publish."""
        log = self._node.get_logger()
        if warning:
            log.warn(text)
        else:
            log.info(text)
        self._hold(text)

    def waiting_for_help(self, reason: str) -> None:
        """Say that the robot waits, or that it goes on."""
        self.waits = reason
        if reason:
            said = f'{WAITING_FOR_HELP}: {reason}'
            self._node.get_logger().error(said)
            self._node.health.error('help', said)
        else:
            self._node.health.clear('help')
        self._hold(reason or 'trying again')

    def _hold(self, text: str) -> None:
        """Publish what was said last."""
        self.text, self._said_in = text, self._whereabouts()
        self._publish()

    def _publish(self) -> None:
        with self._lock:
            self.words += 1
            self._topic.publish(self._status())


def active_path(state: fsm.State) -> list[str]:
    """Return the labels from the machine's active state down to the deepest one."""
    if not isinstance(state, fsm.Container):
        return []
    active = state.get_active_states()
    if not active:
        return []
    return [active[0], *active_path(state[active[0]])]
