"""What the ontology's word counts for, and what a robot goes by while it does not answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from floor_plans import PatrolRules
from patrol_policy.decision import DecisionSettings
from state_machines import Interrupt
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.ontology_view import OntologyView
from surveillance_ontology.robot_ontology import Snapshot

from .scripted_world import World

NOBODY = Interrupt()
FAR = PatrolRules(thresholds={'R1': 500.0, 'R2': 500.0})


class Told(World):
    """An ontology that says what the test has it say, or nothing."""

    says: Mapping[str, frozenset[str]] | None = {}
    unseen = frozenset({'R2'})

    def snapshot(self, *args: object, **named: object) -> Snapshot:  # type: ignore[override]
        if self.says is None:
            raise UnavailableError('armor: away', lambda: False)
        found = super().snapshot(*args, **named)  # type: ignore[arg-type]
        seen = {place: at for place, at in found.visited_at.items() if place not in self.unseen}
        return replace(found, classes={**found.classes, **self.says}, visited_at=seen)


def view_of(world: World, others: Mapping[str, float] | None = None) -> OntologyView:
    visits = None if others is None else lambda: others
    return OntologyView(world, DecisionSettings(), visits, world.said.append, world.said.append)


def test_its_word_counts_where_it_knows_the_threshold() -> None:
    world = Told()
    urgent = frozenset({'ROOM', 'URGENT'})
    world.says = {'C1': urgent, 'R1': urgent, 'R2': urgent, 'R3': frozenset({'ROOM'})}
    _, said = view_of(world).look(100.0, 'E', FAR, {}, NOBODY)
    assert (said['C1'], said['R3']) == (True, False)
    # One threshold for all says nothing of R1, which has its own; in R2 nobody was yet.
    assert 'R1' not in said
    assert said['R2'] is True
    world.says = {'R1': urgent | {'ALERT'}}
    assert view_of(world).look(100.0, 'E', FAR, {}, NOBODY)[1]['R1'] is True


def test_a_fleet_goes_on_by_what_was_known_and_seen_since() -> None:
    world, others = Told(), {'C2': 130.0}
    noticed = frozenset({'ROOM', 'URGENT', 'ALERT'})
    world.says = {'C1': noticed, 'R1': noticed}
    view = view_of(world, others)
    view.look(100.0, 'E', PatrolRules(), {}, NOBODY)
    world.says, world.is_silent = None, True
    found, said = view.look(140.0, 'E', PatrolRules(), {'R1': 120.0}, NOBODY)
    assert (found.visited_at['C2'], found.visited_at['R1']) == (130.0, 120.0)
    # Nobody was in C1 since something was noticed there; in R1 this robot was.
    assert said.get('C1') is True
    assert 'R1' not in said
    assert 'patrolling on by what was known' in world.said[-1]
    world.says, world.is_silent = {}, False
    view.look(150.0, 'E', PatrolRules(), {}, NOBODY)
    assert 'answers again' in world.said[-1]


def test_a_robot_that_is_alone_waits_for_the_ontology() -> None:
    world = Told()
    view = view_of(world)
    view.look(100.0, 'E', PatrolRules(), {}, NOBODY)
    world.says = None
    with pytest.raises(CallError, match='away'):
        view.look(101.0, 'E', PatrolRules(), {}, NOBODY)
