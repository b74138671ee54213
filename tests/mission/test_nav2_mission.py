"""A whole mission driven by Nav2, with types of its own definitions, whatever Nav2 answers."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from floor_plans import read_place
from lidar_navigation.localisation.place_locator import PlaceRegions
from surveillance_interfaces.msg import RobotPlace
from surveillance_runtime.qos import STATE_QOS
from tests import nav2_definitions

from .nav2 import DIE, REJECT, MapServer, Navigator
from .robot import CONFIG, Robot, mission

PLACE = CONFIG / 'seven_rooms.yaml'
PLACES = {'C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4'}

pytestmark = pytest.mark.long


@pytest.fixture
def actions(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(nav2_definitions.build()))
    return importlib.import_module('nav2_msgs.action')


@pytest.fixture
def robot(graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Robot]:
    place = yaml.safe_load(PLACE.read_text())['/**']['ros__parameters']
    drawn = {
        f'{kind}.{name}': value
        for kind in ('doors', 'room_positions')
        for name, value in place[kind].items()
    }
    with mission(graph, monkeypatch, 'surveillance', tmp_path / 'events.jsonl') as robot:
        simulated = {'execution_mode': 'SIMULATED', **drawn}
        robot.configure('planner_controller', **simulated)
        robot.configure('motion_controller', navigator='nav2', **simulated)
        robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
        yield robot


def place_regions() -> PlaceRegions:
    file = read_place(PLACE)
    grid = file.plan.grid()
    doors = [door.segment for door in file.plan.doors.values()]
    return PlaceRegions(grid, doors, file.place.positions)


class Nav2:
    """A map server and the navigators that come and go.

    Attributes:
        navigator: The present one.
    """

    def __init__(self, robot: Robot, graph: Any, actions: Any) -> None:
        self._robot, self._graph, self._actions = robot, graph, actions
        self._driven: list[tuple[float, float]] = []
        graph.add(MapServer, place=PLACE)
        self.begin((5.0, 10.0))
        nodes = robot.nodes
        robot.time.follow(lambda: list(nodes.values()), lambda: self._is_heard())

    def begin(self, at: tuple[float, float]) -> None:
        """Have a navigator come up."""
        options = {'actions': self._actions, 'at': at}
        self.navigator = self._graph.add(Navigator, {'use_sim_time': True}, **options)
        self._robot.nodes['bt_navigator'] = self.navigator

    def die(self) -> None:
        """Have the navigator die in the middle of a goal, and another one come up."""
        before = self.navigator
        self._graph.until(before.died.is_set, 300.0)
        del self._robot.nodes['bt_navigator']
        self._graph.drop(before)
        before.released.set()
        self._driven += before.driven
        self.begin(before.at)

    @property
    def driven(self) -> list[tuple[float, float]]:
        """The points that the robot came through, metres."""
        return [*self._driven, *self.navigator.driven]

    def _is_heard(self) -> bool:
        """Whether the motion controller knows where the robot is before time goes on."""
        motion = self._robot.nodes.get('motion_controller')
        point = None if motion is None else motion._robot._point
        at = self.navigator.at
        return self._robot.battery_is_heard() and (point is None or tuple(point[:2]) == at)


def test_whatever_nav2_answers_the_mission_goes_on(robot: Robot, graph: Any, actions: Any) -> None:
    said = graph.said()
    told = graph.listen(RobotPlace, 'robot_place', STATE_QOS)
    nav2 = Nav2(robot, graph, actions)
    nav2.navigator.script.extend([0, REJECT, 0, 104, 105, 106, 107, 4321, DIE])
    robot.begin()
    nav2.die()
    robot.until_visited(PLACES, since=0.0, latest=1200.0)
    for words in (
        'Nav2 rejected the goal',
        'Nav2 aborted the goal (error code 105 FAILED_TO_MAKE_PROGRESS, broke off at pose',
        'Nav2 aborted the goal (error code 4321, broke off at pose',
        'follow_path: action navigate_through_poses: ',
    ):
        assert any(words in line for line in said), said
    regions = place_regions()
    passed = [regions.place_at(point) for point in nav2.driven]
    expected = [place for place, _ in itertools.groupby(passed) if place is not None]
    # A state is repeated each second of real time.
    assert [place for place, _ in itertools.groupby(told, lambda m: m.place)] == expected
