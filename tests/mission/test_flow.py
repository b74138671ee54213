"""What a mission costs its ontology, and what an ontology that is built again holds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from surveillance_interfaces.msg import RobotPlace
from surveillance_ontology.armor_client import ArmorClient, value_in
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.qos import STATE_QOS

from .robot import Robot, mission
from .simulated_time import START

BEHAVIOURS = ['surveillance', 'patrol']
PLACES = {'C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4'}
TRIPS = {'surveillance': 2, 'patrol': 3}
"""Round trips to the armor server a leg, of all nodes together."""


@pytest.fixture(params=BEHAVIOURS)
def behaviour(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def robot(
    behaviour: str, graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Robot]:
    with mission(graph, monkeypatch, behaviour, tmp_path / 'events.jsonl') as robot:
        yield robot


def test_a_leg_costs_few_round_trips(
    robot: Robot, behaviour: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: Counter[str] = Counter()
    one, many = ArmorServer._on_directive, ArmorServer._on_list

    async def on_directive(self: Any, request: Any, response: Any) -> Any:
        asked[request.armor_request.client_name] += 1
        return await one(self, request, response)

    async def on_list(self: Any, request: Any, response: Any) -> Any:
        asked[request.armor_requests[0].client_name] += 1
        return await many(self, request, response)

    monkeypatch.setattr(ArmorServer, '_on_directive', on_directive)
    monkeypatch.setattr(ArmorServer, '_on_list', on_list)
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.until(30.0)
    before, legs = asked.total(), len(robot.decisions())
    robot.until_true(lambda: len(robot.decisions()) - legs >= 8, since=30.0, latest=300.0)
    legs = len(robot.decisions()) - legs
    assert legs >= 8
    assert (asked.total() - before) / legs < TRIPS[behaviour] + 0.5, asked


def test_a_server_that_comes_back_empty_is_told_what_was_and_nothing_else(
    robot: Robot, graph: Any
) -> None:
    places = graph.listen(RobotPlace, 'robot_place', STATE_QOS)
    robot.be_impatient()
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.until_visited(PLACES, since=0.0, latest=300.0)
    began = robot.time.now - START
    # The behaviour first, then the server: whoever saw the visits is gone as well.
    robot.time.at(began + 1.0, lambda: robot.leave('robot_behavior'))
    robot.time.at(began + 2.0, lambda: robot.leave('armor_server'))
    robot.time.at(began + 4.0, lambda: robot.arrive('armor_server'))
    robot.time.at(began + 6.0, lambda: robot.arrive('robot_behavior'))
    robot.until(began + 36.0)
    # A server on a busy machine lets some legs fail, which costs a recovery each.
    robot.until_true(
        lambda: bool(robot.visited(since=began + 10.0)), since=began + 36.0, latest=began + 600.0
    )
    visits = [
        (event.time, event.text('place')) for event in robot.events() if event.name == 'visit'
    ]
    # Without a behaviour it still goes where it was sent to, and says so.
    visits += [(seconds_of(place.header.stamp), place.place) for place in places]
    visits.sort()
    ends = [*(time for time, _ in visits[1:]), math.inf]
    # The robot was in a place from its arrival there to the next arrival at most.
    stays = {place: (time, end) for (time, place), end in zip(visits, ends, strict=True)}
    armor = ArmorClient(graph.node, 'test', 'surveillance', timeout=60.0)
    told = {
        room: float(value_in(armor.query.dataprop_b2_ind('visitedAt', room)[0]))
        for room in armor.query.ind_b2_class('LOCATION')
    }
    assert any(time < START + began + 2.0 for time, _ in stays.values()), (
        'one that nobody saw since'
    )
    for room, seconds in told.items():
        if room != places[-1].place:
            first, last = stays.get(room, (0.0, 0.0))
            assert first - 1.0 <= seconds <= last, room
    assert robot.visited(since=began + 10.0), 'the mission goes on'
    assert not any(
        'inconsistent' in event.text('reason')
        for event in robot.events()
        if event.name == 'failure'
    )
    (is_in,) = armor.query.objectprop_b2_ind('isIn', 'Robot1')
    assert is_in in {place.place for place in places}


def test_a_mission_outlives_an_ontology_that_contradicts_itself(
    robot: Robot, graph: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    armor = ArmorClient(graph.node, 'stranger', 'surveillance', timeout=60.0)

    def clash() -> None:
        armor.manipulation.add_ind_to_class('R4', 'DOOR')
        armor.utils.sync_buffered_reasoner()  # by now it may be built anew already

    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.time.at(40.0, clash)
    robot.until_true(lambda: bool(robot.visited(since=45.0)), since=80.0, latest=600.0)
    assert robot.visited(since=45.0), 'the mission goes on'
    assert armor.utils.sync_buffered_reasoner(), 'consistent'
    told = [line for line in capfd.readouterr().err.splitlines() if 'contradicts itself' in line]
    assert len(told) == 1
    assert 'R4 is DOOR' in told[0]
    last = [event.text('reason') for event in robot.events() if event.name == 'decision'][-1]
    assert 'R4 is DOOR' not in last, 'no decision names what is over'
