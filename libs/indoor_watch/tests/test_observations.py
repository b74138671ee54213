"""Every kind of observation has all that its entry promises: rules, words, events, hours."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import pytest

from indoor_watch import EventBook, Kind, Observation, rule_from
from indoor_watch.habits import Habits
from indoor_watch.observations import USUAL
from indoor_watch.watch_rules import severity_of

NOON = datetime(2026, 3, 2, 12, tzinfo=UTC)


def wanted_of(kind: Kind) -> list[str]:
    return [each for each in kind.wanted if each != USUAL]


@pytest.mark.parametrize('kind', list(Kind))
def test_each_state_of_a_kind_is_said_and_comes_back(kind: Kind) -> None:
    said = set()
    for state in kind.states:
        seen = Observation(kind, state, 'R1', '7' if kind.named else '', (1.0, 2.0))
        assert seen.words().endswith(' in R1')
        assert '{' not in seen.words()
        said.add(seen.words())
        assert Observation.from_json(json.loads(json.dumps(seen.to_json()))) == seen
    assert len(said) == len(kind.states)
    with pytest.raises(ValueError, match=f'^{kind} .*expected one of {kind.states[0]}'):
        Observation(kind, 'elsewhere', 'R1')


@pytest.mark.parametrize('kind', list(Kind))
def test_a_rule_may_ask_for_a_kind_and_is_broken_by_a_state_of_it(kind: Kind) -> None:
    for wanted in wanted_of(kind):
        entry = {kind.value: '7', 'is': wanted} if kind.named else {kind.value: wanted}
        rule = rule_from(entry)
        assert '{' not in rule.words()
        seen = [Observation(kind, state, 'R1', '7' if kind.named else '') for state in kind.states]
        broken = [each.state for each in seen if severity_of([rule], each, NOON)[0]]
        assert broken, wanted
        assert wanted not in broken
    if kind.learned:
        entry = {kind.value: '7', 'is': USUAL} if kind.named else {kind.value: USUAL}
        assert 'unusual for the hour' in rule_from(entry).words()


@pytest.mark.parametrize('kind', list(Kind))
def test_two_sightings_of_one_thing_are_one_event(kind: Kind) -> None:
    book = EventBook()
    for stamp in (1.0, 2.0):
        seen = Observation(kind, kind.states[0], 'R1', '', (1.0, 2.0), 0.9, stamp)
        book.take(seen, severity=1, rule='', visit=1)
    assert [each.sightings for each in book.events] == [2]


@pytest.mark.parametrize('kind', list(Kind))
def test_the_hours_of_a_kind_are_learned_where_its_entry_says_so(kind: Kind) -> None:
    habits = Habits()
    habits.learn(Observation(kind, kind.states[0], 'R1'), 1)
    assert bool(habits.state()) is bool(kind.learned)
    assert not kind.learned or kind.learned in kind.states
