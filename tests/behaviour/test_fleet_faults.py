"""Cuts, losses and kills in a fleet: no visit is lost or invented, nobody is left behind."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from .fleet_faults import HEARD_WITHIN, ONTOLOGY, Fleet

pytestmark = pytest.mark.early


def judged(fleet: Fleet) -> list[str]:
    fleet.settle()
    fleet.run(60.0)
    fleet.look_for_doubles()
    return [*fleet.lost, *fleet.invented, *fleet.twice, *fleet.behind]


@pytest.mark.parametrize('seconds', [5.0, 30.0, 120.0])
def test_who_was_cut_off_patrols_on_and_tells_its_visits_afterwards(
    seconds: float, tmp_path: Path
) -> None:
    fleet = Fleet(3, tmp_path)
    fleet.run(200.0)
    robot = fleet.robots['robot2']
    before = len(robot.visits)
    fleet.cut({'robot2'}, seconds)
    seen = len(robot.visits)
    assert seen - before >= math.floor(seconds / 40.0)
    assert judged(fleet) == []


def test_a_fleet_without_its_ontology_and_without_each_other_loses_nothing(tmp_path: Path) -> None:
    fleet = Fleet(3, tmp_path)
    fleet.run(200.0)
    fleet.cut({ONTOLOGY, *fleet.robots}, 120.0)
    assert judged(fleet) == []
    fleet.lose(0.2, 0.2, 60.0)
    assert judged(fleet) == []


def test_a_robot_whose_host_dies_while_it_is_cut_off_tells_its_visits_when_it_is_back(
    tmp_path: Path,
) -> None:
    fleet = Fleet(3, tmp_path)
    fleet.run(200.0)
    fleet.network.down.add('robot2')
    robot = fleet.robots['robot2']
    fleet.run(90.0)
    last = robot.visits[-1]
    fleet.kill('robot2', 30.0, cut=True)
    fleet.run(HEARD_WITHIN)
    assert fleet.visited_at[last[2]] >= math.floor(last[0])
    assert judged(fleet) == []


def test_faults_drawn_by_chance_lose_nothing(tmp_path: Path) -> None:
    fleet = Fleet(3, tmp_path, seed=4)
    fleet.run(100.0)
    for _ in range(8):
        fleet.fail()
        fleet.settle()
    assert judged(fleet) == []
