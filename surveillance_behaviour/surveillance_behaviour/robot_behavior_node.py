"""The node `robot_behavior`: runs one of the machines until it is told to stop.

Subscribes `battery_level`, `state/battery_low` and `battery_state`, publishes `decision` and
`mission_status`, and calls the services and actions of the machine that `behaviour` names. Below
`robot_behavior/fsm` the machine can be watched, paused and stepped.
"""

from __future__ import annotations

import os
import random
from collections.abc import Sequence
from typing import Any, cast

from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, UInt8

import surveillance_fsm as fsm
from surveillance_behaviour import behaviour_parameters, conversions
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.battery_gauge import BatteryGauge
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.record import MissionRecord, RecordError, read
from surveillance_behaviour.mission.resumption import CutOff, cut_off
from surveillance_behaviour.peers.announcing import DecisionTopic, RosAnnouncer
from surveillance_behaviour.peers.ports import Ports
from surveillance_behaviour.peers.ros_ports import RosMotion, RosPlaces, RosRoutine, ros_knowledge
from surveillance_behaviour.policy.rules import RECHARGE
from surveillance_fsm.ros import IntrospectionServer
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_runtime.node import JOIN_SECONDS, PatrolNode, StartError
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.waiting import ClockWait


class RobotBehavior(PatrolNode):
    """The robot's behaviour, as a state machine on a thread of its own."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('robot_behavior', **node_options)
        self._behaviour: str = self.parameter(
            'behaviour',
            'surveillance',
            'Which machine runs: surveillance (compute_path, follow_path) or patrol (start, '
            'reason, motion/planner, motion/controller, recharge).',
            choices=tuple(MACHINES),
            read_only=True,
        )
        settings = behaviour_parameters.mission_settings(self)
        deadlines = behaviour_parameters.deadlines(self)
        seed = behaviour_parameters.random_seed(self)
        path: str = self.parameter(
            'record', '', 'File that the mission is recorded in; empty: none.', read_only=True
        )
        left_at = self._where_it_was_cut_off(path)
        self._record = _open_record(path)
        patrols = self._behaviour == 'patrol'
        gauge = BatteryGauge()
        self._wait = ClockWait(self)
        self._announcer = RosAnnouncer(self, DecisionTopic(self))
        ports = Ports(
            knowledge=ros_knowledge(self, deadlines),
            places=RosPlaces(self, deadlines),
            announcer=self._announcer,
            motion=None if patrols else RosMotion(self, deadlines),
            routine=RosRoutine(self, deadlines, gauge) if patrols else None,
        )
        self.mission = Mission(
            self._behaviour,
            settings,
            ports,
            gauge,
            cast(fsm.Clock, self._wait),
            self._record,
            random.Random(seed if seed >= 0 else None),
            left_at,
        )
        self.machine = MACHINES[self._behaviour](self.mission)
        self._announcer.attach(self.mission, self.machine)
        self._introspection = IntrospectionServer(self, self.get_name(), self.machine, '/')
        self._introspection.start()
        self.create_subscription(
            UInt8, 'battery_level', lambda m: gauge.set_level(float(m.data)), STATE_QOS
        )
        self.create_subscription(
            Bool, 'state/battery_low', lambda m: gauge.set_low(m.data), STATE_QOS
        )
        self.create_subscription(
            BatteryState,
            'battery_state',
            lambda m: gauge.set_charging(conversions.charging_from(m)),
            SENSOR_QOS,
        )
        if patrols:
            self.create_subscription(DecisionMessage, 'decision', self._on_decision, STATE_QOS)
        self._machine_thread = self.spawn(self._run, name='machine')

    def on_stop(self) -> None:
        """Preempts the machine, so that what it started is cancelled while messages flow."""
        self.machine.request_preempt()
        # What it does last is reported, too.
        self._machine_thread.join(JOIN_SECONDS)
        self._introspection.stop()

    def _run(self) -> None:
        # Under use_sim_time nothing has a time before the first clock message.
        if not self._wait.now() and not self._wait.sleep(1e-9, self.stopping):
            return
        try:
            while not self.stopping.is_set():
                try:
                    self.machine.execute()
                except fsm.SmachError as error:
                    self._announcer.waiting_for_help(f'the machine broke: {error}')
                    self._wait.sleep(self.mission.recovery.pause(), self.stopping)
                    self._announcer.waiting_for_help('')
        finally:
            self.mission.ended()
            if self._record is not None:
                self._record.close()

    def _where_it_was_cut_off(self, path: str) -> CutOff | None:
        if not path or not os.path.isfile(path):
            return None
        try:
            return cut_off(read(path))
        except RecordError as error:
            self.get_logger().warn(f'what was begun before is begun anew: {error}')
            return None

    def _on_decision(self, message: DecisionMessage) -> None:
        decision = conversions.decision_from(message)
        # Charging is this node's own decision, which the mission knows of.
        if decision.rule != RECHARGE:
            self.mission.note_decision(decision)


def _open_record(path: str) -> MissionRecord | None:
    if not path:
        return None
    try:
        return MissionRecord(path)
    except RecordError as error:
        raise StartError(f'parameter record: {error}') from None


def main(args: Sequence[str] | None = None) -> int:
    """Runs the node until it is stopped."""
    return run_node(RobotBehavior, args)
