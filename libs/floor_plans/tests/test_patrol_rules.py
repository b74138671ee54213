"""What a place's file says of single places."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zoneinfo import available_timezones

import pytest

from floor_plans import PlaceError, read_place
from floor_plans.parameters import patrol_rules
from strict_files.files import FileError

ZONE = 'Europe/Rome' if 'Europe/Rome' in available_timezones() else ''
"""Not each machine has time zones."""
CONFIG = Path(__file__).with_name('places') / 'seven_rooms.yaml'


def test_a_file_says_what_differs_from_place_to_place(tmp_path: Path) -> None:
    path = tmp_path / 'place.yaml'
    more = """
    thresholds: {R1: 60, R4: 3600}
    exploration: {C1: 0}
    hours: {R3: "mon-fri 08:00-18:00"}
    keep_out: [R2]
    quiet_hours: daily 22:00-06:00
    time_zone: ZONE
""".replace('ZONE', ZONE)
    path.write_text(CONFIG.read_text(encoding='utf-8') + more, encoding='utf-8')
    rules = read_place(path).rules
    assert rules.thresholds == {'R1': 60.0, 'R4': 3600.0}
    assert rules.exploration == {'C1': 0.0}
    assert rules.calendar.keep_out == {'R2'}
    assert set(rules.calendar.hours) == {'R3'}
    path.write_text(path.read_text(encoding='utf-8').replace('R4: 3600', 'R9: 3600'))
    with pytest.raises(FileError, match=r"place.yaml:\d+: thresholds.R9: no room 'R9'"):
        read_place(path)


@pytest.mark.parametrize(
    ('described', 'problem'),
    [
        ({'thresholds': {'R1': -1}}, 'expected seconds from 0 to 1e9, got -1'),
        ({'exploration': {'R1': 'long'}}, "expected seconds from 0 to 1e9, got 'long'"),
        ({'hours': {'R1': 'mno 08:00-18:00'}}, "'mno' is no day"),
        ({'keep_out': ['R7']}, "no room 'R7', expected 'R1'"),
        ({'time_zone': 'Europe/Rme'}, "no time zone 'Europe/Rme'"),
    ],
)
def test_a_wrong_value_is_named(described: dict[str, Any], problem: str) -> None:
    with pytest.raises(PlaceError, match=problem):
        patrol_rules(described, ['R1'])
