"""Figures as Prometheus reads them."""

from __future__ import annotations

import re

import pytest

from surveillance_operator.desk.metrics import metrics
from surveillance_operator.mission_state import MissionState

pytestmark = pytest.mark.unit
LINE = re.compile(r'[a-z_]+(\{[a-z]+="[^"]*"(,[a-z]+="[^"]*")*\})? -?[0-9.e+]+')


def test_every_line_is_of_the_text_format() -> None:
    state = MissionState().having(
        battery=50.0, visited_at={'R"1\n': 5.0}, doors={'D1': True}, now=65.0
    )
    told = metrics({'': MissionState(), 'bob': state}, [], 1.7e9, 3)
    lines = [line for line in told.splitlines() if not line.startswith('#')]
    assert all(LINE.fullmatch(line.replace(r'\"', '')) for line in lines), told
    assert 'patrol_battery_percent{robot="bob"} 50' in lines
    assert r'patrol_seconds_since_visit{robot="bob",place="R\"1\n"} 60' in lines
    assert 'patrol_alarms{state="unacknowledged"} 0' in lines
    assert 'patrol_page_viewers 3' in lines
    assert not any('robot=""' in line for line in lines)
