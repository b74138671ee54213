"""What one robot of a fleet or all are told."""

from __future__ import annotations

from typing import Any

import pytest

from state_machines.exceptions import CallError
from surveillance_operator.fleet_actions import WORDS, FleetActions
from surveillance_runtime.node import PatrolNode
from tests.operator.peers import Robot


def test_a_word_is_for_one_robot_or_for_all_whatever_becomes_of_one(graph: Any) -> None:
    robots = {name: Robot(graph, name, answers=name != 'bert') for name in ('anna', 'bert')}
    names = tuple(robots)
    actions = FleetActions(graph.add(PatrolNode, name='hands'), lambda: names, timeout=60.0)
    assert actions.carry_out('anna', WORDS['stop'][1]) == 'done'
    assert (robots['anna'].told, robots['bert'].told) == ([True], [])
    with pytest.raises(CallError, match=r'anna: done; bert: no'):
        actions.carry_out('all', WORDS['release'][1])
    assert robots['anna'].told == [True, False]
    assert actions.carry_out('all', WORDS['out'][1]) == 'anna: done; bert: done'
    assert actions.carry_out('bert', WORDS['pause'][1]) == 'done'
    assert robots['bert'].told == [True, 'pause']
    with pytest.raises(ValueError, match="no robot 'ana': expected 'anna'"):
        actions.carry_out('ana', WORDS['stop'][1])


def test_taking_out_a_robot_that_is_alone_is_one_line(graph: Any) -> None:
    alone = FleetActions(graph.add(PatrolNode, name='hands'), lambda: ('',), timeout=0.1)
    with pytest.raises(CallError, match='robot_behavior is not running'):
        alone.carry_out('all', WORDS['out'][1])
