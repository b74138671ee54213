"""What goes out as a message comes back as it was."""

from __future__ import annotations

import math

import pytest
from builtin_interfaces.msg import Time
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import BatteryState

from patrol_policy.situation import Decision
from surveillance_behaviour import conversions
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_runtime.conversions import (
    charging_from,
    point_from,
    point_message,
    point_messages,
)

numbers = st.floats(allow_nan=False, allow_infinity=False)
names = st.text('ABCR0123456789_', min_size=1, max_size=6)


@settings(max_examples=50)
@given(st.lists(st.tuples(numbers, numbers, numbers), max_size=5))
def test_paths_come_back(path: list[tuple[float, float, float]]) -> None:
    assert [point_from(each) for each in point_messages(path)] == path


@settings(max_examples=50)
@given(names, names, names, names, st.text(max_size=40), st.dictionaries(names, numbers))
def test_decisions_come_back(
    here: str, place: str, target: str, rule: str, reason: str, scores: dict[str, float]
) -> None:
    reason = reason.replace('\0', '')
    decision = Decision(12.5, here, place, target, rule, 'tour', reason, scores)
    message = conversions.decision_message(decision, 3, Time(sec=12, nanosec=500_000_000))
    assert message.sequence == 3
    assert conversions.decision_from(message) == decision


@pytest.mark.parametrize(
    ('message', 'words'),
    [
        (DecisionMessage(candidates=['A'], scores=[]), '0 scores came for 1 candidates'),
        (DecisionMessage(candidates=['A'], scores=[math.nan]), 'score of A is not a number'),
        (DecisionMessage(candidates=['A'] * 10_001), '10001 candidates: expected at most 10000'),
    ],
)
def test_a_decision_that_cannot_be_used_is_refused(message: DecisionMessage, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        conversions.decision_from(message)


def test_a_point_without_height_lies_on_the_floor() -> None:
    message = point_message((1, 2))
    assert (message.x, message.y, message.z) == (1.0, 2.0, 0.0)


@pytest.mark.parametrize(
    ('status', 'charging'),
    [('CHARGING', True), ('FULL', True), ('DISCHARGING', False), ('NOT_CHARGING', False)],
)
def test_a_battery_says_whether_it_is_charged(status: str, charging: bool) -> None:
    message = BatteryState()
    assert charging_from(message) is None
    message.power_supply_status = getattr(BatteryState, f'POWER_SUPPLY_STATUS_{status}')
    assert charging_from(message) is charging
