#!/usr/bin/env python3
"""Count the files that one parameter walks through, from its line of YAML to what follows from it.

    .venv/bin/python benchmarks/walks.py

The armor server, the map builder and the reasoner run in this process, with a threshold that is no
other number. A file is on the walk when one of its functions holds the number: in an argument, a
variable or a result, alone or in a message, an axiom or a list. The walk ends with the decision, by
a policy that plans nothing: a plan calls functions for minutes while each call is looked at.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Any

from surveillance_behaviour.reasoner_node import Reasoner
from surveillance_fsm.ros import ServiceCaller
from surveillance_interfaces.msg import RobotPlace
from surveillance_interfaces.srv import Reason, ReferenceName
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_ontology.patrol_ontology import PatrolOntology
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


class Walk:
    """Notes in which files of the project a function holds the number."""

    def __init__(self) -> None:
        self.files: dict[str, str] = {}
        self._lock = threading.Lock()

    def look(self, frame: FrameType, event: str, result: Any) -> None:
        """Look at a function that is called or returns; a profiler of `sys.setprofile`."""
        if event not in ('call', 'return'):
            return
        name = frame.f_code.co_filename
        if not name.startswith(str(CHECKOUT)) or '.venv' in name or name == __file__:
            return
        name = name[len(str(CHECKOUT)) + 1 :]
        if name not in self.files and (
            holds(result) or any(holds(value) for value in list(frame.f_locals.values()))
        ):
            with self._lock:
                self.files.setdefault(name, frame.f_code.co_name)


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
        names = getattr(value, '__dataclass_fields__', None) or getattr(value, '__slots__', ())
        if 0 < len(names) <= MOST_FIELDS:
            return any(holds(getattr(value, name, None), depth - 1) for name in names)
    return False


class Robot(PatrolNode):
    """Says where the robot is, asks for one decision, and ends the process."""

    def __init__(self) -> None:
        super().__init__('walks')
        self._place = self.create_publisher(RobotPlace, 'robot_place', STATE_QOS)
        self._name = ServiceCaller(self, ReferenceName, 'ontology_map/reference_name')
        self._reason = ServiceCaller(self, Reason, 'reason')
        self.spawn(self._ask)

    def _ask(self) -> None:
        try:
            name = self._name.call(ReferenceName.Request(), PATIENCE).name
            stamp = self.get_clock().now()
            PatrolOntology(ArmorClient(self, 'walks', name)).record_place('E', stamp.nanoseconds)
            message = RobotPlace(place='E')
            message.header.stamp = stamp.to_msg()
            self._place.publish(message)
            self._reason.call(Reason.Request(), PATIENCE)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)


def walked() -> dict[str, str]:
    """Return the files of the walk as they were reached, with a function of each."""
    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    walk = Walk()
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) / 'threshold.yaml'
        own.write_text(
            f'/**:\n  ros__parameters:\n    urgency_threshold: {THRESHOLD}\n    policy: oldest\n'
        )
        words = ['--ros-args']
        for file in (CHECKOUT / 'config' / 'seven_rooms.yaml', own):
            words += ['--params-file', str(file)]
        threading.setprofile(walk.look)
        sys.setprofile(walk.look)
        try:
            run_nodes([ArmorServer, OntologyMapBuilder, Reasoner, Robot], words)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]
    return walk.files


def main(words: Sequence[str] = ()) -> int:
    """Print the walk and return the exit code."""
    files = walked()
    for name, function in files.items():
        print(f'{name:80}  {function}')
    print(f'files on the walk of urgency_threshold: {len(files)}')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
