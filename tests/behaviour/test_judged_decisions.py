"""How the campaign judges a mission's decisions by those of its twin."""

from __future__ import annotations

from typing import Any

from benchmarks.decisions import Leg, SetClock, compare, legs_of, wrongly_urgent


def event(kind: str, time: float, place: str = '', **more: Any) -> dict[str, Any]:
    return {'event': kind, 'time': time, 'place': place, **more}


def test_a_leg_takes_as_long_as_it_did_whatever_its_clock_shows() -> None:
    events = [
        event('start', 0.0, 'E', urgency_threshold=60.0),
        event('decision', 0.0, 'C1', rule='CORRIDOR'),
        event('visit', 10.0, 'C1'),
        event('decision', 12.0, 'R1', rule='URGENT'),
        event('visit', 3620.0, 'R1'),  # set an hour ahead at 15
        event('decision', 3630.0, 'C1', rule='URGENT'),
        event('visit', 41.0, 'C1'),  # and back at 35
    ]
    clock = SetClock([(15.0, 3600.0), (35.0, 0.0)])
    legs = legs_of(events, clock)
    assert legs == [Leg('C1', 'R1', 12.0, 8.0), Leg('R1', 'C1', 30.0, 11.0)]
    assert wrongly_urgent(events, clock) == ['C1, visited 20 s ago, threshold 60 s']


def test_legs_are_compared_with_the_twins_but_not_while_nodes_were_away() -> None:
    twin = [Leg('E', 'C1', 0.0, 10.0), Leg('E', 'C1', 90.0, 12.0)]
    driven = [Leg('E', 'C1', 5.0, 11.0), Leg('E', 'C1', 50.0, 33.0), Leg('C1', 'E', 90.0, 9.0)]
    found = compare(driven, twin, hits=[(60.0, 70.0)])
    assert found.shares == (1.0,)
    assert found.passed
    assert not compare(driven[1:], twin).passed
