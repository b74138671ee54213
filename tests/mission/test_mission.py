"""Whole missions of real nodes: hundreds of moves in seconds, with everything that goes wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .robot import Robot, mission

PLACES = {'C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4'}


@pytest.fixture(params=['surveillance', 'patrol'])
def robot(
    request: pytest.FixtureRequest, graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Robot]:
    with mission(graph, monkeypatch, request.param, tmp_path / 'mission.jsonl') as robot:
        yield robot


def test_a_mission_reaches_all_places_and_charges(robot: Robot) -> None:
    robot.begin()
    robot.until(1500.0)
    summary = robot.summary()
    assert set(summary.visits) == PLACES
    assert min(summary.visits.values()) >= 3
    assert sum(summary.visits.values()) >= 60
    assert summary.recharges >= 2
    assert not summary.failures
    assert {'URGENT', 'CORRIDOR', 'recharge'} <= set(summary.rules)
