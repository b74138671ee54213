"""Where the behaviour says what it does: the log, and two latched topics."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from builtin_interfaces.msg import Time

import surveillance_fsm as fsm
from surveillance_behaviour import conversions
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.recovery import WAITING_FOR_HELP
from surveillance_behaviour.policy.world import Decision
from surveillance_fsm.ros import ClockWait
from surveillance_fsm.structure import Structure
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.msg import MissionStatus
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

MARGIN = 1e-6
"""By how much a wait is announced longer than it is, seconds: more than stamps are rounded by."""


class MissionClock(ClockWait):
    """The mission's clock, in seconds of ROS time.

    Under `use_sim_time` it says on `mission_waits_until` until when the mission waits, zero for an
    event, so that a simulator lets no time pass while the mission is at work.
    """

    def __init__(self, node: PatrolNode) -> None:
        super().__init__(node)
        self._topic = None
        if node.get_parameter('use_sim_time').value:
            self._topic = node.create_publisher(Time, 'mission_waits_until', STATE_QOS)

    def sleep(self, seconds: float, interrupt: fsm.Interrupt | None = None) -> bool:
        """Wait; return False when the interrupt ended it early."""
        # A little later than it waits: time that stops a nanosecond early would wake nobody.
        self._announce(self.now() + seconds + MARGIN)
        return super().sleep(seconds, interrupt)

    def wait_for_event(self) -> None:
        """Say that what comes next ends by an event, whenever that is."""
        self._announce(0.0)

    def _announce(self, until: float) -> None:
        if self._topic is not None:
            fraction, whole = math.modf(until)
            self._topic.publish(Time(sec=int(whole), nanosec=int(fraction * 1e9)))


class DecisionTopic:
    """Publishes and logs decisions, numbered from 1."""

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._count = 0
        self._topic = node.create_publisher(DecisionMessage, 'decision', STATE_QOS)

    def publish(self, decision: Decision) -> None:
        """One more decision."""
        self._count += 1
        stamp = self._node.get_clock().now().to_msg()
        self._topic.publish(conversions.decision_message(decision, self._count, stamp))
        self._node.get_logger().info(
            f'decision {self._count}: {decision.from_place} -> {decision.place} '
            f'[{decision.rule}] {decision.reason}'
        )


class RosAnnouncer:
    """The machines' announcer on the robot.

    Args:
        node: The node that speaks.
        decisions: Where decisions go; None: whoever decides publishes them.
    """

    def __init__(self, node: PatrolNode, decisions: DecisionTopic | None) -> None:
        self._node = node
        self._decisions = decisions
        self._lock = threading.Lock()
        self._text = ''
        self._waiting = False
        self._status: Callable[[], MissionStatus] = MissionStatus
        self._topic = node.create_publisher(MissionStatus, 'mission_status', STATE_QOS)

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
                waiting_for_help=self._waiting,
                text=self._text,
                avoided=sorted(mission.recovery.avoided(mission.now())),
            )

        self._status = status
        for inner in Structure(machine).walk():
            inner.container.register_start_cb(lambda _data, _states: self._publish())
            inner.container.register_transition_cb(lambda _data, _states: self._publish())

    def decision(self, decision: Decision) -> None:
        """Announce that a place was chosen."""
        if self._decisions is not None:
            self._decisions.publish(decision)

    def say(self, text: str, *, warning: bool = False) -> None:
        """Log and publish."""
        log = self._node.get_logger()
        if warning:
            log.warn(text)
        else:
            log.info(text)
        self._text = text
        self._publish()

    def waiting_for_help(self, reason: str) -> None:
        """Say that the robot waits, or that it goes on."""
        self._waiting = bool(reason)
        self._text = reason or 'trying again'
        if reason:
            said = f'{WAITING_FOR_HELP}: {reason}'
            self._node.get_logger().error(said)
            self._node.health.error('help', said)
        else:
            self._node.health.clear('help')
        self._publish()

    def _publish(self) -> None:
        with self._lock:
            self._topic.publish(self._status())


def active_path(state: fsm.State) -> list[str]:
    """Return the labels from the machine's active state down to the deepest one."""
    if not isinstance(state, fsm.Container):
        return []
    active = state.get_active_states()
    if not active:
        return []
    return [active[0], *active_path(state[active[0]])]
