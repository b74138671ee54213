"""What a decision is made from: idleness, thresholds, and what the ontology said."""

from __future__ import annotations

import math
from dataclasses import replace

from patrol_policy.hours import Openings
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import PolicyMemory

from .worlds import seven_rooms, world


def test_a_place_that_nobody_visited_counts_from_the_beginning() -> None:
    known = world(since=40.0)
    assert known.idleness_of('C1') == 0.0
    assert known.idleness_of('R4') == 60.0
    assert known.idleness_in_words('R4') == 'not visited yet'
    assert known.idleness_in_words('R1') == 'last visit 80.0 s ago'
    assert list(known.idleness) == [known.idleness_of(place) for place in known.graph.places]


def test_nobody_waits_for_a_place_that_only_may_be_visited() -> None:
    optional = Openings({}, frozenset({'R1', 'R2'}), {})
    classes = {'R1': frozenset({'ROOM'}), 'R2': frozenset({'ROOM', 'ALERT'})}
    known = world(classes=classes, said={'R1': True, 'R2': True}, openings=optional)
    assert known.threshold_of('R1') == math.inf
    assert known.threshold_of('E') == 60.0
    # Unless something was noticed there.
    assert (known.said_of('R1'), known.said_of('R2'), known.said_of('E')) == (False, True, None)
    assert (known.is_urgent('R1'), known.is_urgent('R2')) == (False, True)
    assert known.is_in('R2', 'ALERT&URGENT')
    assert not known.is_in('R1', 'ROOM&URGENT')


def test_the_first_class_that_has_somebody_decides() -> None:
    known = world(priorities=Priorities(('ALERT', 'URGENT', 'CORRIDOR')))
    assert known.first_of(['C2', 'R1', 'R2']) == ('URGENT', ('R1', 'R2'))
    assert known.first_of(['C2', 'E']) == ('CORRIDOR', ('C2', 'E'))
    assert replace(known, priorities=Priorities(())).first_of(['R1', 'C2'])[0] == 'any'


def test_a_question_changes_nothing_of_the_next_choice() -> None:
    memory = PolicyMemory()
    asked = memory.for_a_question()
    asked.generator.random()
    assert memory.generator.getstate() != asked.generator.getstate()
    assert memory.planner is None
    graph = seven_rooms()
    part = memory.without(graph, frozenset({'R4'}), 'C2')
    assert 'R4' not in part.index
    assert memory.without(graph, frozenset({'R4'}), 'C1') is part
