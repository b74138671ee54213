#!/usr/bin/env python3
"""Count the files that a parameter, and a recharge, walk through.

    .venv/bin/python benchmarks/walks.py

The parameter: the armor server, the map builder and the reasoner run in this process, with a
threshold that is no other number. A file is on the walk when one of its functions holds the number:
in an argument, a variable or a result, alone or in a message, an axiom or a list. The walk ends
with the decision, by a policy that plans nothing: a plan calls functions for minutes while each
call is looked at.

The recharge: the behaviour begins at its station with an empty battery, which an operator of mode
MANUAL sets to full once the robot charges. A file is on the walk when one of its functions runs
below one of `RECHARGE`: the states that choose to charge and charge, the battery's changes of
level, and what the behaviour hears of them.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from state_machines.ros import ServiceCaller
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.machines.surveillance_machine import ChooseRoomTask, RechargeTask
from surveillance_behaviour.reasoner_node import Reasoner
from surveillance_behaviour.robot_behavior_node import RobotBehavior
from surveillance_controllers.battery_controller_node import BatteryController
from surveillance_interfaces.msg import MissionStatus, RobotPlace
from surveillance_interfaces.srv import ConsoleCommand, Reason, ReferenceName
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_nodes
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.testing import claim_domain

CHECKOUT = Path(__file__).resolve().parents[1]
THRESHOLD = 86413
"""A number that nothing else is."""
PATIENCE = 30.0
"""Seconds for each answer."""
MOST_FIELDS = 10
"""An object with more fields is a collection of many facts, of which the number is only one."""


LONGEST_TEXT = 60
"""A longer text is a sentence about the number, not the number."""


RECHARGE = (
    ChooseRoomTask.work,
    RechargeTask.work,
    BatteryController._set_level,
    BatteryMonitor.set_level,
    BatteryMonitor.set_low,
)
"""Where the walk of a recharge begins, in each of its threads."""


class Walk:
    """Notes the files of the project that are on a walk.

    Args:
        begins: The functions below which every function is on it; none: those that hold the number.
    """

    def __init__(self, *begins: Callable[..., Any]) -> None:
        self.files: dict[str, str] = {}
        self._begins = {each.__code__ for each in begins}
        self._thread = threading.local()
        self._lock = threading.Lock()

    def look(self, frame: FrameType, event: str, result: Any) -> None:
        """Look at a function that is called or returns; a profiler of `sys.setprofile`."""
        if event not in ('call', 'return'):
            return
        is_on_it = self._is_below(frame, event) if self._begins else None
        name = frame.f_code.co_filename
        if not name.startswith(str(CHECKOUT)) or '.venv' in name or name == __file__:
            return
        name = name[len(str(CHECKOUT)) + 1 :]
        if name in self.files:
            return
        if is_on_it is None:
            is_on_it = holds(result) or any(map(holds, list(frame.f_locals.values())))
        if is_on_it:
            with self._lock:
                self.files.setdefault(name, frame.f_code.co_name)

    def _is_below(self, frame: FrameType, event: str) -> bool:
        """Tell whether a function is one that the walk begins with, or is called by one."""
        depth: int = getattr(self._thread, 'depth', 0)
        if frame.f_code in self._begins:
            self._thread.depth = depth + (1 if event == 'call' else -1)
            return True
        return depth > 0


def holds(value: Any, depth: int = 3) -> bool:
    """Tell whether a value is the number, or a small object or a list that has it inside."""
    if isinstance(value, bool) or value is None:
        return False
    if isinstance(value, int | float):
        return value == THRESHOLD
    if isinstance(value, str):
        return len(value) <= LONGEST_TEXT and str(THRESHOLD) in value
    if depth == 0:
        return False
    if isinstance(value, list | tuple | set | frozenset):
        return any(holds(item, depth - 1) for item in list(value)[:50])
    if isinstance(value, dict):
        return any(holds(item, depth - 1) for item in list(value.values())[:50])
    if type(value).__module__.startswith(('surveillance_', 'rcl_interfaces')):
        names: Any = getattr(value, '__dataclass_fields__', None) or getattr(value, '__slots__', ())
        if 0 < len(names) <= MOST_FIELDS:
            return any(holds(getattr(value, name, None), depth - 1) for name in names)
    return False


class Guide(PatrolNode):
    """Says that the robot is in E, has something done, and prints the walk when that is over.

    Args:
        title: Of what the walk is.
        walk: Its files are printed.
    """

    def __init__(self, title: str, walk: Walk) -> None:
        super().__init__('walks')
        self._title, self._walk = title, walk
        self._place = self.create_publisher(RobotPlace, 'robot_place', STATE_QOS)
        self._name = ServiceCaller(self, ReferenceName, 'ontology_map/reference_name')
        self.spawn(self._work)

    def _work(self) -> None:
        try:
            name = self._name.call(ReferenceName.Request(), PATIENCE).name
            stamp = self.get_clock().now()
            RobotOntology(ArmorClient(self, 'walks', name)).record_place('E', stamp.nanoseconds)
            message = RobotPlace(place='E')
            message.header.stamp = stamp.to_msg()
            self._place.publish(message)
            self.guide()
        finally:
            self.finish()

    def guide(self) -> None:
        """Have it done, and wait for its end."""
        raise NotImplementedError

    def on_stop(self) -> None:
        """Print the walk: `run_nodes` may end the process."""
        for file, function in self._walk.files.items():
            print(f'{file:80}  {function}')
        print(f'files on the walk of {self._title}: {len(self._walk.files)}', flush=True)


class Asker(Guide):
    """Asks for one decision."""

    def guide(self) -> None:
        ServiceCaller(self, Reason, 'reason').call(Reason.Request(), PATIENCE)


class Charger(Guide):
    """Charges the robot."""

    def guide(self) -> None:
        charging, charged = threading.Event(), threading.Event()

        def told(status: MissionStatus) -> None:
            if status.text.startswith('charging in'):
                charging.set()
            elif status.text.startswith('charged in'):
                charged.set()

        self.create_subscription(MissionStatus, 'mission_status', told, STATE_QOS)
        battery = ServiceCaller(self, ConsoleCommand, 'battery_controller/command')
        if charging.wait(PATIENCE):
            battery.call(ConsoleCommand.Request(line='battery set 100'), PATIENCE)
            charged.wait(PATIENCE)


def take(walk: Walk, factories: Sequence[Callable[[], PatrolNode]], parameters: str) -> None:
    """Run nodes with parameters of their own until one ends the process, and look at them."""
    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) / 'own.yaml'
        own.write_text(f'/**:\n  ros__parameters: {{{parameters}}}\n')
        words = ['--ros-args']
        for file in (CHECKOUT / 'config' / 'seven_rooms.yaml', own):
            words += ['--params-file', str(file)]
        threading.setprofile(walk.look)
        sys.setprofile(walk.look)
        try:
            run_nodes([ArmorServer, OntologyMapBuilder, *factories], words)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]


def main() -> int:
    """Print the walks and return the exit code."""
    walk = Walk()
    take(
        walk,
        [Reasoner, partial(Asker, 'urgency_threshold', walk)],
        f'urgency_threshold: {THRESHOLD}, policy: oldest',
    )
    walk = Walk(*RECHARGE)
    take(
        walk,
        [BatteryController, RobotBehavior, partial(Charger, 'a recharge', walk)],
        'execution_mode: MANUAL, console: false, battery_initial_value: 0',
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
