"""All nodes of a mission in one process, on simulated time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.parameter import Parameter

from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.initial_state_node import InitialState
from surveillance_behaviour.mission.mission_log import Summary, summarize
from surveillance_behaviour.reasoner_node import Reasoner
from surveillance_behaviour.robot_behavior_node import RobotBehavior
from surveillance_controllers.battery_controller_node import BatteryController
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_controllers.planner_controller_node import PlannerController
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_runtime.event_log import RecordEntry, read

from .simulated_time import START, SimulatedTime, simulated_time

CONFIG = Path(__file__).parents[2] / 'config'
NODES: dict[str, Callable[..., Any]] = {
    'armor_server': ArmorServer,
    'ontology_map_builder': OntologyMapBuilder,
    'battery_controller': BatteryController,
    'planner_controller': PlannerController,
    'motion_controller': MotionController,
    'reasoner': Reasoner,
    'initial_state': InitialState,
    'robot_behavior': RobotBehavior,
}
PATIENCE = 60.0
"""How long nodes wait for each other, seconds of real time: a busy machine changes no mission."""
BEHAVIOUR = {
    'urgency_threshold': 60,
    'recovery.help_seconds': 5.0,
    'deadline.answer': PATIENCE,
}
IMPATIENT = {
    'deadline.answer': 1.0,
    'deadline.build': 5.0,
    'deadline.plan': 1.0,
    'deadline.move': 2.0,
    'deadline.charge': 2.0,
}
"""The behaviour's deadlines where peers do not answer."""


def place_parameters(name: str = 'seven_rooms.yaml') -> dict[str, Any]:
    """Return a place's file as the parameters of the map builder."""
    with open(CONFIG / name, encoding='utf-8') as file:
        place = yaml.safe_load(file)['/**']['ros__parameters']
    values = {
        f'{key}.{room}': value
        for key in ('map', 'room_positions')
        for room, value in place[key].items()
    }
    return {
        **values,
        'robot_room': place['robot_room'],
        'recharge_rooms': place['recharge_rooms'],
    }


