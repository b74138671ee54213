"""The whole patrol in one process while doors close, things stand about and the robot is pushed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / 'benchmarks'))

import endurance  # noqa: E402

pytestmark = pytest.mark.early


def test_minutes_of_trouble_cost_neither_collisions_nor_the_way_home() -> None:
    watch, trouble, _ = endurance.run(
        ROOT / 'config' / 'seven_rooms.yaml', 90.0, seed=3, pause=(6.0, 12.0), log_level='info'
    )
    assert sum(trouble.made.values()) >= 5
    assert watch.collisions == 0
    assert not watch.empty
    assert not watch.wrong
    assert sum(watch.visits.values()) >= 3
