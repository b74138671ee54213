"""What `MissionWatchdog` is given once a second: what robot_behavior hears and knows."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Bool

import state_machines as fsm
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.mission_watchdog import (
    DRIVE_RECOVERY,
    MissionSight,
    MissionWatchdog,
)
from surveillance_behaviour.ros_adapters.peers import Deadlines, RosAnnouncer, active_path
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import pose_of_serialized
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

PERIOD = 1.0
"""Seconds of real time between two looks."""


class WatchdogInputs:
    """Looks at a mission once a second, in the executor's thread.

    Args:
        node: The node of the mission.
        mission: The mission.
        machine: Its machine.
        announcer: Where it says what it does.
        deadlines: How long peers may take to answer.
        elapsed: Seconds as they pass on the mission's clock.
    """

    def __init__(
        self,
        node: PatrolNode,
        mission: Mission,
        machine: fsm.StateMachine,
        announcer: RosAnnouncer,
        deadlines: Deadlines,
        elapsed: Callable[[], float],
    ) -> None:
        self._node = node
        self._mission = mission
        self._machine = machine
        self._announcer = announcer
        self._deadlines = deadlines
        self._elapsed = elapsed
        self._pose: bytes | None = None
        self._closed: tuple[str, ...] = ()
        self._stopped = False
        self._watch = MissionWatchdog(node.incidents, self._explained)
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            raw=True,
            each=True,
            owner='motion_controller',
        )
        StateSubscription(node, DoorStates, 'door_states', self._on_doors, owner='simulator')
        StateSubscription(
            node, Bool, 'stopped', self._on_stopped, owner='collision_monitor', only=True
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self._look, clock=steady)

    def _on_pose(self, serialized: bytes) -> None:
        self._pose = serialized

    def _on_doors(self, message: DoorStates) -> None:
        self._closed = tuple(sorted(message.closed))

    def _on_stopped(self, message: Bool) -> None:
        self._stopped = message.data

    def _look(self) -> None:
        mission, announcer = self._mission, self._announcer
        paused = 'paused' if self._machine.control.paused else ''
        pose = None
        if self._pose is not None:
            with contextlib.suppress(ValueError):
                pose = pose_of_serialized(self._pose)
        self._watch.look(
            MissionSight(
                self._elapsed(),
                '/'.join(active_path(self._machine)),
                announcer.words,
                announcer.text,
                pose,
                mission.battery.level,
                mission.battery.charging,
                announcer.waits,
                mission.failure,
                'stopped' if self._stopped else paused,
                mission.ports.reasoner.why_charge(),
                self._closed,
                mission.place,
                mission.staying,
            )
        )

    def _explained(self, state: str) -> float:
        """Return for how long a state may be silent, seconds."""
        name, settings = state.upper(), self._mission.settings
        if 'EXPLORE' in name or 'LOOKING' in name:
            drives = DRIVE_RECOVERY if self._mission.ports.looking is not None else 0.0
            return settings.choice.exploration_seconds + drives
        if 'VERIFY' in name:
            return DRIVE_RECOVERY
        if any(part in name for part in ('MOV', 'POINTING', 'CONTROLLING', 'RETURN', 'GOBACK')):
            # Where nobody measures the pose, a move takes as long as a person or chance says.
            measured = self._pose is not None and self._node.count_publishers('amcl_pose')
            return DRIVE_RECOVERY if measured else math.inf
        if 'RECHARG' in name:
            return settings.charge_stall_seconds or math.inf
        if 'INIT' in name or not state:
            return self._deadlines.build
        return self._deadlines.answer
