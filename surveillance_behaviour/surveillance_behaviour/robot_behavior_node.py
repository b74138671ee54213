"""The node `robot_behavior`: runs one of the machines until it is told to stop.

Subscribes `battery_level`, `battery_low`, `battery_state`, `robot_place`, `map` and `amcl_pose`,
publishes `mission_status`, `coverage` and `paused`, and calls the services and actions of the
machine that `behaviour` names. Below `robot_behavior/fsm` the machine can be watched, paused and
stepped. In the behaviour `surveillance` this node decides: it publishes `decision` and offers
`why_not` and `go_to`; in `patrol` the node `reasoner` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool

import state_machines as fsm
from patrol_policy.decision import DecisionSettings
from strict_files.files import FileError
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.mission import Mission, MissionSettings
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_behaviour.ports import Ports
from surveillance_behaviour.ros_adapters.coverage import RosCoverage, RosSweep
from surveillance_behaviour.ros_adapters.decision_services import (
    MemorySettings,
    decision_maker_of,
    offer_decision_services,
)
from surveillance_behaviour.ros_adapters.looking import RosInspection
from surveillance_behaviour.ros_adapters.peers import (
    Deadlines,
    MissionClock,
    RosAnnouncer,
    RosMotion,
    RosPlaces,
    RosRoutine,
    hear_battery,
    ros_ontology,
)
from surveillance_behaviour.ros_adapters.reason_client import ReasonClient
from surveillance_behaviour.ros_adapters.watchdog_inputs import WatchdogInputs
from surveillance_runtime.conversions import charging_from, seconds_of
from surveillance_runtime.duplicate_nodes import DuplicateNodeWatch
from surveillance_runtime.introspection import IntrospectionServer
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import JOIN_SECONDS, PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

HUNG_STATE_SECONDS = 60.0
"""How long a state may ignore that it is to stop (to charge, say) before the mission goes on."""


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
        autonomy: str = self.parameter(
            'autonomy',
            'full',
            'How much the robot does without asking: below high a person is asked before it leaves '
            'for a place.',
            choices=tuple(level.name.lower() for level in fsm.Autonomy),
            read_only=True,
        )
        self._looks: bool = self.parameter(
            'looks',
            False,
            'Whether the robot looks at each room as the node observer says, and again at alerts '
            'that are not sure.',
            read_only=True,
        )
        choice = self.declare_live(DecisionSettings())
        settings = self.declare_fields(MissionSettings(choice))
        deadlines = self.declare_fields(Deadlines(), prefix='deadline.')
        memory = self.declare_fields(MemorySettings())
        self._record = self._open_record(memory.record)
        self._mission_clock = MissionClock(self)
        self._announcer = RosAnnouncer(self)
        battery = BatteryMonitor()
        ports = self._ports(choice, deadlines, battery, memory)
        clock = self._mission_clock
        self.mission = Mission(self._behaviour, settings, ports, battery, clock, self._record)
        self.machine = MACHINES[self._behaviour](self.mission)
        self.machine.preempt_timeout = HUNG_STATE_SECONDS
        self.machine.control.set_autonomy(fsm.Autonomy[autonomy.upper()])
        self._announcer.attach(self.mission, self.machine)
        # A pause lets no further state begin; what moves the robot has it stand at once.
        self._paused = OwnedTopic(self, Bool, 'paused')
        self._paused.publish(Bool(data=False))
        self._introspection = IntrospectionServer(
            self, self.get_name(), self.machine, '/', self._on_pause
        )
        self._introspection.start()
        DuplicateNodeWatch(self)
        hear_battery(self, battery)
        WatchdogInputs(self, self.mission, self.machine, self._announcer, deadlines, clock.elapsed)
        StateSubscription(
            self,
            BatteryState,
            'battery_state',
            lambda m: battery.set_charging(charging_from(m)),
            stamp=lambda told: seconds_of(told.header.stamp),
            qos=SENSOR_QOS,
            owner='battery_controller',
        )
        self._machine_thread = self.spawn(self._run, name='machine')

    def _on_pause(self, paused: bool) -> None:
        self._paused.publish(Bool(data=paused))

    def _ports(
        self,
        settings: DecisionSettings,
        deadlines: Deadlines,
        battery: BatteryMonitor,
        memory: MemorySettings,
    ) -> Ports:
        """Return the peers of the machine that runs; in `surveillance` this process decides."""
        clock = self._mission_clock
        ontology, places = ros_ontology(self, deadlines), RosPlaces(self, deadlines)
        looking = RosInspection(self, deadlines, clock) if self._looks else None
        sweep = RosSweep(self, RosCoverage(self, settings, clock.now), deadlines)
        if self._behaviour == 'patrol':
            reasoner = ReasonClient(self, deadlines, ontology, battery)
            routine = RosRoutine(self, deadlines, battery, clock)
            return Ports(
                ontology,
                places,
                self._announcer,
                reasoner,
                routine=routine,
                looking=looking,
                sweeping=sweep if sweep.sweeps_any else None,
            )
        maker = decision_maker_of(
            self, settings, memory, ontology, places, battery, clock.elapsed, sweep.seconds
        )
        offer_decision_services(
            self,
            maker,
            clock.now,
            lambda: self.mission.recovery.avoided(self.mission.now()),
        )
        motion = RosMotion(self, deadlines)
        return Ports(
            ontology,
            places,
            self._announcer,
            maker,
            motion=motion,
            looking=looking,
            sweeping=sweep,
        )

    def on_stop(self) -> None:
        """Preempts the machine, so that what it started is cancelled while messages flow."""
        self.machine.request_preempt()
        # What it does last is reported, too.
        self._machine_thread.join(JOIN_SECONDS)
        self._introspection.stop()

    def _run(self) -> None:
        if not self._mission_clock.wait_for_time(self.stopping):
            return
        try:
            while not self.stopping.is_set():
                try:
                    self.machine.execute()
                except fsm.SmachError as error:
                    # A step that failed before is not why the robot waits.
                    self.mission.failure = None
                    self._announcer.waiting_for_help(f'the machine broke: {error}')
                    self._mission_clock.sleep(self.mission.recovery.pause(), self.stopping)
                    self._announcer.waiting_for_help('')
        finally:
            self.mission.note('end')
            if self._record is not None:
                self._record.close()

    def _open_record(self, path: str) -> MissionRecord | None:
        if not path:
            return None
        try:
            record = MissionRecord(path)
        except FileError as error:
            raise NotNowError(f'parameter record: {error}') from None
        if record.problem:
            self.get_logger().warn(
                f'the earlier run is not continued, a new one begins: {record.problem}'
            )
        elif record.left_out.damaged:
            self.get_logger().warn(record.left_out.words())
        return record


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(RobotBehavior, args)
