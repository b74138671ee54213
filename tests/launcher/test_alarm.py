"""The alarm of a run calls a person for the incidents of all nodes."""

from __future__ import annotations

import json
import threading
from pathlib import Path

from launcher.alarm import Alarm
from surveillance_runtime.incidents import SETTLED, Call


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_an_incident_is_called_kept_and_cleared(tmp_path: Path) -> None:
    clock, calls = Clock(), []
    called = threading.Condition()

    def call(told: Call) -> None:
        with called:
            calls.append(told.text)
            called.notify_all()

    alarm = Alarm(call, tmp_path, clock)
    alarm.hear('robot_behavior', 'decision 3: E -> C1 [tour] why')
    alarm.hear('robot_behavior', 'incident [door D1, alarm]: D1 is closed')
    alarm.hear('robot_behavior', 'incident [door D1, alarm]: D1 is closed')
    alarm.trouble('planner_controller died 5 times in 9 s, last: exit code 1')
    clock.now = 20.0
    alarm.hear('robot_behavior', 'incident [door D1, over]: the mission goes on in C1')
    clock.now = 20.0 + SETTLED
    alarm.hear('robot_behavior', 'incident [topic map, warning]: two publishers')
    with called:
        assert called.wait_for(lambda: len(calls) == 3, 30.0)
    alarm.close()
    assert calls == [
        'D1 is closed',
        'planner_controller died 5 times in 9 s, last: exit code 1',
        'all clear after 20 s: D1 is closed: the mission goes on in C1',
    ]
    kept = [json.loads(line) for line in (tmp_path / 'incidents.jsonl').read_text().splitlines()]
    assert [(each['kind'], each['name'], each['seconds']) for each in kept] == [
        ('door', 'D1', None),
        ('node', 'planner_controller', None),
        ('topic', 'map', None),
        ('door', 'D1', 20.0),
    ]
