"""What the observer has noticed, as the page asks for it."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from indoor_watch import Event, EventBook, EventState, Kind, Observation
from surveillance_operator import sightings
from surveillance_operator.sightings import Sightings
from surveillance_perception.observing.conversions import event_to_ros

pytestmark = pytest.mark.unit


def test_the_baseline_is_what_no_map_shows_and_nobody_has_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heard: dict[str, Callable[[Any], None]] = {}

    def subscribe(_node: object, _type: object, topic: str, hear: Callable[[Any], None]) -> None:
        heard[topic] = hear

    monkeypatch.setattr(sightings, 'StateSubscription', subscribe)
    found = Sightings(SimpleNamespace(), '')  # type: ignore[arg-type]
    assert found.baseline() == {'ok': True, 'events': []}
    book = EventBook()
    for number, state in enumerate(('unmapped', 'unmapped', 'unmapped', 'appeared')):
        at = (2.0 * number, 1.0)
        seen = Observation(Kind.OBJECT, state, 'C1', position=at, evidence='a.jpg', stamp=1.0)
        assert isinstance(book.take(seen, severity=1, rule='r', visit=1), Event)
    book.answer(2, EventState.ACKNOWLEDGED)
    book.answer(3, EventState.NORMAL)
    heard['events'](SimpleNamespace(events=[event_to_ros(each) for each in book.events]))
    listed = found.baseline()['events']
    assert [(each['number'], each['state']) for each in listed] == [
        (1, 'open'),
        (2, 'acknowledged'),
    ]
    assert listed[0]['evidence'] == ('a.jpg',)
    assert found.baseline('other')['events'] == []