class Robot:
    """The nodes of one mission.

    Attributes:
        time: The clock they live by.
        nodes: By name; what is not there is away.
    """

    def __init__(self, graph: Any, time: SimulatedTime, behaviour: str, record: Path) -> None:
        self._graph = graph
        self.time = time
        self.record = record
        self._running = False
        self.nodes: dict[str, Any] = {}
        self.heard_of_battery: dict[BatteryMonitor, tuple[float | None, bool]] = {}
        self._parameters: dict[str, dict[str, Any]] = {
            'armor_server': {},
            'ontology_map_builder': {'armor_timeout': PATIENCE, **place_parameters()},
            'battery_controller': {
                'execution_mode': 'RANDOM',
                'random_seed': 3,
                'random_battery_time': [200.0, 300.0],
                'recharge_seconds': 20.0,
            },
            'planner_controller': {
                'execution_mode': 'RANDOM',
                'random_seed': 1,
                'peer_timeout': PATIENCE,
            },
            'motion_controller': {
                'execution_mode': 'RANDOM',
                'random_seed': 2,
                'peer_timeout': PATIENCE,
                'robot_room': 'E' if behaviour == 'surveillance' else '',
            },
            'reasoner': {'urgency_threshold': 60, 'deadline.answer': PATIENCE},
            'initial_state': {'map_source': 'configuration', **place_parameters()},
            'robot_behavior': {**BEHAVIOUR, 'behaviour': behaviour, 'record': str(record)},
        }
        if behaviour == 'surveillance':
            del self._parameters['reasoner'], self._parameters['initial_state']
        else:
            self._parameters['ontology_map_builder'] = {'armor_timeout': PATIENCE}

    def configure(self, name: str, **parameters: Any) -> None:
        """Change parameters of a node that is not there yet."""
        self._parameters[name].update({key.replace('__', '.'): v for key, v in parameters.items()})

    def be_impatient(self) -> None:
        """Have nobody wait long for whoever does not answer."""
        self._parameters['robot_behavior'].update(IMPATIENT)
        for name in ('planner_controller', 'motion_controller'):
            self._parameters[name]['peer_timeout'] = 0.5

    def begin(self, *without: str) -> None:
        """Start all nodes but some, and time."""
        for name in self._parameters:
            if name not in without:
                self.arrive(name)
        self._running = True
        self.time.start()

    def arrive(self, name: str) -> None:
        """Start one node."""
        parameters = {**self._parameters[name], 'use_sim_time': True}
        self.nodes[name] = self._graph.add(NODES[name], parameters)
        self.time.unattended = 'robot_behavior' not in self.nodes
        if self._running:
            self.time.tell()

    def leave(self, name: str) -> None:
        """End one node, as when its process dies."""
        node = self.nodes.pop(name)
        self.time.unattended = 'robot_behavior' not in self.nodes
        self._graph.remove(node)

    def until(self, seconds: float, timeout: float = 300.0) -> None:
        """Run the mission until ``seconds`` after its start."""
        end = START + seconds
        try:
            self._graph.until(lambda: self.time.error or self.time.now >= end, timeout)
        except AssertionError as error:
            raise AssertionError(f'{error}: {self.time.standing()}') from None
        assert self.time.error is None, repr(self.time.error)

    def until_visited(self, places: set[str], since: float, latest: float) -> None:
        """Run the mission until all places were visited since then, or until ``latest``."""
        self.until_true(lambda: self.visited(since) == places, since, latest)
        assert self.visited(since) == places

    def until_true(self, condition: Callable[[], bool], since: float, latest: float) -> None:
        """Run the mission until the condition holds, or until ``latest``."""
        now = since
        while now < latest and not condition():
            now = min(now + 10.0, latest)
            self.until(now)

    def summary(self) -> Summary:
        """Return what the record says."""
        return summarize(read(self.record))

    def events(self) -> list[RecordEntry]:
        """Return the record."""
        return read(self.record)

    def battery_is_heard(self) -> bool:
        """Whether all who decide by the battery were told what it said last, or it is away."""
        battery, behavior, reasoner = map(
            self.nodes.get, ('battery_controller', 'robot_behavior', 'reasoner')
        )
        monitors = [] if behavior is None else [behavior.mission.battery]
        if reasoner is not None:
            monitors.append(reasoner.decision_maker._battery)
        return battery is None or all(
            self.heard_of_battery.get(each) == battery._said for each in monitors
        )

    def set_parameter(self, node: Any, name: str, value: Any) -> str:
        """Set a parameter at run time; why that was refused, empty: it was not."""
        (result,) = node.set_parameters([Parameter(name, value=value)])
        return '' if result.successful else str(result.reason)

    def decisions(self) -> list[tuple[str, str]]:
        """Return the places that were chosen, with the rule."""
        return [
            (event.text('place'), event.text('rule'))
            for event in read(self.record)
            if event.name == 'decision'
        ]

    def visited(self, since: float = 0.0) -> set[str]:
        """Return the places that were visited, from ``since`` seconds after the start on."""
        return {
            event.text('place')
            for event in read(self.record)
            if event.name == 'visit' and event.time >= START + since
        }


@contextmanager
def mission(graph: Any, patch: pytest.MonkeyPatch, behaviour: str, record: Path) -> Iterator[Robot]:
    """Provide a robot whose time stops when the block ends."""
    with simulated_time(graph, patch) as time:
        robot = Robot(graph, time, behaviour, record)
        tell = BatteryMonitor._tell

        def told(monitor: BatteryMonitor) -> None:
            heard = monitor.level, monitor.low
            tell(monitor)
            robot.heard_of_battery[monitor] = heard

        patch.setattr(BatteryMonitor, '_tell', told)
        time.follow(lambda: list(robot.nodes.values()), robot.battery_is_heard)
        yield robot
