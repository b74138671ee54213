"""A building of one place is patrolled by sweeping it, and how much was in view is told."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np

from benchmarks.whole_stack import Stack
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import write_map
from surveillance_interfaces.msg import PlaceCoverages
from surveillance_runtime.qos import STATE_QOS


def arena() -> np.ndarray:
    """Return 4.4 m x 4 m of floor with pillars, as Nav2's first map has them; row 0 at its top."""
    cells = np.full((100, 108), -1, np.int8)
    cells[8:92, 8:100] = 100
    cells[10:90, 10:98] = 0
    for row in (35, 65):
        for column in (38, 70):
            cells[row - 3 : row + 3, column - 3 : column + 3] = 100
    return cells


def until(stack: Stack, condition: Callable[[], object]) -> None:
    """Wait until something holds, or fail."""
    end, looks = time.monotonic() + 300.0, threading.Event()
    while not condition():
        assert stack.error is None
        assert time.monotonic() < end
        looks.wait(0.02)


def test_a_hall_is_swept_and_then_again(tmp_path: Path) -> None:
    write_map(tmp_path / 'map.yaml', arena(), 0.05, (-1.0, -1.0, 0.0))
    import_place(ImportRequest(tmp_path / 'map.yaml', tmp_path / 'place.yaml'))
    record = tmp_path / 'events.jsonl'
    own: dict[str, dict[str, Any]] = {
        'robot_behavior': {
            'record': str(record),
            'coverage.range': 1.5,
            # A busy machine changes no mission.
            'deadline.answer': 60.0,
        },
        'simulator': {'camera.rate': 1.0},
        '*': {'urgency_threshold': 600, 'map_file': str(tmp_path / 'map.yaml')},
    }

    def entries(kind: str) -> list[dict[str, object]]:
        lines = record.read_text().splitlines() if record.exists() else []
        return [entry for entry in map(json.loads, lines) if entry['event'] == kind]

    def whole() -> list[dict[str, object]]:
        return [each for each in entries('sweep') if float(str(each['covered'])) >= 0.95]

    stack = Stack(tmp_path / 'place.yaml', own)
    told: list[PlaceCoverages] = []
    stack.observer.create_subscription(PlaceCoverages, 'coverage', told.append, STATE_QOS)
    try:
        stack.start()
        until(stack, lambda: entries('decision') and told and told[-1].places)
        until(stack, lambda: whole() and entries('visit') and told[-1].places[0].share >= 0.95)
    finally:
        stack.close()
    assert not entries('failure'), entries('failure')
    assert int(str(whole()[0]['stops'])) >= 2
    # The next path begins where the sweep has left the robot.
    (first, *_) = entries('visit')
    path, driven = cast('Any', first['path']), cast('Any', first['driven'])
    assert math.dist(path[0], driven[0]) < 0.5
    assert {entry['rule'] for entry in entries('decision')} == {'sweep'}
    assert 14.0 < told[-1].places[0].area < 18.0
